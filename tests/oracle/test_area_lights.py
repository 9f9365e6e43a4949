"""Pictures of floors below area lights of pbrt scenes, against closed forms: nothing of an emitter
is lost in its own shadow.

The emitter is 1 m wide, its middle 1 m above the origin of a diffuse floor of 8 m, which the camera
sees from the side.  Closed forms are irradiance over the emitter's radiance at points ``x`` and
``z`` of the floor, arrays of one shape in metres.
"""

import numpy as np
import pytest

from lfcore.optics.bundles import Bundles
from lfcore.scene.emitters import POINTS
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

RADIUS = 0.5


def sphere(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """That of a point in the middle with the sphere's intensity."""
    return np.pi * RADIUS**2 / (x**2 + z**2 + 1) ** 1.5


def disk(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """P. D. Foote, "Illumination from circular disk sources", 1915."""
    s, r = x**2 + z**2, RADIUS**2
    return np.pi / 2 * (1 - (s + 1 - r) / np.sqrt((s + 1 + r) ** 2 - 4 * s * r))


def square(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Lambert's formula over the four sides."""
    corners = ((-RADIUS, -RADIUS), (RADIUS, -RADIUS), (RADIUS, RADIUS), (-RADIUS, RADIUS))
    rays = np.stack([np.stack([a - x, np.ones_like(x), b - z], -1) for a, b in corners])
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    after = np.roll(rays, -1, axis=0)
    normal = np.cross(rays, after)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.abs((np.arccos((rays * after).sum(-1)) * normal[..., 1]).sum(0)) / 2


PIXELS, WIDTH, RADIANCE = 96, 1.1, 10.0
QUAD = 'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [{}]'
SCENE = """
LookAt 2.5 3 0  2.5 0 0  0 0 1
Camera "perspective"
WorldBegin
Material "matte" "rgb Kd" [1 1 1]
{floor}
AttributeBegin
Material "matte" "rgb Kd" [0 0 0]
AreaLightSource "diffuse" "rgb L" [10 10 10]
Translate 0 1 0
{emitter}
AttributeEnd
WorldEnd
"""

EMITTERS = {
    "sphere": ('Shape "sphere" "float radius" 0.5', sphere),
    "disk": ('Rotate 90 1 0 0 Shape "disk" "float radius" 0.5', disk),
    "square": (QUAD.format("-.5 0 -.5  .5 0 -.5  .5 0 .5  -.5 0 .5"), square),
}


def floors(path, emitter: str, points: int) -> tuple[np.ndarray, np.ndarray]:
    """The floor's radiance, traced (PIXELS, PIXELS, 3) and by its closed form (PIXELS, PIXELS)."""
    shape, closed = EMITTERS[emitter]
    floor = QUAD.format("-9 0 -9  -9 0 9  9 0 9  9 0 -9")
    path.write_text(SCENE.format(floor=floor, emitter=shape), encoding="ascii")
    scene = build_pbrt_scene(path, light_points=points)
    step = WIDTH / PIXELS
    middle, steps = np.zeros((1, 4), np.float32), np.array([0, 0, step, step], np.float32)
    pinhole = Bundles(middle, steps, PIXELS, PIXELS, pixel_pitch=step)
    seen = Tracer(scene, build_bvh(scene.triangles)).bundle_radiance(pinhole)[0]
    across = pinhole.rays()[1][0]
    truth = RADIANCE * closed(2.5 + 3 * across[..., 0], -3 * across[..., 1]) / np.pi
    return seen, truth


@pytest.mark.parametrize("emitter", EMITTERS)
def test_a_floor_is_lit_to_two_percent(tmp_path, emitter):
    seen, truth = floors(tmp_path / "scene.pbrt", emitter, POINTS)
    assert truth.max() > 20 * truth.min()
    assert np.abs(seen / truth[..., None] - 1).max() < 0.02

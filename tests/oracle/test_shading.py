"""Shading and colours against values computed by hand; floors below area lights."""

import numpy as np
import pytest
from plain_scenes import scene, wall

from lfcore.optics.bundles import Bundles
from lfcore.oracle.colour import srgb_decode, srgb_encode, ycbcr
from lfcore.oracle.shading import radiance
from lfcore.oracle.textures import bilinear
from lfcore.readers.pbrt.build import build_pbrt_scene
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light, Material
from lfcore.scene.emitters import POINTS
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

AXIS = np.float32([[0.3, 0.2, 0]]), np.float32([[0, 0, 1]])


def seen(triangles, **changes):
    return radiance(scene(triangles, **changes), *AXIS)[0]


def lamp(vector=(0.3, 0.2, 0.0), colour=(1.0, 1.0, 1.0), kind=POINT, **options):
    return Light(kind, vector, colour, **options)


def test_ambient_emission_and_background():
    assert seen(wall(2)) == pytest.approx([0.05, 0.1, 0.15])
    glow = [Material("glow", diffuse=(0.5, 0.5, 0.5), emission=(0.2, 0.9, 2.0))]
    assert seen(wall(2), materials=glow) == pytest.approx([0.25, 1, 1])
    assert seen(wall(-2)) == pytest.approx([0.7, 0.8, 0.9])
    assert seen(np.zeros((0, 3, 3))) == pytest.approx([0.7, 0.8, 0.9])


@pytest.mark.parametrize("reference, expected", [(0.0, 0.25), (2.0, 0.25), (1.0, 0.0625)])
def test_a_point_light_falls_off_from_its_reference_distance(reference, expected):
    light = lamp(colour=(0.5, 0.5, 0.5), reference_distance_m=reference)
    assert seen(wall(2), lights=[light], ambient=(0, 0, 0)) == pytest.approx([expected] * 3)


def test_lights_by_hand():
    light = lamp((np.sqrt(0.75), 0, -0.5), (1.0, 0.5, 0.25), DIRECTIONAL)
    found = seen(wall(2), lights=[light], ambient=(0, 0, 0))
    assert found == pytest.approx([0.25, 0.125, 0.0625])
    shiny = [Material("shiny", diffuse=(0.5,) * 3, specular=(1, 1, 1), shininess=0.0)]
    behind = lamp((0.3, 0.2, 5.0), casts_shadows=False)
    assert seen(wall(2), lights=[behind], materials=shiny) == pytest.approx([0.05, 0.1, 0.15])
    shiny = [Material("shiny", diffuse=(0, 0, 0), specular=(0.2, 0.4, 0.6), shininess=6.0)]
    head_on = seen(wall(2), lights=[lamp()], materials=shiny)
    assert head_on == pytest.approx([0.2, 0.4, 0.6])
    # Light at 60 degrees, viewer on the axis: half way is 30 degrees, cos^6 = 27 / 64.
    slanted = seen(
        wall(2), lights=[lamp((0, np.sqrt(0.75), -0.5), kind=DIRECTIONAL)], materials=shiny
    )
    assert slanted == pytest.approx(np.array([0.2, 0.4, 0.6]) * 27 / 64)


@pytest.mark.parametrize("side", [1, -1])
def test_shading_normals_are_interpolated_and_turned_to_the_viewer(side):
    normals = np.tile(np.float32([0, 0.6, -0.8]) * side, (2, 3, 1))
    found = seen(wall(2), normals=normals, lights=[lamp()], ambient=(0, 0, 0))
    assert found == pytest.approx([0.4] * 3)
    # Half of (0, 0, -1) and (0, 0.8, -0.6), normalised: the cosine is sqrt(0.8).
    triangle = np.float32([[[-1, 0, 2], [1, -9, 2], [1, 9, 2]]])
    normals = np.float32([[[0, 0, -1], [0, 0.8, -0.6], [0, 0.8, -0.6]]]) * side
    world = scene(triangle, normals=normals, lights=[lamp((0, 0, -1), kind=DIRECTIONAL)])
    found = radiance(world, np.float32([[0, 0, 0]]), np.float32([[0, 0, 1]]))
    assert found[0] == pytest.approx(np.array([0.05, 0.1, 0.15]) + 0.5 * np.sqrt(0.8), abs=1e-7)


def test_shadows_are_cast_by_others_up_to_the_light():
    light = [lamp((0.3, 5.2, -3.0))]
    lit = seen(wall(2), lights=light)
    blocker = np.float32([[[-1, 2.7, -9], [1, 2.7, -9], [0, 2.7, 9]]])
    beyond = blocker + np.float32([0, 3, 0])
    ambient = seen(wall(2))
    assert (lit > ambient + 0.1).all()
    assert seen(np.concatenate([wall(2), blocker]), lights=light) == pytest.approx(ambient)
    assert seen(np.concatenate([wall(2), beyond]), lights=light) == pytest.approx(lit)
    open_light = [lamp((0.3, 5.2, -3.0), casts_shadows=False)]
    assert seen(np.concatenate([wall(2), blocker]), lights=open_light) == pytest.approx(lit)
    sun = [lamp((0, np.sqrt(0.5), -np.sqrt(0.5)), kind=DIRECTIONAL)]
    assert seen(np.concatenate([wall(2), beyond]), lights=sun) == pytest.approx(ambient)


def test_a_wall_does_not_shade_itself_at_its_diagonal():
    """Points on the edge of two triangles in one plane: neither may darken the other."""
    rays = np.zeros((50, 3), np.float32)
    directions = np.ones((50, 3), np.float32)
    directions[:, 0] = directions[:, 1] = np.linspace(-1, 1, 50)
    for light in (lamp((0.1, 0.3, -1)), lamp((0.6, 0, -0.8), kind=DIRECTIONAL)):
        lit = radiance(scene(wall(2), lights=[light]), rays, directions)
        assert (lit[:, 0] > 0.05).all()


def test_vertex_colours_multiply_the_diffuse_colour():
    triangle = np.float32([[[0, 0, 2], [1, 0, 2], [0, 1, 2]]])
    colours = np.float32([[[1, 0, 0], [0, 1, 0], [0, 0, 1]]])
    found = seen(triangle, colours=colours, ambient=(1, 1, 1))
    assert found == pytest.approx([0.25, 0.15, 0.1])  # 0.5 * weights (0.5, 0.3, 0.2)


def checker():
    texture = np.zeros((2, 2, 3), np.uint8)
    texture[0, 0], texture[0, 1] = (255, 0, 0), (0, 255, 0)  # top row
    texture[1, 0], texture[1, 1] = (0, 0, 255), (188, 188, 188)
    return texture


def test_texture_rows_run_down_and_v_runs_up():
    centres = np.array([[0.25, 0.75], [0.75, 0.75], [0.25, 0.25], [0.75, 0.25]])
    grey = ((188 / 255 + 0.055) / 1.055) ** 2.4
    expected = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [grey] * 3]
    np.testing.assert_allclose(bilinear(checker(), centres), expected)
    np.testing.assert_allclose(bilinear(checker(), centres + [[3, -2]]), expected)


def test_texture_is_filtered_in_linear_light_and_wraps():
    middle, corner = bilinear(checker(), np.array([[0.5, 0.5], [0.0, 1.0]]))
    grey = ((188 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(middle, [(1 + grey) / 4] * 3)
    np.testing.assert_allclose(corner, middle)
    np.testing.assert_allclose(bilinear(checker(), np.array([[0.5, 0.75]])), [[0.5, 0.5, 0]])


def test_texture_on_a_wall():
    uvs = np.float32([[[0, 1], [1, 1], [1, 0]], [[0, 1], [1, 0], [0, 0]]])
    painted = [Material("painted", diffuse=(1.0, 1.0, 0.5), texture=0)]
    picture = scene(wall(2), uvs=uvs, materials=painted, textures=[checker()], ambient=(1, 1, 1))
    at = np.float32([[-2.5, -2.5, 1], [2.5, -2.5, 1], [-2.5, 2.5, 1]])  # x right, y down
    found = radiance(picture, np.zeros((3, 3), np.float32), at)
    np.testing.assert_allclose(found, [[1, 0, 0], [0, 1, 0], [0, 0, 0.5]], atol=1e-6)


def test_srgb_values():
    assert srgb_decode(0.5) == pytest.approx(0.2140411, abs=1e-7)
    assert srgb_encode(0.18) == pytest.approx(0.4613561, abs=1e-7)
    assert srgb_encode([0, 1]) == pytest.approx([0, 1])
    assert srgb_encode(0.001) == pytest.approx(0.01292)
    # The two branches meet to the accuracy of the standard's rounded constants.
    assert srgb_encode(0.0031308 + 1e-12) == pytest.approx(srgb_encode(0.0031308), abs=1e-6)


@pytest.mark.parametrize(
    "colour, codes",
    [
        ((0, 0, 0), (16, 128, 128)),
        ((1, 1, 1), (235, 128, 128)),
        ((1, 0, 0), (62.5594, 102.33585, 240)),
        ((0, 0, 1), (31.8118, 240, 117.73025)),
        ((0, 1, 0), (172.6288, 41.66415, 26.26975)),
    ],
)
def test_bt709_codes(colour, codes):
    assert ycbcr(colour) == pytest.approx(codes, abs=1e-4)
    assert ycbcr(colour, bits=10) == pytest.approx(4 * np.array(codes), abs=4e-4)


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
FLOOR = """
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
    path.write_text(FLOOR.format(floor=floor, emitter=shape), encoding="ascii")
    scene = build_pbrt_scene(path, light_points=points)
    step = WIDTH / PIXELS
    middle, steps = np.zeros((1, 4), np.float32), np.array([0, 0, step, step], np.float32)
    pinhole = Bundles(middle, steps, PIXELS, PIXELS, pixel_pitch=step)
    seen = Tracer(scene, build_bvh(scene.triangles)).bundle_radiance(pinhole)[0]
    across = pinhole.rays()[1][0]
    truth = RADIANCE * closed(2.5 + 3 * across[..., 0], -3 * across[..., 1]) / np.pi
    return seen, truth


@pytest.mark.kernels
@pytest.mark.parametrize("emitter", EMITTERS)
def test_a_floor_is_lit_to_two_percent(tmp_path, emitter):
    seen, truth = floors(tmp_path / "scene.pbrt", emitter, POINTS)
    assert truth.max() > 20 * truth.min()
    assert np.abs(seen / truth[..., None] - 1).max() < 0.02

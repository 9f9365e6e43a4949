"""Pictures of floors below area lights of pbrt scenes, against closed forms: nothing of an emitter
is lost in its own shadow."""

import numpy as np
import pytest

from lfcore.optics.bundles import Bundles
from lfcore.oracle.area_lights import disk, sphere, square
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.kernels

FLOOR = 'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [{}]'
GROUND = FLOOR.format("-9 0 -9  -9 0 9  9 0 9  9 0 -9")
# Straight down on the floor beside the emitter, from 0.85 m on.
SCENE = """
LookAt 2.5 3 0  2.5 0 0  0 0 1
Camera "perspective"
WorldBegin
Material "matte" "rgb Kd" [1 1 1]
{ground}
AttributeBegin
Material "matte" "rgb Kd" [0 0 0]
AreaLightSource "diffuse" "rgb L" [10 10 10]
{emitter}
AttributeEnd
WorldEnd
"""
SPHERE = 'Translate 0 1 0 Shape "sphere" "float radius" 0.5'
DISK = 'Translate 0 1 0 Rotate 90 1 0 0 Shape "disk" "float radius" 0.5'
SQUARE = FLOOR.format("-.5 1 -.5  .5 1 -.5  .5 1 .5  -.5 1 .5")


@pytest.mark.parametrize("emitter, closed", [(SPHERE, sphere), (DISK, disk), (SQUARE, square)])
def test_a_floor_is_lit_to_two_percent(tmp_path, emitter, closed):
    path = tmp_path / "scene.pbrt"
    path.write_text(SCENE.format(ground=GROUND, emitter=emitter))
    scene = build_pbrt_scene(path)
    step = 1.1 / 48
    pinhole = Bundles(
        np.zeros((1, 4), np.float32), np.float32([0, 0, step, step]), 48, 48, pixel_pitch=step
    )
    seen = Tracer(scene, build_bvh(scene.triangles)).bundle_radiance(pinhole)[0]
    direction = pinhole.rays()[1][0]
    truth = 10 * closed(2.5 + 3 * direction[..., 0], -3 * direction[..., 1]) / np.pi
    assert truth.max() > 20 * truth.min()
    assert np.abs(seen / truth[..., None] - 1).max() < 0.02

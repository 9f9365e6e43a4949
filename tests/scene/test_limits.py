"""Numbers that float32 cannot hold or square are refused by name, wherever a scene has them."""

import dataclasses

import numpy as np
import pytest

from lfcore.errors import SceneError
from lfcore.scene.appearance import Light
from lfcore.scene.build import build_scene
from lfcore.scene.needs import Needs
from lfcore.tracing.surfaces import pack_surfaces

POINT = {"position_m": [0, 2, 0], "colour": [1, 1, 1], "reference_distance_m": 1}
POSE = {"position_m": [0, 0, 6], "look_at_m": [0, 0, 0]}


@pytest.mark.parametrize("changes, key", [
    ({"lights": [POINT, POINT | {"position_m": [0, 1e36, 0]}]}, r"lights\[1\]: metres"),
    ({"lights": [POINT | {"position_m": [1e39, 0, 0]}]}, r"lights\[0\]: metres"),
    ({"lights": [POINT | {"colour": [0, 1e30, 0]}]}, r"lights\[0\]: colour"),
    ({"lights": [POINT | {"reference_distance_m": 1e30}]}, r"lights\[0\]: reference"),
    ({"ambient": [0, 0, 1e39]}, "ambient"),
    ({"background": [1e39, 0, 0]}, "background"),
    ({"camera": {"f_number": 1e-45}}, "lens radius"),
    ({"camera": {"sensor_width_mm": 1e300}}, "sensor width"),
    ({"camera": {"focal_length_mm": 50, "focus_m": 1e300}}, "focus distance"),
])  # fmt: skip
def test_beyond_float32(write_scene, minimal, changes, key):
    path = write_scene(minimal | {"camera": {"pose": POSE}} | changes)
    with pytest.raises(SceneError, match=key) as found:
        build_scene(path)
    assert str(path) in str(found.value) and found.value.remedy


@pytest.mark.parametrize("length", [1e-300, 1e-160, 1.0, 1e160, 1e308])
def test_a_direction_may_have_any_length(write_scene, minimal, length):
    minimal["camera"] = {"pose": POSE}
    minimal["lights"] = [{"towards_light": [length] * 3, "colour": [1, 1, 1]}]
    (light,) = build_scene(write_scene(minimal)).lights
    np.testing.assert_allclose(light.vector, np.array([1, -1, -1]) / np.sqrt(3), atol=1e-12)


def test_the_tracer_refuses_what_was_built_by_hand(write_scene, minimal):
    scene = build_scene(write_scene(minimal))
    far = dataclasses.replace(scene, lights=[Light(0, (1e36, 0.0, 0.0), (1.0, 1.0, 1.0))])
    with pytest.raises(SceneError, match=r"lights\[0\]: metres"):
        pack_surfaces(far, Needs.of(far))

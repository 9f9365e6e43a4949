"""From scene files to camera space: poses, transforms, defaults, lights, what is dropped."""

import numpy as np
import pytest

from lfcore.errors import SceneError
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.build import build_scene
from lfcore.scene.framing import default_focus_distances
from lfcore.scene.transforms import chain, look_at, rotate, scale, translate


def test_two_line_scene_is_framed_and_lit(write_scene, minimal):
    scene = build_scene(write_scene(minimal))
    camera = scene.camera
    points = scene.triangles.reshape(-1, 3)
    assert scene.triangle_count == 4 and not scene.dropped
    assert np.all(points[:, 2] > 2 * camera.lens_radius_m)
    assert points[:, 2].min() < camera.focus_m < points[:, 2].max()
    # Lit from the viewer's side, not from behind the object; one casts shadows, one fills them.
    key, fill = scene.lights
    assert key.casts_shadows and not fill.casts_shadows
    assert key.vector[2] < 0 and fill.vector[2] < 0
    assert key.vector[0] * fill.vector[0] < 0 and max(fill.colour) < min(key.colour) / 3
    assert scene.name == write_scene(minimal).parent.name


@pytest.mark.parametrize("seed", range(4))
def test_the_picture_lies_in_the_middle(write_scene, tmp_path, seed):
    corners = np.random.default_rng(seed).normal(size=(9, 3)) * (1, 3, 2) + (5, 0, -2)
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + ["f 1 2 3", "f 4 5 6", "f 7 8 9"]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    scene = build_scene(tmp_path / "a.obj")
    seen = scene.triangles.reshape(-1, 3)
    seen = seen[:, :2] / seen[:, 2:] / (scene.camera.field_width / 2)
    low, high = seen.min(0), seen.max(0)
    np.testing.assert_allclose(high, -low, atol=1e-5)
    assert high.max() == pytest.approx(0.9, abs=1e-5)


def test_an_axis_that_is_up(tetrahedron, write_scene, minimal):
    turned = minimal["objects"][0] | {"transform": [{"rotate": {"axis": "x", "angle_deg": -90}}]}
    expected = build_scene(write_scene({"objects": [turned]}))
    np.testing.assert_array_equal(build_scene(tetrahedron, up="z").triangles, expected.triangles)
    for path, up in ((tetrahedron, "x"), (write_scene(minimal), "z")):
        with pytest.raises(SceneError, match="up: "):
            build_scene(path, up=up)


def test_mesh_path_and_folder_are_scenes_too(write_scene, minimal, tetrahedron):
    expected = build_scene(write_scene(minimal)).triangles
    for path in (tetrahedron, tetrahedron.parent):
        np.testing.assert_array_equal(build_scene(path).triangles, expected)
    assert build_scene(tetrahedron).name == "tetrahedron"


def test_pose_matrix_equals_look_at(write_scene, minimal):
    position, target = [1.0, 2.0, 3.0], [0.2, 0.1, -0.4]
    rotation = look_at(position, target)[:3, :3]
    to_world = np.eye(4)
    to_world[:3, :3] = rotation.T @ np.diag([1, -1, -1])
    to_world[:3, 3] = position
    minimal["camera"] = {"pose": {"position_m": position, "look_at_m": target}}
    expected = build_scene(write_scene(minimal)).triangles
    minimal["camera"] = {"pose": {"matrix": to_world.tolist()}}
    found = build_scene(write_scene(minimal)).triangles
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_transform_steps_apply_in_order(write_scene, minimal):
    steps = [
        {"scale": [1, 2, 3]},
        {"rotate": {"axis": "y", "angle_deg": 90}},
        {"translate_m": [0, 0, -5]},
    ]
    minimal["objects"][0]["transform"] = steps
    minimal["camera"] = {"pose": {"position_m": [0, 0, 0], "look_at_m": [0, 0, -1]}}
    scene = build_scene(write_scene(minimal))
    matrix = chain(scale(1, 2, 3), rotate("y", 90), translate(0, 0, -5))
    corners = np.array([[0, 0, 0, 1], [1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1]]) @ matrix.T
    expected = corners[:, :3] * (1, -1, -1)
    found = np.unique(np.round(scene.triangles.reshape(-1, 3), 5), axis=0)
    np.testing.assert_allclose(found, np.unique(np.round(expected, 5), axis=0), atol=1e-5)


def test_rounding_happens_once_in_camera_space(write_scene, tmp_path):
    """Detail far from the world origin survives: float64 until the camera is subtracted."""
    corners = "v 1000000.001 0 0\nv 1000000.002 0 0\nv 1000000.001 0.001 0.5\n"
    (tmp_path / "far.obj").write_text(f"{corners}f 1 2 3\n")
    camera = {"pose": {"position_m": [1e6, 0, 1], "look_at_m": [1e6, 0, 0]}}
    scene = build_scene(write_scene({"camera": camera, "objects": [{"file": "far.obj"}]}))
    # x stays, y turns over, z becomes the distance from the lens.
    expected = [[0.001, 0, 1], [0.002, 0, 1], [0.001, -0.001, 0.5]]
    np.testing.assert_allclose(scene.triangles[0], expected, atol=1e-8)


def test_bad_triangles_are_dropped_and_counted(write_scene, tmp_path):
    (tmp_path / "dirty.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv inf 0 0\nv 1e20 0 0\nv 2 0 0\n"
        "f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 3 6\nf 1 2 7\nf 1 1 2\n"
    )
    scene = build_scene(write_scene({"objects": [{"file": "dirty.obj"}]}))
    assert scene.dropped == {"not finite": 2, "out of range": 1, "zero area": 2}
    assert np.isfinite(scene.triangles).all() and np.isfinite(scene.normals).all()


def test_lights_follow_the_camera(write_scene, minimal):
    minimal["camera"] = {"pose": {"position_m": [0, 0, 5], "look_at_m": [0, 0, 0]}}
    minimal["lights"] = [
        {"position_m": [1, 2, 3], "colour": [1, 0.5, 0.25], "reference_distance_m": 2},
        {"towards_light": [0, 4, 0], "colour": "#ffffff", "casts_shadows": False},
    ]
    point, sun = build_scene(write_scene(minimal)).lights
    assert point.kind == POINT and point.vector == pytest.approx((1, -2, 2))
    assert point.casts_shadows and point.reference_distance_m == 2
    assert sun.kind == DIRECTIONAL and sun.vector == pytest.approx((0, -1, 0))
    assert sun.colour == pytest.approx((1, 1, 1)) and not sun.casts_shadows
    minimal["lights"] = []
    assert build_scene(write_scene(minimal)).lights == [], "none is not the default"


def test_material_overrides(write_scene, minimal):
    minimal["objects"][0]["material"] = {"diffuse": "#ff0000", "specular": [0.5, 0.5, 0.5]}
    minimal["objects"].append({**minimal["objects"][0], "material": {"emission": [0, 1, 0]}})
    scene = build_scene(write_scene(minimal))
    first, second = scene.materials
    assert first.diffuse == (1, 0, 0) and first.specular == (0.5, 0.5, 0.5)
    assert second.emission == (0, 1, 0)
    assert scene.material_ids.tolist() == [0] * 4 + [1] * 4


def test_default_focus_distances_span_what_is_seen(write_scene, minimal):
    scene = build_scene(write_scene(minimal))
    distances = np.array(scene.focus_distances_m)
    depth = scene.triangles[..., 2]
    assert len(distances) == 5 and np.all(np.diff(distances) > 0)
    assert depth.min() <= distances[0] and distances[-1] <= depth.max() * (1 + 1e-6)
    steps = np.diff(1 / distances)
    np.testing.assert_allclose(steps, steps[0])
    behind = scene.triangles * (1, 1, -1)
    assert default_focus_distances(scene.camera, behind) == (scene.camera.focus_m,)

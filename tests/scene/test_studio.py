"""A mesh without lights: its sky and its floor, and what they leave as it is."""

import numpy as np
import pytest
import trimesh

import lfcore
from lfcore.scene import studio
from lfcore.scene.build import build_scene
from lfcore.scene.files import load_scene as load_prepared
from lfcore.scene.files import save_scene, scene_digest


@pytest.fixture
def mesh(tmp_path):
    """A ball on a foot, of some size, written with y or z up."""

    def write(size=1.0, up="y", name="ball.ply"):
        ball = trimesh.creation.icosphere(3, 0.4).apply_translation((0.3, 0.6, 0.2))
        foot = trimesh.creation.box((0.5, 0.3, 0.5)).apply_translation((0.2, 0.15, 0))
        whole = trimesh.util.concatenate([ball, foot]).apply_scale(size)
        if up == "z":
            turn = trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])
            whole.apply_transform(turn)
        whole.export(tmp_path / name)
        return tmp_path / name

    return write


def floor_of(scene):
    return scene.triangles[scene.material_ids == scene.floor_material]


@pytest.mark.parametrize(("size", "up"), [(1e-3, "y"), (1.0, "z"), (1e3, "z")])
def test_camera_and_distances_are_those_of_the_mesh_alone(mesh, size, up):
    path = mesh(size, up)
    scene, bare = (lfcore.load_scene(path, up=up, bare=bare) for bare in (False, True))
    assert scene.camera == bare.camera
    assert scene.depth_range == bare.depth_range
    assert scene.focus_distances_m == bare.focus_distances_m
    assert not len(floor_of(bare)) and bare.bake is None and len(bare.lights) == 2
    below = floor_of(scene)
    assert len(below) + bare.triangle_count == scene.triangle_count
    # In the camera's space y is down, and the fitted camera looks down on the floor.
    lowest = (scene.triangles[scene.material_ids != scene.floor_material] @ [0, 1, -0.3]).max()
    assert (below @ [0, 1, -0.3]).max() > lowest
    height = np.ptp(bare.triangles.reshape(-1, 3), axis=0).max()
    assert np.ptp(below.reshape(-1, 3), axis=0).max() > 4 * height


def test_no_floor_hides_a_mesh_that_is_seen_from_below(mesh):
    scene = lfcore.load_scene(mesh(), view_from="0,-20")
    assert scene.floor_material == -1 and scene.bake is not None


def test_what_has_a_light_or_walls_around_the_camera_is_left_alone(tmp_path):
    room = trimesh.Scene(trimesh.creation.box((4, 3, 4)))
    room.camera = trimesh.scene.Camera("camera", resolution=(64, 64), fov=(60, 60))
    room.camera_transform = np.eye(4)
    room.export(tmp_path / "room.glb")
    scene = lfcore.load_scene(tmp_path / "room.glb")
    assert scene.bake is None and len(scene.lights) == 2 and scene.floor_material == -1
    sky = {"sky": {"colour": [1, 1, 1]}}
    scene = lfcore.load_scene(tmp_path / "room.glb", view_from="front", light=sky)
    assert scene.lights == [] and scene.floor_material == -1


def test_the_floor_is_kept_on_disk_and_the_workflow_has_none(mesh, tmp_path):
    path = mesh()
    scene = lfcore.load_scene(path)
    save_scene(tmp_path / "scene.npz", scene)
    again = load_prepared(tmp_path / "scene.npz")
    assert again.depth_range == scene.depth_range and again.bake == scene.bake
    assert build_scene(path).bake is None


@pytest.mark.kernels
def test_no_edge_parts_floor_and_sky_and_the_mesh_has_a_shadow(mesh, tmp_path):
    scene = lfcore.load_scene(mesh(), view_from="front", zoom=0.3)
    picture = lfcore.render(scene, pixels=48, views=2)
    np.testing.assert_allclose(picture[-1, 0], studio.HORIZON, rtol=0.05)
    column = picture[:, 2]  # beside the mesh, from above the horizon to the floor before the camera
    assert abs(np.diff(column[20:], axis=0)).max() < 0.02
    assert picture[24:].min() < 0.5 * studio.HORIZON[0]


@pytest.mark.kernels
def test_ends_of_a_recorded_mesh_are_its_own(mesh, tmp_path):
    scene = lfcore.load_scene(mesh())
    field = lfcore.record(scene, tmp_path / "a.mkv", pixels=32)
    assert field.metadata.scene["digest"] == scene_digest(scene)
    for word in ("near", "far"):
        assert field.plane(word).focus_m == pytest.approx(scene.plane(word).focus_m, rel=0.05)

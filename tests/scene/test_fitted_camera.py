"""The camera of a scene that gives none, or only a part of one, and focus and blur in words."""

import math

import numpy as np
import pytest
import trimesh
import yaml
from plain_scenes import balls, refused

import lfcore
from lfcore import Camera, Slab
from lfcore.readers.load import load_scene
from lfcore.rendering.depth import depth_of_views
from lfcore.rendering.prepared import open_tracer
from lfcore.scene import studio
from lfcore.scene.files import scene_digest
from lfcore.scene.framing import BLUR
from lfcore.scene.seen import SIDE, _depths, focus_at


@pytest.fixture
def ball(tmp_path):
    balls().export(tmp_path / "balls.ply")
    return tmp_path / "balls.ply"


def blurs(scene, focus_m=None, f_number=None):
    """Diameters of the blur at the near and the far end, shares of the picture's width."""
    camera = scene.camera
    diameter = camera.focal_length_m / (f_number or camera.f_number)
    off = 1 / np.array(scene.depth_range) - 1 / (focus_m or camera.focus_m)
    return diameter * np.abs(off) / camera.field_width


def test_depths_seen_are_those_of_traced_rays(ball):
    scene = load_scene(ball, bare=True)
    width = scene.camera.field_width
    ticks = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * width
    found = _depths(scene.triangles, (ticks, ticks))
    traced = depth_of_views(open_tracer(scene), Slab(scene.camera, 1, SIDE))[0]
    assert np.isfinite(traced).sum() > 500
    same = np.isclose(found, traced, rtol=1e-4) | (np.isinf(found) & np.isinf(traced))
    assert same.mean() > 0.999


def test_depths_of_triangles_that_cross_the_lens_plane():
    floor = np.array([[[-9, 1, -9], [9, 1, -9], [0, 1, 30]]], float)
    assert focus_at(floor, 1.0, (0.5, 0.75)) == pytest.approx(4)
    refused("no surface is seen", focus_at, floor, 1.0, (0.5, 0.25))


def test_a_mesh_is_blurred_visibly_at_both_ends_also_when_zoomed(ball):
    scene = load_scene(ball, bare=True)
    np.testing.assert_allclose(blurs(scene), BLUR, rtol=0.05)
    assert scene.camera.f_number == pytest.approx(2)
    near, far = scene.depth_range
    assert near < scene.camera.focus_m < far
    assert scene.camera.focal_length_m < near / 2
    twice = load_scene(ball, zoom=2, bare=True)
    np.testing.assert_array_equal(scene.triangles, twice.triangles)
    assert twice.camera.field_width == pytest.approx(scene.camera.field_width / 2)
    np.testing.assert_allclose(blurs(twice), BLUR, rtol=0.05)


@pytest.mark.parametrize(
    "given",
    [
        {"pose": {"position_m": [0, 1, 9], "look_at_m": [0, 0, 0]}},
        {"focal_length_mm": 50, "sensor_width_mm": 36},
        {"focus_m": "near"},
        {"focus_m": 500},
        {"focus_m": "infinity"},
    ],
    ids=lambda given: next(iter(given)),
)
def test_the_lens_stays_what_it_is_when_a_part_is_given(write_scene, ball, given):
    """Focused in the middle, the far end has the same blur: not an f/2 of a lens made of air."""
    scene = load_scene(write_scene({"objects": [{"file": ball.name}], "camera": given}), bare=True)
    np.testing.assert_allclose(blurs(scene, scene.depth_range.middle_m), BLUR, rtol=0.1)


def test_a_flat_scene_has_a_lens(tmp_path):
    path = tmp_path / "card.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n")
    scene = load_scene(path, view_from="front", bare=True)
    assert scene.camera.lens_radius_m < scene.camera.focus_m / 8


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_a_scaled_model_gives_the_same_picture(tmp_path, ball, scale):
    mesh = trimesh.load(ball)
    for name, factor in (("unit", 1.0), ("scaled", scale)):
        moved = mesh.copy().apply_scale(factor)
        lines = [f"v {x:.17g} {y:.17g} {z:.17g}" for x, y, z in moved.vertices]
        lines += [f"f {a} {b} {c}" for a, b, c in moved.faces + 1]
        (tmp_path / f"{name}.obj").write_text("\n".join(lines))
    unit, scaled = (lfcore.load_scene(tmp_path / f"{name}.obj") for name in ("unit", "scaled"))
    assert scaled.depth_range == pytest.approx(tuple(scale * z for z in unit.depth_range))
    for settings in ({}, {"focus_m": "near"}, {"focus_at": (0.5, 0.5), "blur": "5%"}):
        first, second = (lfcore.render(scene, pixels=64, **settings) for scene in (unit, scaled))
        # Corners are rounded to float32 otherwise: single rays at silhouettes may differ.
        assert np.abs(first - second).max() < 0.02
        assert np.abs(first - second).mean() < 1e-3  # of baked light, other samples


@pytest.mark.parametrize(
    ("focus", "share"),
    [("near", 0), ("middle", 0.5), ("40%", 0.4), ("far", 1), ("inf", None), ("2.5", None)],
)
@pytest.mark.parametrize("blur", [0.03, "3%"])
def test_words_for_a_focus_and_blur_of_the_end_farther_from_it(ball, focus, share, blur):
    scene = load_scene(ball, bare=True)
    near, far = scene.depth_range
    plane = scene.plane(focus, blur=blur)
    wanted = float(focus) if share is None else 1 / ((1 - share) / near + share / far)
    assert plane.focus_m == pytest.approx(wanted)
    found = blurs(scene, plane.focus_m, plane.f_number)
    assert found.max() == pytest.approx(0.03)
    if share in (0, 0.4):
        assert found.argmax() == 1


@pytest.mark.parametrize(
    ("settings", "key"),
    [
        ({"focus_m": "nearest"}, "focus_m"),
        ({"focus_m": "-3%"}, "focus_m"),
        ({"focus_m": "nan%"}, "focus_m"),
        ({"focus_m": 3, "focus_at": (0.5, 0.5)}, "focus_at"),
        ({"focus_at": (0.5,)}, "focus_at"),
        ({"focus_at": (0.5, 1.5)}, "focus_at"),
        ({"focus_at": (0.01, 0.01)}, "focus_at"),
        ({"blur": 0.02, "f_number": 2}, "blur"),
        ({"blur": "0%"}, "blur"),
        ({"blur": "3 percent"}, "blur"),
        ({"blur": math.nan}, "blur"),
    ],
)
def test_settings_that_make_no_picture(ball, settings, key):
    caught = refused(None, load_scene(ball, bare=True).plane, **settings)
    assert caught.key == key and caught.remedy


SIDES = {
    "front": (0, 0, 1), "back": (0, 0, -1), "left": (-1, 0, 0), "right": (1, 0, 0),
    "top": (0, 1, 0), "45,0": (1, 0, 1), "0,30": (0, 0.5, math.sqrt(0.75)), "0,-90": (0, -1, 0),
}  # fmt: skip


@pytest.mark.parametrize("side", SIDES)
def test_a_side_to_see_from(tmp_path, side):
    """The corner of an octahedron that points towards the camera is nearest, in the middle."""
    towards = np.array(SIDES[side]) / np.linalg.norm(SIDES[side])
    mesh = trimesh.creation.icosphere(2)
    tip = trimesh.creation.icosphere(1, radius=0.01).apply_translation(1.2 * towards)
    path = tmp_path / "ball.ply"
    trimesh.util.concatenate([mesh, tip]).export(path)
    scene = load_scene(path, view_from=side, bare=True)
    nearest = scene.triangles.reshape(-1, 3)[scene.triangles[..., 2].argmin()]
    assert np.abs(nearest[:2] / nearest[2]).max() < 0.01


def test_up_is_up_from_every_side(tmp_path):
    lines = ["v 0 0 0", "v 0.1 0 0", "v 0 1 0", "v 0 0 0.1", "f 1 2 3", "f 1 4 3", "f 2 4 3"]
    (tmp_path / "spike.obj").write_text("\n".join(lines))
    for side in ("front", "back", "left", "right", "30,40", "120,-20"):
        points = load_scene(tmp_path / "spike.obj", view_from=side, bare=True).triangles.reshape(
            -1, 3
        )
        tip = points[np.argmin(points[:, 1] / points[:, 2])]
        assert tip[1] < 0 and np.sum(points[:, 1] < 0) == 3


@pytest.mark.parametrize("camera", [{"view_from": "left"}, {"zoom": 0.0}, {"zoom": math.inf}])
def test_a_view_that_cannot_be(write_scene, ball, camera):
    pose = {"position_m": [0, 1, 9], "look_at_m": [0, 0, 0]}
    path = write_scene({"objects": [{"file": ball.name}], "camera": {"pose": pose}})
    caught = refused(None, load_scene, path, **camera)
    assert caught.key == next(iter(camera)) and caught.remedy


def test_where_z_is_up_a_note_says_so(tmp_path, tetrahedron, ball):
    cone = trimesh.creation.cone(0.5, 2.0)  # stands on z = 0
    cone.export(tmp_path / "cone.stl")
    x, y = np.meshgrid(np.linspace(0, 4, 9), np.linspace(0, 3, 9))
    heights = 0.2 * np.sin(3 * x) * np.cos(2 * y)
    lines = [f"v {a} {b} {c}" for a, b, c in zip(x.flat, y.flat, heights.flat, strict=True)]
    lines += [f"f {k} {k + 1} {k + 10} {k + 9}" for k in range(1, 73) if k % 9]
    (tmp_path / "terrain.obj").write_text("\n".join(lines))
    standing = trimesh.creation.capsule(2.0, 0.5)  # without a foot
    standing.apply_translation(-standing.bounds[0] * [0, 0, 1]).export(tmp_path / "standing.stl")
    (tmp_path / "word.obj").write_text("# up axis: Z\nv 0 0 0\nv 1 0 0\nv 0 1 1\nf 1 2 3\n")
    for name in ("cone.stl", "standing.stl", "terrain.obj", "word.obj"):
        scene, y, z = (
            load_scene(tmp_path / name, **up, bare=True) for up in ({}, {"up": "y"}, {"up": "z"})
        )
        assert [str(one.notes).count("z seems") for one in (scene, y, z)] == [1, 0, 0]
        assert not np.array_equal(z.triangles, scene.triangles)
    cone.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    cone.export(tmp_path / "cone.stl")
    trimesh.creation.box().export(tmp_path / "box.stl")
    for path in (tmp_path / "cone.stl", tmp_path / "box.stl", tetrahedron, ball):
        assert "z seems" not in str(load_scene(path, bare=True).notes), "y is up"


@pytest.fixture
def mesh(tmp_path):
    """A ball on a foot, of some size, written with y or z up."""

    def write(size=1.0, up="y"):
        ball = trimesh.creation.icosphere(3, 0.4).apply_translation((0.3, 0.6, 0.2))
        foot = trimesh.creation.box((0.5, 0.3, 0.5)).apply_translation((0.2, 0.15, 0))
        whole = trimesh.util.concatenate([ball, foot]).apply_scale(size)
        if up == "z":
            whole.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
        whole.export(tmp_path / "ball.ply")
        return tmp_path / "ball.ply"

    return write


@pytest.mark.parametrize("lens", [None, Camera(0.035, 0.024, 4.0, 9.0)])
@pytest.mark.parametrize("sides", [(4.0, 0.5, 0.5), (0.5, 4.0, 0.5), (1.0, 1.0, 1.0)])
@pytest.mark.parametrize("size", [(64, 64), (64, 36), (36, 64), (80, 40)])
def test_a_framed_scene_fills_one_side_of_any_picture(tmp_path, sides, size, lens):
    """As it fills the square, and no less of the other side."""
    trimesh.creation.box(sides).export(tmp_path / "box.ply")
    how = {"view_from": "front", "bare": True, "camera": lens}
    scene, square = (
        lfcore.load_scene(tmp_path / "box.ply", pixels=pixels, **how) for pixels in (size, 1)
    )

    def filled(scene, size):
        places = scene.triangles.reshape(-1, 3)
        field = scene.camera.field_width * np.array(size) / min(size)
        return 2 * np.abs(places[:, :2] / places[:, 2:]).max(0) / field

    now, before = filled(scene, size), filled(square, size)
    assert now.max() == pytest.approx(filled(square, (1, 1)).max(), rel=1e-5)
    assert (now >= before - 1e-6).all()


def floor_of(scene):
    return scene.triangles[scene.material_ids == len(scene.materials)]


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
    lowest = (scene.triangles[scene.material_ids < len(scene.materials)] @ [0, 1, -0.3]).max()
    assert (below @ [0, 1, -0.3]).max() > lowest
    height = np.ptp(bare.triangles.reshape(-1, 3), axis=0).max()
    assert np.ptp(below.reshape(-1, 3), axis=0).max() > 4 * height


def test_no_floor_hides_a_mesh_that_is_seen_from_below_and_the_workflow_has_none(mesh):
    scene = lfcore.load_scene(mesh(), view_from="0,-20")
    assert scene.floor is None and scene.bake is not None
    assert load_scene(mesh(), bare=True).bake is None


def test_what_has_a_light_or_walls_around_the_camera_is_left_alone(tmp_path):
    room = trimesh.Scene(trimesh.creation.box((4, 3, 4)))
    room.camera = trimesh.scene.Camera("camera", resolution=(64, 64), fov=(60, 60))
    room.camera_transform = np.eye(4)
    room.export(tmp_path / "room.glb")
    scene = lfcore.load_scene(tmp_path / "room.glb")
    assert scene.bake is None and len(scene.lights) == 2 and scene.floor is None
    sky = {"sky": {"colour": [1, 1, 1]}}
    scene = lfcore.load_scene(tmp_path / "room.glb", view_from="front", light=sky)
    assert scene.lights == [] and scene.floor is None


def test_a_scene_asks_for_studio_and_floor(mesh, tmp_path):
    """With a camera and two meshes; a floor that is asked for is a thing like others."""
    ball = {"file": mesh().name}
    two = {"objects": [ball, {**ball, "transform": [{"translate_m": [3, 0, 0]}]}],
           "camera": {"view_from": "20,30"}}  # fmt: skip
    path = tmp_path / "scene.yaml"

    def loaded(floor=None, **keys):
        path.write_text(yaml.safe_dump({**two, **keys}))
        return lfcore.load_scene(path, floor=floor)

    plain, studio, asked = loaded(), loaded(studio=True), loaded(floor=True)
    assert plain.bake is None and len(plain.lights) == 2 and not len(floor_of(plain))
    assert len(floor_of(studio)) > 100 and studio.bake and len(studio.sky) and studio.floor
    assert studio.materials == plain.materials and studio.depth_range == plain.depth_range
    assert len(asked.materials) == len(plain.materials) + 1 and asked.floor is None
    assert asked.depth_range.far_m > plain.depth_range.far_m and asked.lights == plain.lights
    assert asked.camera == studio.camera == plain.camera
    assert not len(floor_of(loaded(studio=True, floor=False)))
    assert loaded(floor=True).triangle_count == loaded(True).triangle_count > 1 + len(two)
    sky = {"sky": {"colour": [1, 1, 1]}}
    under_sky = lfcore.load_scene(mesh(), light=sky, floor=True)
    assert under_sky.materials[-1].name == "floor under a mesh" and under_sky.lights == []
    refused("sky: excludes studio", loaded, studio=True, **sky)
    refused("lights: excludes studio", loaded, studio=True, lights=[])
    refused("floor: ", lfcore.load_scene, path, floor=3)
    refused("floor: belongs to a mesh", lfcore.load_scene, tmp_path / "a.pbrt", floor=True)


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


PLAIN = lfcore.Encoding(depth=False)
PBRT = """
Camera "perspective" "float fov" [40]
Film "image" "integer xresolution" [64] "integer yresolution" [64]
WorldBegin
LightSource "distant" "point from" [0 1 -1] "point to" [0 0 0] "rgb L" [9 9 9]
Shape "trianglemesh" "integer indices" [0 1 2] "point P" [-3 -2 9  1 -2 9  -1 3 9]
Shape "trianglemesh" "integer indices" [0 1 2] "point P" [-1 -1 4  2 -1 4  1 1 4]
WorldEnd
"""


@pytest.fixture(scope="module")
def scene():
    return lfcore.Scene.from_triangles(balls().triangles)


@pytest.fixture(scope="module", params=[64, (96, 64)])
def field(request, scene, tmp_path_factory):
    return lfcore.record(scene, tmp_path_factory.mktemp("words") / "a.mkv", pixels=request.param)


@pytest.fixture(scope="module")
def pinhole(tmp_path_factory):
    path = tmp_path_factory.mktemp("pinhole") / "hole.pbrt"
    path.write_text(PBRT)
    return lfcore.load_scene(path)


def test_words_are_taken_as_their_metres(scene, tmp_path):
    near, far = scene.depth_range
    for words, metres in (
        ({"focus_m": "near"}, near), ({"focus_m": "100%"}, far),
        ({"focus_at": (0.5, 0.5)}, scene.plane(focus_at=(0.5, 0.5)).focus_m),
    ):  # fmt: skip
        asked = lfcore.render(scene, pixels=32, **words)
        np.testing.assert_array_equal(asked, lfcore.render(scene, metres, pixels=32))
    plane = scene.plane("near", blur="8%")
    blurred = lfcore.render(scene, "near", blur=0.08, pixels=32)
    np.testing.assert_array_equal(blurred, lfcore.render(scene, near, plane.f_number, pixels=32))
    assert plane.f_number < scene.camera.f_number
    field = lfcore.record(scene, tmp_path / "a.mkv", pixels=16, focus_m="near", blur="8%")
    camera = field.require_slab().camera
    assert (camera.focus_m, camera.f_number) == (near, plane.f_number)


def test_planes_exclude_all_other_settings(scene):
    for other in ({"focus_m": "near"}, {"f_number": 2}, {"focus_at": (0, 0)}, {"blur": 0.1}):
        refused("planes: excludes", lfcore.render, scene, planes=[scene.plane()], **other)


def test_a_file_states_the_scenes_ends_and_an_older_one_is_decoded_for_them(scene, field):
    older = lfcore.LightField.open(field.path)
    del older.content["ends_m"]
    for word in ("near", "middle", "far", "25%"):
        wanted = scene.plane(word).focus_m
        assert field.plane(word).focus_m == wanted
        assert older.plane(word).focus_m == pytest.approx(wanted, rel=0.05)
    unread = lfcore.LightField.open(field.path)
    assert unread.plane("inf").focus_m == math.inf and unread.plane(2).focus_m == 2.0
    assert unread.plane("near", blur="1%") and not unread.require_depth_video().decoded_frames
    pictures = [field.refocus(word) for word in ("near", "far")]
    assert np.abs(pictures[0] - pictures[1]).max() > 0.05


def test_a_place_and_a_blur_in_a_file_with_depth(scene, field):
    for place in ((0.5, 0.6), (0.3, 0.5)):
        found = field.plane(focus_at=place).focus_m
        asked = scene.plane(focus_at=place, pixels=field.picture_size)
        assert found == pytest.approx(asked.focus_m, rel=0.02)
    refused(r"a\.mkv: focus_at: no surface", field.plane, focus_at=(0, 0))
    assert field.plane("near", blur="1%").f_number > field.require_slab().camera.f_number
    refused("blur: needs a lens of", field.plane, "near", blur="50%")


def test_words_in_a_file_of_plain_views(scene, tmp_path):
    field = lfcore.record(scene, tmp_path / "a.mkv", views=4, pixels=32, encoding=PLAIN)
    near, far = scene.depth_range
    assert field.plane("near").focus_m == near and field.plane("far").focus_m == far
    refused("depth", field.plane, focus_at=(0.5, 0.5))
    field = lfcore.LightField.open(field.path)
    del field.content["ends_m"]
    assert field.plane("near").focus_m == field.depth_range[0]
    field = lfcore.LightField.open(field.path)
    del field.content["ends_m"], field.content["depth_m"]
    refused(r"focus_m: .*Give metres", field.plane, "near")


def test_what_a_file_cannot_tell_is_said(field, scene, tmp_path):
    near, far = field.depth_range
    assert field.doubts(field.plane("middle", 22)) == []
    for focus_m in (near / 2, 2 * far):
        (line,) = field.doubts(field.plane(focus_m))
        assert line.startswith("nothing is in focus")
    plain = lfcore.record(scene, tmp_path / "a.mkv", views=8, pixels=16, encoding=PLAIN)
    widest = scene.camera.f_number
    assert plain.doubts(plain.plane("middle")) == []
    (line,) = plain.doubts(plain.plane("middle", 5 * widest))
    assert "give the same picture: 4 of 64 views" in line
    first, last = (plain.plane("middle", 5 * widest * by) for by in (0.95, 1.05))
    np.testing.assert_array_equal(*plain.refocus_many([first, last]))


def test_a_pinhole_is_recorded_through_a_lens(pinhole, tmp_path):
    assert pinhole.is_pinhole and not pinhole.with_lens().is_pinhole
    field = lfcore.record(pinhole, tmp_path / "a.mkv", pixels=64)
    assert "pinhole" in field.content["lens"]
    camera = field.require_slab().camera
    assert 4 < camera.focus_m < 9
    near, far = (field.refocus(word) for word in ("near", "far"))
    assert np.abs(near - far).max() > 0.1
    plain = lfcore.record(pinhole, tmp_path / "b.mkv", views=2, pixels=16)
    assert "pinhole" in plain.content["lens"] and plain.depth_range
    asked = lfcore.record(pinhole, tmp_path / "c.mkv", views=2, pixels=16, f_number=4, focus_m=5)
    assert "lens" not in asked.content and asked.require_slab().camera.f_number == 4
    blurred = pinhole.plane(blur="3%")
    assert blurred.focus_m == pytest.approx(pinhole.depth_range.middle_m)


def test_a_pinhole_renders_sharp_unless_a_focus_is_given(pinhole):
    sharp = lfcore.render(pinhole, pixels=64)
    np.testing.assert_allclose(sharp, lfcore.render(pinhole, math.inf, 2.5e7, pixels=64), atol=1e-6)
    assert np.abs(lfcore.render(pinhole, "near", pixels=64) - sharp).max() > 0.05


def test_a_calibrated_camera_sees_points_where_its_matrix_has_them(tmp_path):
    point, size = np.array([0.3, -0.2, 0.1]), (64, 48)
    trimesh.creation.icosphere(2, radius=0.05).apply_translation(point).export(tmp_path / "a.ply")
    K = np.array([[70.0, 0, 32], [0, 70, 24], [0, 0, 1]])
    turn = trimesh.transformations.euler_matrix(0.2, 2.9, 0.1)  # OpenCV's world to camera
    turn[:3, 3] = 0.1, 0.05, 2.0
    pose = np.linalg.inv(turn) @ np.diag([1, -1, -1, 1])
    x, y, z = K @ (turn @ [*point, 1])[:3]
    camera = lfcore.Camera.from_matrix(K, pose)
    world = trimesh.load(tmp_path / "a.ply").triangles
    glow = lfcore.Surface("glow", emission=(1.0, 1.0, 1.0))
    scene = lfcore.Scene.from_triangles(world, camera=camera, surface=glow)
    loaded = lfcore.load_scene(tmp_path / "a.ply", camera=camera, bare=True)
    np.testing.assert_allclose(loaded.triangles, scene.triangles, atol=1e-6)
    assert loaded.camera == scene.camera and scene.camera.pose is None and scene.is_pinhole
    picture = lfcore.render(scene, pixels=size).mean(2) > 0.5
    rows, columns = np.nonzero(picture)
    assert (columns.mean() + 0.5, rows.mean() + 0.5) == pytest.approx((x / z, y / z), abs=0.3)
    # A lens, with the same field when it is focused nearby.
    lens = lfcore.Camera.from_matrix(K, pixels=size, focus_m=1.5, f_number=2)
    assert lens.field_width == pytest.approx(camera.field_width) == pytest.approx(48 / 70)
    assert lens.pose is None and lens.f_number == 2


@pytest.mark.parametrize(
    ("call", "words"),
    [
        ({"K": np.diag([9, 8, 1])}, "K: .*no square pixels"),
        ({"K": [[9, 0, 4], [0, 9, 4], [0, 0, 1]], "pixels": (16, 8)}, "K: the principal point"),
        ({"K": np.eye(4)}, "K: must be 3 x 3 finite"),
        ({"K": [[9, 0, 4], [0, 9, 4], [0, 0, 1]], "pose": 2 * np.eye(4)}, "pose: is no rigid"),
        ({"K": [[9, 0, 4], [0, 9, 4], [0, 0, 1]], "pose": np.full((4, 4), np.nan)}, "pose: must"),
    ],
)
def test_matrices_of_no_camera(call, words):
    refused(words, lfcore.Camera.from_matrix, **call)


def test_a_mesh_is_seen_from_a_place_and_in_a_unit(ball, write_scene):
    place = {"position_m": np.array([0, 1, 9]), "look_at_m": (0, 0.2, 0)}
    scene = lfcore.load_scene(ball, **place)
    plain = {key: list(map(float, value)) for key, value in place.items()}
    known = load_scene(
        write_scene({"objects": [{"file": ball.name}], "camera": {"pose": plain}}), bare=True
    )
    np.testing.assert_array_equal(scene.triangles[: known.triangle_count], known.triangles)
    turned = lfcore.load_scene(write_scene({"objects": [{"file": ball.name}]}), **place)
    np.testing.assert_array_equal(turned.triangles, known.triangles)
    matrix = np.eye(4)
    matrix[2, 3] = 9
    ahead = lfcore.load_scene(ball, matrix=matrix, bare=True)
    there = lfcore.load_scene(ball, position_m=(0, 0, 9), look_at_m=(0, 0, 0), bare=True)
    np.testing.assert_allclose(ahead.triangles, there.triangles, atol=1e-6)
    small, large = (lfcore.load_scene(ball, bare=True, scale=scale) for scale in (1e-3, 1))
    np.testing.assert_allclose(1e3 * small.triangles, large.triangles, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"position_m": (0, 0, 9)}, "pose: needs exactly one of position_m and look_at_m"),
        ({"position_m": (0, 0, 9), "look_at_m": (0, 0, 9)}, "coincide"),
        ({"matrix": np.eye(3)}, "matrix"),
        ({"matrix": "here"}, "matrix: must be an array of numbers"),
        ({"matrix": np.eye(4), "view_from": "front"}, "view_from: excludes matrix"),
        ({"camera": lfcore.Camera(0.05, 0.03, 2, 9, np.eye(4)), "matrix": np.eye(4)}, "excludes"),
        ({"camera": lfcore.Camera(0.05, 0.03, 2, 9), "zoom": 2}, "zoom: excludes camera"),
        ({"camera": 35}, "camera: must be a Camera"),
        ({"scale": 0}, "scale: must be a number above 0"),
        ({"scale": float("nan")}, "scale: must be a number above 0"),
    ],
)
def test_places_that_are_none(ball, given, words):
    refused(words, lfcore.load_scene, ball, **given)


@pytest.mark.parametrize("key", ["position_m", "matrix", "camera", "scale", "zoom"])
def test_a_scene_with_its_own_camera_takes_no_other(pinhole, tmp_path, key):
    lfcore.scene.files.save_scene(tmp_path / "scene.npz", pinhole)
    (tmp_path / "scene.pbrt").write_text(PBRT)
    given = {"camera": pinhole.camera, "scale": 2, "zoom": 2}.get(key, np.eye(4))
    for name in ("scene.npz", "scene.pbrt"):
        refused(f"{name}: {key}: ", lfcore.load_scene, tmp_path / name, **{key: given})


def test_a_mesh_too_small_for_its_place_names_its_file(tmp_path):
    (tmp_path / "a.obj").write_text("v 1e17 1e17 1e17\n" * 3 + "f 1 2 3\n")
    refused(r"a\.obj: objects: the scene is too small", lfcore.load_scene, tmp_path / "a.obj")

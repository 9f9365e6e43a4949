"""Focus and blur in words, in the calls of the library: scenes, light fields, pinholes."""

import math

import numpy as np
import pytest
import trimesh

import lfcore

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
    far = trimesh.creation.icosphere(3)
    near = trimesh.creation.icosphere(3, radius=0.4).apply_translation((-0.8, 0.3, 2.0))
    return lfcore.Scene.from_triangles(trimesh.util.concatenate([far, near]).triangles)


@pytest.fixture(scope="module", params=[64, (96, 64)])
def field(request, scene, tmp_path_factory):
    return lfcore.record(scene, tmp_path_factory.mktemp("words") / "a.mkv", pixels=request.param)


@pytest.fixture(scope="module")
def pinhole(tmp_path_factory):
    path = tmp_path_factory.mktemp("pinhole") / "hole.pbrt"
    path.write_text(PBRT)
    return lfcore.load_scene(path)


def test_render_takes_words_as_their_metres(scene):
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


def test_planes_exclude_all_other_settings(scene):
    for other in ({"focus_m": "near"}, {"f_number": 2}, {"focus_at": (0, 0)}, {"blur": 0.1}):
        with pytest.raises(lfcore.OpticsError, match="planes: excludes"):
            lfcore.render(scene, planes=[scene.plane()], **other)


def test_a_recorded_focus_may_be_a_word(scene, tmp_path):
    field = lfcore.record(scene, tmp_path / "a.mkv", pixels=16, focus_m="far", blur="5%")
    camera = field.require_slab().camera
    plane = scene.plane("far", blur=0.05)
    assert (camera.focus_m, camera.f_number) == (plane.focus_m, plane.f_number)


def test_a_file_states_the_scenes_ends_and_an_older_one_is_decoded_for_them(scene, field):
    older = lfcore.LightField.open(field.path)
    del older.content["ends_m"]
    for word in ("near", "middle", "far", "25%"):
        wanted = scene.plane(word).focus_m
        assert field.plane(word).focus_m == wanted
        assert older.plane(word).focus_m == pytest.approx(wanted, rel=0.05)
    unread = lfcore.LightField.open(field.path)
    assert unread.plane("inf").focus_m == math.inf and unread.plane(2).focus_m == 2.0
    assert unread.plane("near", blur="1%") and not unread.require_depth_video().count.frames
    pictures = [field.refocus(word) for word in ("near", "far")]
    assert np.abs(pictures[0] - pictures[1]).max() > 0.05


def test_a_place_in_a_file_with_depth(scene, field):
    for place in ((0.5, 0.6), (0.3, 0.5)):
        found = field.plane(focus_at=place).focus_m
        asked = scene.plane(focus_at=place, pixels=field.picture_size)
        assert found == pytest.approx(asked.focus_m, rel=0.02)
    with pytest.raises(lfcore.OpticsError, match=r"a\.mkv: focus_at: there is nothing"):
        field.plane(focus_at=(0, 0))


def test_blur_of_a_file_needs_no_wider_lens(field):
    assert field.plane("near", blur="1%").f_number > field.require_slab().camera.f_number
    with pytest.raises(lfcore.OpticsError, match="wider than the lens"):
        field.plane("near", blur="50%")


def test_words_in_a_file_of_plain_views(scene, tmp_path):
    field = lfcore.record(
        scene, tmp_path / "a.mkv", views=4, pixels=32, encoding=lfcore.Encoding(depth=False)
    )
    near, far = scene.depth_range
    assert field.plane("near").focus_m == near and field.plane("far").focus_m == far
    with pytest.raises(lfcore.OpticsError, match="depth"):
        field.plane(focus_at=(0.5, 0.5))
    field = lfcore.LightField.open(field.path)
    del field.content["ends_m"]
    assert field.plane("near").focus_m == field.depth_range[0]
    field = lfcore.LightField.open(field.path)
    del field.content["ends_m"], field.content["depth_m"]
    with pytest.raises(lfcore.OpticsError, match=r"focus_m: .*Give metres"):
        field.plane("near")


def test_what_a_file_cannot_tell_is_said(field, scene, tmp_path):
    near, far = field.depth_range
    assert field.doubts(field.plane("middle", 22)) == []
    for focus_m in (near / 2, 2 * far):
        (line,) = field.doubts(field.plane(focus_m))
        assert line.startswith("nothing is in focus")
    plain = lfcore.record(
        scene, tmp_path / "a.mkv", views=8, pixels=16, encoding=lfcore.Encoding(depth=False)
    )
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

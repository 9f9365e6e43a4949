"""Animated glTF at an instant, against closed forms."""

import math

import numpy as np
import pytest
from gltf_files import CORNERS, FACES, File
from plain_scenes import refused

from lfcore.datasets.description import Description
from lfcore.datasets.sample import sample
from lfcore.readers.load import load_scene
from lfcore.readers.meshes import read_mesh

KEYS = np.float32([1, 2, 4])


def play(file, *channels, times=KEYS, name=None):
    """Add an animation of channels (node, path, values, interpolation)."""
    keys, entry = file.accessor(times), {"samplers": [], "channels": []}
    for number, (node, path, values, kind) in enumerate(channels):
        output = file.accessor(np.float32(values))
        entry["samplers"].append({"input": keys, "output": output, "interpolation": kind})
        entry["channels"].append({"sampler": number, "target": {"node": node, "path": path}})
    file.add("animations", **entry, **({"name": name} if name else {}))


def corner(content, time, number=1, part=0):
    """A corner of a part's first triangle."""
    return content.animation.at(time).parts[part].triangles[0, number]


def turned(degrees):
    """The quaternion of a turn about z."""
    half = math.radians(degrees) / 2
    return [0, 0, math.sin(half), math.cos(half)]


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("STEP", {0: 0, 1: 0, 1.5: 0, 2: 1, 3.9: 1, 4: 3, 9: 3}),
        ("LINEAR", {0: 0, 1.5: 0.5, 2: 1, 3: 2, 9: 3}),
        # x = t^3 - 1 of glTF's Hermite cubic, exact with its own tangents 3 t^2.
        ("CUBICSPLINE", {0: 0, 1.5: 1.5**3 - 1, 2: 7, 3: 26, 9: 63}),
    ],
)
def test_a_node_moves_along_each_kind_of_curve(tmp_path, kind, expected):
    file = File()
    node = file.node(file.primitive())
    values = np.array([[0, 0, 0], [1, 0, 0], [3, 0, 0]])
    if kind == "CUBICSPLINE":
        t = KEYS[:, None, None] ** [[3], [2]]
        at, slope = (t[:, 0] - 1) * [1, 0, 0], 3 * t[:, 1] * [1, 0, 0]
        values = np.stack([slope, at, slope], 1).reshape(-1, 3)
    play(file, (node, "translation", values, kind))
    content = read_mesh(file.write(tmp_path))
    assert content.animation[:2] == (1, 4)
    np.testing.assert_array_equal(
        content.parts[0].triangles, content.animation.at(1)[0][0].triangles
    )
    for time, x in expected.items():
        np.testing.assert_allclose(corner(content, time), CORNERS[1] + [x, 0, 0], rtol=1e-12)


def test_rotations_take_the_shorter_arc_at_even_speed(tmp_path):
    """Of a child, whose parent grows: 2 x to the side, turned first."""
    file = File()
    child = file.node(file.primitive(), root=False)
    parent = file.node(children=[child])
    away = [-part for part in turned(90)]  # the same turn, on the longer arc
    play(file, (child, "rotation", [turned(0), away, turned(90)], "LINEAR"),
         (parent, "scale", [[1, 1, 1], [2, 1, 1], [2, 1, 1]], "LINEAR"))  # fmt: skip
    content = read_mesh(file.write(tmp_path))
    for time in (1, 1.25, 1.5, 2, 3):
        share = min(time - 1, 1)
        angle = math.radians(90) * share
        expected = [(1 + share) * 2 * math.cos(angle), 2 * math.sin(angle), 0]
        np.testing.assert_allclose(corner(content, time), expected, atol=1e-6)


def test_morph_targets_and_skins(tmp_path):
    """The square's weights go from target to target, and its right side hangs on a joint."""
    file = File()
    joints = [file.node(), file.node(translation=[2, 0, 0])]
    binds = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    binds[1, 3, 0] = -2  # column-major: the joint's place
    side = np.float32([[1, 0, 0, 0], [0, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0]])
    primitive = file.primitive(
        JOINTS_0=np.tile(np.uint8([0, 1, 0, 0]), (4, 1)), WEIGHTS_0=side,
    )  # fmt: skip
    up, deep = CORNERS * 0 + [0, 0.5, 0], CORNERS * 0 + [0, 0, 1]
    primitive["targets"] = [{"POSITION": file.accessor(np.float32(each))} for each in (up, deep)]
    inverse = file.accessor(binds)
    skin = file.add("skins", joints=joints, inverseBindMatrices=inverse)
    node = file.node(primitive, skin=skin)
    play(file, (joints[1], "rotation", [turned(0), turned(90), turned(90)], "LINEAR"),
         (node, "weights", [0, 0, 1, 0, 0, 1], "LINEAR"))  # fmt: skip
    content = read_mesh(file.write(tmp_path))
    for time, angle, weights in ((1, 0, (0, 0)), (1.5, 45, (0.5, 0)), (3, 90, (0.5, 0.5))):
        lift = np.array([0, 0.5 * weights[0], weights[1]])
        np.testing.assert_allclose(corner(content, time, 0), CORNERS[0] + lift, atol=1e-6)
        turn = np.array(
            [[math.cos(a := math.radians(angle)), -math.sin(a)], [math.sin(a), math.cos(a)]]
        )
        hung = CORNERS[2] + lift - [2, 0, 0]
        expected = [*(turn @ hung[:2] + [2, 0]), hung[2]]
        np.testing.assert_allclose(corner(content, time, 2), expected, atol=1e-6)


@pytest.fixture
def moving(tmp_path):
    """A scene of a square that moves before a still one, of a camera that turns, and of a lamp."""
    file = File()
    file.node(file.primitive(), translation=[0, 0, -3])
    node = file.node(file.primitive({"name": "other"}))
    lens = file.add("cameras", type="perspective", perspective={"yfov": 1.2, "znear": 0.1})
    eye = file.node(camera=lens, translation=[1, 0.5, 4])
    lamp = {"type": "point", "color": [1, 1, 1], "intensity": 20}
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [lamp]}}
    file.use("KHR_lights_punctual")
    file.node(translation=[0, 3, 3], extensions={"KHR_lights_punctual": {"light": 0}})

    def made(*channels, **how):
        path = {"node": node, "eye": eye}
        play(file, *((path[who], *rest) for who, *rest in channels), **how)
        return load_scene(file.write(tmp_path))

    return made


SHIFT = "translation", [[0, 0, 0], [0, 0, 1], [0, 0, 1]], "LINEAR"


def test_a_scene_at_an_instant_keeps_what_rests(moving):
    scene = moving(("node", *SHIFT))
    assert scene.instants == (1, 4) and "it moves from 1 to 4 s" in scene.summary()
    now = scene.at(1.5)
    np.testing.assert_array_equal(scene.at(0).triangles, scene.triangles)
    np.testing.assert_array_equal(now.triangles[:2], scene.triangles[:2])
    np.testing.assert_allclose(now.triangles[2:, :, 2], scene.triangles[2:, :, 2] - 0.5, rtol=1e-6)
    assert now.instants is None and now.materials is scene.materials and now.camera == scene.camera
    assert now.textures is scene.textures and now.lights == scene.lights


def test_a_camera_that_moves_takes_the_world_along(moving):
    scene = moving(("eye", "translation", [[1, 0.5, 4], [2, 0.5, 5], [2, 0.5, 5]], "LINEAR"))
    now = scene.at(2)
    expected = scene.triangles + np.float32([-1, 0, 1])
    np.testing.assert_allclose(now.triangles, expected, atol=1e-6)
    np.testing.assert_allclose(now.lights[0].vector, np.array(scene.lights[0].vector) + [-1, 0, 1])


def test_a_camera_frames_all_of_a_movement(tmp_path):
    file = File()
    play(
        file,
        (file.node(file.primitive()), "translation", [[0, 0, 0], [6, 0, 0], [6, 0, 0]], "STEP"),
    )
    path = file.write(tmp_path)
    for scene in (load_scene(path), load_scene(path, bare=True)):
        half = scene.camera.field_width / 2
        for now in (scene.at(1), scene.at(3)):
            x, y, z = now.triangles[:2].reshape(-1, 3).T
            assert (np.abs(x) < half * z).all() and (np.abs(y) < half * z).all()
        assert (np.abs(x) > 0.5 * half * z).any()


def test_what_shrinks_to_nothing_comes_back(moving):
    scene = moving(("node", "scale", [[0, 0, 0], [1, 1, 1], [1, 1, 1]], "LINEAR"))
    assert scene.triangle_count == 2 and scene.at(3).triangle_count == 4
    assert (scene.at(3).material_ids == [0, 0, 1, 1]).all()


def test_the_animation_of_a_name_is_played(tmp_path):
    file = File()
    node = file.node(file.primitive())
    play(file, (node, "translation", CORNERS[:2] * 0, "LINEAR"), times=KEYS[:2], name="rest")
    play(file, (node, *SHIFT), name="walk")
    path = file.write(tmp_path)
    assert (
        load_scene(path).instants == (1, 2) and load_scene(path, animation="walk").instants[1] == 4
    )
    assert "animation 'walk'; animation=\"walk\" plays it" in load_scene(path).summary()
    refused("no animation 'run'.*'rest', 'walk'", load_scene, path, animation="run")


def other(values):
    return lambda file, sampler: sampler.update(input=file.accessor(np.float32(values)))


BAD = {
    "has no keys": lambda file, sampler: file.tree["accessors"][sampler["input"]].update(count=0),
    "keys that run back": other([1, 3, 2]),
    r"keys that run back: \[1.0, 1.0": other([1, 1, 2]),
    "needs 9 finite numbers": lambda file, sampler: sampler.update(output=sampler["input"]),
    "names sampler 7 of 1": lambda file, sampler: file.tree["animations"][0]["channels"][0].update(
        sampler=7
    ),
    r"nodes\[9\]": lambda file, sampler: file.tree["animations"][0]["channels"][0].update(
        target={"node": 9, "path": "scale"}
    ),
    "has a matrix": lambda file, sampler: file.tree["nodes"][0].update(
        matrix=np.eye(4).ravel().tolist()
    ),
    "interpolation 'BEZIER'": lambda file, sampler: sampler.update(interpolation="BEZIER"),
}


@pytest.mark.parametrize("words", BAD)
def test_a_broken_animation_is_one_line(tmp_path, words):
    file = File()
    play(file, (file.node(file.primitive()), *SHIFT))
    BAD[words](file, file.tree["animations"][0]["samplers"][0])
    refused(words, read_mesh, file.write(tmp_path))


@pytest.mark.parametrize(
    ("skin", "words"),
    [({"joints": []}, "skin 0 has no joints"), ({"joints": [7]}, r"nodes\[7\] of 1"),
     ({"joints": [0, 0], "inverseBindMatrices": 0}, "1 bind matrices for 2 joints")],
)  # fmt: skip
def test_a_skin_of_missing_joints_is_one_line(tmp_path, skin, words):
    file = File()
    file.accessor(np.eye(4, dtype=np.float32)[None])
    file.add("skins", **skin)
    corners = {"JOINTS_0": np.tile(np.uint8([0] * 4), (4, 1)), "WEIGHTS_0": np.ones((4, 4), "f4")}
    file.node(file.primitive(indices=FACES, **corners), skin=0)
    refused(words, read_mesh, file.write(tmp_path))


def test_animated_meshes_of_data_sets_play_in_their_place(tmp_path):
    file = File()
    node, shift = file.node(file.primitive()), [[0, 0, 0], [3, 0, 0]]
    play(file, (node, "translation", shift, "LINEAR"), times=KEYS[:2])
    mesh = file.write(tmp_path)
    frames = {"count": 5, "fps": 2, "share_moving": 0}
    shapes = {"meshes": [str(mesh)], "builders": []}
    drawn = sample(
        Description.check(
            {"name": "mine", "kind": "focal_stacks", "shapes": shapes, "frames": frames}
        ),
        0,
    )
    assert len(drawn.moves) == len(drawn.objects) > 0
    for move in drawn.moves:
        start, middle, end, rest = (drawn.scene.at(t).triangles[move.rows] for t in (0, 0.5, 1, 2))
        side = np.linalg.norm(np.diff(start[0], axis=0), axis=-1)
        model = np.linalg.norm(np.diff(CORNERS[FACES[:3]], axis=0), axis=-1)
        size = (side / model)[0]
        assert np.allclose(np.linalg.norm(end - start, axis=-1), 3 * size, rtol=1e-4)
        assert np.allclose(middle, (start + end) / 2, atol=1e-5)
        assert np.array_equal(rest, end)
    assert np.array_equal(drawn.scene.at(0).triangles, drawn.scene.triangles)

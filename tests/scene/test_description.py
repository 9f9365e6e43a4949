"""The schema, and one clear message for each kind of bad scene, in words or in numbers."""

import copy
import dataclasses

import jsonschema
import numpy as np
import pytest

from lfcore import Light, SceneError
from lfcore.scene.build import build_scene
from lfcore.scene.description import check, complete, schema
from lfcore.scene.needs import Needs
from lfcore.tracing.surfaces import pack_surfaces


def test_schema_is_valid_and_closed():
    jsonschema.Draft202012Validator.check_schema(schema())

    def walk(rule, path):
        if isinstance(rule, dict):
            if "properties" in rule:
                assert rule.get("additionalProperties") is False, path
            for key, value in rule.items():
                walk(value, [*path, key])
        elif isinstance(rule, list):
            for index, value in enumerate(rule):
                walk(value, [*path, index])

    walk(schema(), [])


def test_defaults_are_filled_in_without_touching_the_input():
    given = {
        "objects": [{"file": "a.obj"}],
        "lights": [{"position_m": [0, 1, 0], "colour": "#fff000"}],
    }
    before = copy.deepcopy(given)
    full = complete(check(given, file="scene.yaml"))
    assert given == before
    assert full["lights"][0]["casts_shadows"] and full["objects"][0]["seed"] == 0
    assert "lights" not in complete({"objects": given["objects"]})


OBJECT = "objects: [{file: tetrahedron.obj}]"


def mesh(keys):
    return f"objects: [{{file: tetrahedron.obj, {keys}}}]"


def made(builder, parameters):
    return f"objects: [{{builder: {builder}, parameters: {{{parameters}}}}}]"


def camera(keys):
    return f"{OBJECT}\ncamera: {{{keys}}}"


def light(keys):
    return f"{OBJECT}\nlights: [{{colour: [1, 1, 1], {keys}}}]"


def rows(*diagonal):
    return [[value if row == column else 0 for column in range(4)]
            for row, value in enumerate(diagonal)]  # fmt: skip


POSE = "pose: {position_m: [0, 0, 5], look_at_m: "
BAD = {
    "unknown key": ("object: []", "object", "Did you mean 'objects'"),
    "unknown camera key": (camera("focal_length: 50"), "camera.focal_length", "focal_length_mm"),
    "no objects": ("name: x", None, "objects"),
    "empty": ("objects: []", "objects", "scene is empty"),
    "wrong type": (camera("f_number: two"), "camera.f_number", "two"),
    "negative": (camera("f_number: -1"), "camera.f_number", "-1"),
    "nan": (f"{OBJECT}\nambient: [0, .nan, 0]", "ambient[1]", "finite"),
    "both": (
        "objects: [{file: a.obj, builder: bike}]", "objects[0]", "exactly one of file, builder"
    ),
    "neither": ("objects: [{seed: 1}]", "objects[0]", "exactly one of file, builder"),
    "missing mesh": ("objects: [{file: no.obj}]", "objects[0].file", "not found"),
    "unknown builder": ("objects: [{builder: byke}]", "objects[0].builder", "'bike'"),
    "unknown parameter": (made("sphere", "size: 3"), "objects[0].parameters.size", "segments"),
    "parameter that is a number": (
        made("sphere", "1: 2"), "objects[0].parameters.1", "no such parameter"
    ),
    "parameter type": (made("bike", "triangles: 9.5"), "objects[0].parameters.triangles", "int"),
    "parameter value": (
        made("bike", "triangles: 10"), "objects[0].parameters.triangles", "more than asked for"
    ),
    "inside the focal length": (
        camera("focal_length_mm: 50, focus_m: 0.04"), "camera.focus_m", "focal length"
    ),
    "stack inside the focal length": (
        camera("focal_length_mm: 50") + "\nfocus_distances_m: [2.0, 0.01]",
        "focus_distances_m[1]", "focal length",
    ),
    "scene behind the lens": (camera(f"{POSE}[0, 0, 9]}}"), "camera.pose", "sees nothing"),
    "two apertures": (camera("f_number: 2, blur: 3%"), "camera.blur", "excludes f_number"),
    "two focuses": (
        camera("focus_m: near, focus_at: [0.5, 0.5]"), "camera.focus_at", "excludes focus_m"
    ),
    "focus on the background": (camera("focus_at: [0, 0]"), "camera.focus_at", "nothing at 0,0"),
    "focus beyond the far end": (camera("focus_m: 140%"), "camera.focus_m", "near, middle, far"),
    "no direction": (camera("view_from: up"), "view_from", "front"),
    "pose without direction": (camera(f"{POSE}[0, 0, 5]}}"), "camera.pose", "coincide"),
    "up along the view": (
        camera(f"{POSE}[0, 0, 0], up: [0, 0, 1]}}"), "camera.pose.up", "parallel"
    ),
    "scaled pose": (
        camera(f"pose: {{matrix: {rows(2, 2, 2, 1)}}}"), "camera.pose.matrix", "rotation"
    ),
    "texture not found": (
        mesh("material: {texture: no.png}"), "objects[0].material.texture", "not found"
    ),
    "unknown material": (
        mesh("materials: {gold: {diffuse: [1, 1, 0]}}"), "objects[0].materials.gold", "tetrahedron"
    ),
    "bad colour": (f"{OBJECT}\nbackground: '#12345'", "background", "#rrggbb"),
    "two kinds of light": (
        light("position_m: [0, 0, 0], towards_light: [0, 1, 0]"),
        "lights[0]", "exactly one of position_m, towards_light",
    ),
    "light without direction": (
        light("towards_light: [0, 0, 0]"), "lights[0].towards_light", "no length"
    ),
    "zero scale": (mesh("transform: [{scale: 0}]"), "objects[0].transform[0].scale", ""),
    "flat matrix": (
        mesh(f"transform: [{{matrix: {rows(1, 1, 0, 1)}}}]"),
        "objects[0].transform[0].matrix", "flattens",
    ),
    "a light beyond float32": (
        light("position_m: [0, 1.0e+36, 0]"), "lights[0]: metres from the camera", ""
    ),
    "a colour beyond float32": (f"{OBJECT}\nbackground: [1.0e+39, 0, 0]", "background", "1e+39"),
    "a lens beyond float32": (camera("f_number: 1.0e-45"), "camera: lens radius in metres", ""),
    "axis without length": (
        mesh("transform: [{rotate: {axis: [0, 0, 0], angle_deg: 5}}]"),
        "objects[0].transform[0].rotate.axis", "no length",
    ),
}  # fmt: skip


@pytest.mark.parametrize("description, key, words", BAD.values(), ids=BAD.keys())
def test_bad_scene_names_file_key_and_remedy(write_scene, tetrahedron, description, key, words):
    path = write_scene(description)
    with pytest.raises(SceneError) as caught:
        build_scene(path)
    assert (str(caught.value.file), caught.value.key) == (str(path), key)
    assert words in str(caught.value) and "\n" not in str(caught.value)


FROM_6_M = {"position_m": [0, 0, 6], "look_at_m": [0, 0, 0]}


@pytest.mark.parametrize("length", [1e-300, 1e-160, 1.0, 1e160, 1e308])
def test_a_direction_may_have_any_length(write_scene, minimal, length):
    minimal["camera"] = {"pose": FROM_6_M}
    minimal["lights"] = [{"towards_light": [length] * 3, "colour": [1, 1, 1]}]
    (light,) = build_scene(write_scene(minimal)).lights
    np.testing.assert_allclose(light.vector, np.array([1, -1, -1]) / np.sqrt(3), atol=1e-12)


def test_the_tracer_refuses_what_was_built_by_hand(write_scene, minimal):
    scene = build_scene(write_scene(minimal))
    far = dataclasses.replace(scene, lights=[Light(0, (1e36, 0.0, 0.0), (1.0, 1.0, 1.0))])
    with pytest.raises(SceneError, match=r"lights\[0\]: metres"):
        pack_surfaces(far, Needs.of(far))

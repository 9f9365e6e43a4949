"""From scene files to camera space: what they may say, poses, lights, cameras, what is dropped."""

import copy
import dataclasses

import jsonschema
import numpy as np
import pytest
from plain_scenes import refused

from lfcore import Light, write_picture
from lfcore.readers.load import load_scene
from lfcore.readers.pbrt.build import build_pbrt_scene
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.description import check, complete, schema
from lfcore.scene.framing import default_focus_distances
from lfcore.scene.needs import Needs
from lfcore.scene.notes import first_instant
from lfcore.scene.transforms import chain, look_at, rotate, scale, translate
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


CAMERA = {
    "pose": {"position_m": [1, 2, 6], "look_at_m": [0, 0.5, 0]},
    "lightfield": {
        "fov_deg": 50,
        "cameras_per_dim": [4, 2],
        "camera_grid_bounds_m": [-0.5, 0.5, -0.25, 0.3],
        "film_px": [64, 32],
        "samples_per_pixel": 6,
        "shutter": [0.0, 0.5],
    },
}
OBJECT = "objects: [{file: tetrahedron.obj}]"


def mesh(keys):
    return f"objects: [{{file: tetrahedron.obj, {keys}}}]"


def made(builder, parameters):
    return f"objects: [{{builder: {builder}, parameters: {{{parameters}}}}}]"


def camera(keys):
    return f"{OBJECT}\ncamera: {{{keys}}}"


def array(**keys):
    return camera(f"lightfield: {CAMERA['lightfield'] | keys}")


def light(keys):
    return f"{OBJECT}\nlights: [{{colour: [1, 1, 1], {keys}}}]"


def rows(*diagonal):
    return [[value if row == column else 0 for column in range(4)]
            for row, value in enumerate(diagonal)]  # fmt: skip


POSE = "pose: {position_m: [0, 0, 5], look_at_m: "
LAUGHS = "a0: &a0 [1, 1]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 12)
)
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
    "focus on the background": (camera("focus_at: [0, 0]"), "camera.focus_at", "seen at 0,0"),
    "focus beyond the far end": (camera("focus_m: 140%"), "camera.focus_m", "near, middle, far"),
    "no direction": (camera("view_from: up"), "view_from", "front"),
    "pose without direction": (camera(f"{POSE}[0, 0, 5]}}"), "camera.pose", "coincide"),
    "up along the view": (
        camera(f"{POSE}[0, 0, 0], up: [0, 0, 1]}}"), "camera.pose.up", "parallel"
    ),
    "scaled pose": (
        camera(f"pose: {{matrix: {rows(2, 2, 2, 1)}}}"), "camera.pose.matrix", "rotation"
    ),
    "cameras beside the film": (
        array(cameras_per_dim=[3, 2]), "camera.lightfield.cameras_per_dim", ""
    ),
    "bounds in the other order": (
        array(camera_grid_bounds_m=[0.5, -0.5, 0, 1]), "camera.lightfield.camera_grid_bounds_m", ""
    ),
    "shutter that closes first": (array(shutter=[1.0, 0.0]), "camera.lightfield.shutter", ""),
    "half a turn": (array(fov_deg=180), "camera.lightfield.fov_deg", ""),
    "unknown spacing": (array(spacing="odd"), "camera.lightfield.spacing", ""),
    "unknown array key": (array(fov=50), "camera.lightfield.fov", "fov_deg"),
    "motion that scales": (mesh("motion: [{scale: 2.0}]"), "objects[0].motion", ""),
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
    "bounces": (f"{OBJECT}\nbounces: -1", "bounces", "-1 is less than the minimum"),
    "dark sky": (f"{OBJECT}\nsky: {{colour: [-1, 0, 0]}}", "sky.colour[0]", ""),
    "half a sky": (f"{OBJECT}\nsky: {{zenith: [1, 1, 1]}}", "sky", "exactly one of"),
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
    # YAML that is hostile
    "no text": ("", None, "mapping"),
    "a list": ("- a\n- b\n", None, "mapping"),
    "not closed": ("objects: [", None, "YAML"),
    "a tabulator": ("\tx: 1", None, "YAML"),
    "aliases of aliases": (LAUGHS, None, "aliases"),
    "contains itself": ("objects: &a [*a]\n", None, "contains itself"),
    "lists 3000 deep": ("objects: " + "[" * 3000 + "]" * 3000, None, "deep"),
    "a key twice": (f"{OBJECT}\nbounces: 1\nbounces: 2", None, "the key 'bounces' twice"),
    "a key twice, within": (camera("f_number: 2, f_number: 4"), None, "the key 'f_number' twice"),
    "an octal number": (f"{OBJECT}\nbounces: 010", None, "has 010, which YAML takes for 8"),
    "a number of base 60": (camera("focus_m: 1:30"), None, "has 1:30, which YAML takes for 90"),
    "a date that is none": ("objects: 2026-99-99\n", None, "YAML"),
    "a python object": ("objects: !!python/object:os.system []\n", None, "YAML"),
    "NUL": ("objects: \0\n", None, "YAML"),
    "an integer of 80 bits": ("ambient: [1, 1, 9999999999999999999999]", "ambient[2]", "bits"),
    "a false key": ("false: 2\nobjects: [{file: a}]\n", "False", "unknown key"),
}  # fmt: skip


@pytest.mark.parametrize("description, key, words", BAD.values(), ids=BAD.keys())
def test_bad_scene_names_file_key_and_remedy(write_scene, tetrahedron, description, key, words):
    path = write_scene(description)
    caught = refused(None, load_scene, path)
    assert (str(caught.file), caught.key) == (str(path), key) and words in str(caught)
    assert key or caught.remedy


SKIES = [
    (lambda path: write_picture(path, np.ones((8, 8, 3), np.float32)), "no panorama: 8 x 8"),
    (lambda path: write_picture(path, np.full((8, 16, 3), -1, np.float32)), "values from -1"),
    (lambda path: write_picture(path, np.full((8, 16, 3), np.nan, np.float32)), "values from nan"),
    (lambda path: path.with_suffix(".hdr").write_bytes(b"#?RADIANCE\n\n-Y 25000 +X 40000\n"),
     "40000 x 25000 texels"),
    (lambda path: None, "sky not found"),
]  # fmt: skip


@pytest.mark.parametrize(("write", "message"), SKIES)
def test_a_sky_that_is_none_is_refused(write_scene, tetrahedron, tmp_path, write, message):
    write(tmp_path / "sky.exr")
    name = "sky.hdr" if (tmp_path / "sky.hdr").exists() else "sky.exr"
    caught = refused(message, load_scene, write_scene(f"{OBJECT}\nsky: {{file: {name}}}"))
    assert caught.key == "sky.file" or message == "sky not found"


@pytest.mark.parametrize("length", [1e-300, 1e-160, 1.0, 1e160, 1e308])
def test_a_direction_may_have_any_length(write_scene, minimal, length):
    minimal["camera"] = {"pose": {"position_m": [0, 0, 6], "look_at_m": [0, 0, 0]}}
    minimal["lights"] = [{"towards_light": [length] * 3, "colour": [1, 1, 1]}]
    (light,) = load_scene(write_scene(minimal), bare=True).lights
    np.testing.assert_allclose(light.vector, np.array([1, -1, -1]) / np.sqrt(3), atol=1e-12)


def test_the_tracer_refuses_what_was_built_by_hand(write_scene, minimal):
    scene = load_scene(write_scene(minimal), bare=True)
    far = dataclasses.replace(scene, lights=[Light(0, (1e36, 0.0, 0.0), (1.0, 1.0, 1.0))])
    refused(r"lights\[0\]: metres", pack_surfaces, far, Needs.of(far))


def test_two_line_scene_is_framed_and_lit(write_scene, minimal):
    scene = load_scene(write_scene(minimal), bare=True)
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
    scene = load_scene(tmp_path / "a.obj", bare=True)
    seen = scene.triangles.reshape(-1, 3)
    seen = seen[:, :2] / seen[:, 2:] / (scene.camera.field_width / 2)
    low, high = seen.min(0), seen.max(0)
    np.testing.assert_allclose(high, -low, atol=1e-5)
    assert high.max() == pytest.approx(0.9, abs=1e-5)


def test_an_axis_that_is_up(tetrahedron, write_scene, minimal):
    turned = minimal["objects"][0] | {"transform": [{"rotate": {"axis": "x", "angle_deg": -90}}]}
    expected = load_scene(write_scene({"objects": [turned]}), bare=True)
    np.testing.assert_array_equal(
        load_scene(tetrahedron, up="z", bare=True).triangles, expected.triangles
    )
    for path, up in ((tetrahedron, "x"), (write_scene(minimal), "z")):
        refused("up: ", load_scene, path, up=up)


def test_mesh_path_and_folder_are_scenes_too(write_scene, minimal, tetrahedron):
    expected = load_scene(write_scene(minimal), bare=True).triangles
    for path in (tetrahedron, tetrahedron.parent):
        np.testing.assert_array_equal(load_scene(path, bare=True).triangles, expected)
    assert load_scene(tetrahedron, bare=True).name == "tetrahedron"


def test_pose_matrix_equals_look_at(write_scene, minimal):
    position, target = [1.0, 2.0, 3.0], [0.2, 0.1, -0.4]
    rotation = look_at(position, target)[:3, :3]
    to_world = np.eye(4)
    to_world[:3, :3] = rotation.T @ np.diag([1, -1, -1])
    to_world[:3, 3] = position
    minimal["camera"] = {"pose": {"position_m": position, "look_at_m": target}}
    expected = load_scene(write_scene(minimal), bare=True).triangles
    minimal["camera"] = {"pose": {"matrix": to_world.tolist()}}
    found = load_scene(write_scene(minimal), bare=True).triangles
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_transform_steps_apply_in_order(write_scene, minimal):
    steps = [
        {"scale": [1, 2, 3]},
        {"rotate": {"axis": "y", "angle_deg": 90}},
        {"translate_m": [0, 0, -5]},
    ]
    minimal["objects"][0]["transform"] = steps
    minimal["camera"] = {"pose": {"position_m": [0, 0, 0], "look_at_m": [0, 0, -1]}}
    scene = load_scene(write_scene(minimal), bare=True)
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
    scene = load_scene(write_scene({"camera": camera, "objects": [{"file": "far.obj"}]}), bare=True)
    # x stays, y turns over, z becomes the distance from the lens.
    expected = [[0.001, 0, 1], [0.002, 0, 1], [0.001, -0.001, 0.5]]
    np.testing.assert_allclose(scene.triangles[0], expected, atol=1e-8)


def test_bad_triangles_are_dropped_and_counted(write_scene, tmp_path):
    (tmp_path / "dirty.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv nan 0 0\nv inf 0 0\nv 1e20 0 0\nv 2 0 0\n"
        "f 1 2 3\nf 1 2 4\nf 1 2 5\nf 1 3 6\nf 1 2 7\nf 1 1 2\n"
    )
    scene = load_scene(write_scene({"objects": [{"file": "dirty.obj"}]}), bare=True)
    assert scene.dropped == {"not finite": 2, "out of range": 1, "zero area": 2}
    assert np.isfinite(scene.triangles).all() and np.isfinite(scene.normals).all()


def test_lights_follow_the_camera(write_scene, minimal):
    minimal["camera"] = {"pose": {"position_m": [0, 0, 5], "look_at_m": [0, 0, 0]}}
    minimal["lights"] = [
        {"position_m": [1, 2, 3], "colour": [1, 0.5, 0.25], "reference_distance_m": 2},
        {"towards_light": [0, 4, 0], "colour": "#ffffff", "casts_shadows": False},
    ]
    point, sun = load_scene(write_scene(minimal), bare=True).lights
    assert point.kind == POINT and point.vector == pytest.approx((1, -2, 2))
    assert point.casts_shadows and point.reference_distance_m == 2
    assert sun.kind == DIRECTIONAL and sun.vector == pytest.approx((0, -1, 0))
    assert sun.colour == pytest.approx((1, 1, 1)) and not sun.casts_shadows
    minimal["lights"] = []
    assert load_scene(write_scene(minimal), bare=True).lights == [], "none is not the default"


def test_material_overrides(write_scene, minimal):
    minimal["objects"][0]["material"] = {"diffuse": "#ff0000", "specular": [0.5, 0.5, 0.5]}
    minimal["objects"].append({**minimal["objects"][0], "material": {"emission": [0, 1, 0]}})
    scene = load_scene(write_scene(minimal), bare=True)
    first, second = scene.materials
    assert first.diffuse == (1, 0, 0) and first.specular == (0.5, 0.5, 0.5)
    assert second.emission == (0, 1, 0)
    assert scene.material_ids.tolist() == [0] * 4 + [1] * 4


def test_glass_and_coats_have_keys(write_scene, minimal):
    given = {
        "opacity": 0.75, "transmission": 1, "ior": 1.25, "thin_walled": True, "clearcoat": 0.5,
        "attenuation_distance_m": 2, "attenuation_colour": [1, 0.5, 0], "clearcoat_roughness": 0.25,
    }  # fmt: skip
    minimal["objects"][0]["material"] = given
    (material,) = load_scene(write_scene(minimal)).materials
    for key, value in given.items():
        assert getattr(material, key) == (tuple(value) if key.endswith("colour") else value)
    for key, value in (("ior", 0.9), ("attenuation_colour", [1, 2, 0]), ("opacity", 1.5)):
        minimal["objects"][0]["material"] = {key: value}
        refused(rf"material\.{key}", load_scene, write_scene(minimal))


def test_default_focus_distances_span_what_is_seen(write_scene, minimal):
    scene = load_scene(write_scene(minimal), bare=True)
    distances = np.array(scene.focus_distances_m)
    depth = scene.triangles[..., 2]
    assert len(distances) == 5 and np.all(np.diff(distances) > 0)
    assert depth.min() <= distances[0] and distances[-1] <= depth.max() * (1 + 1e-6)
    steps = np.diff(1 / distances)
    np.testing.assert_allclose(steps, steps[0])
    behind = scene.triangles * (1, 1, -1)
    assert default_focus_distances(scene.camera, behind) == (scene.camera.focus_m,)


PBRT = """\
Scale -1 1 1
LookAt 1 2 6  0 0.5 0  0 1 0
Camera "lightfield" "float fov" [50] "integer camerasperdim" [4 2]
       "float cameragridbounds" [-0.5 0.5 -0.25 0.3] "float shutterclose" [0.5]
Film "image" "integer xresolution" [64] "integer yresolution" [32]
Sampler "stratified" "integer xsamples" [2] "integer ysamples" [3]
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
AttributeBegin
    Translate 0 1 0
    ActiveTransform EndTime  Translate 0.5 0 0  Rotate 30 0 0 1  ActiveTransform All
    Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 0  1 0 0  0 1 0]
AttributeEnd
WorldEnd
"""


def test_yaml_and_pbrt_mean_the_same(tmp_path, write_scene):
    (tmp_path / "scene.pbrt").write_text(PBRT)
    pbrt = build_pbrt_scene(tmp_path / "scene.pbrt")
    (tmp_path / "triangle.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    move = [{"translate_m": [0, 1, 0]}]
    turn = [{"rotate": {"axis": "z", "angle_deg": 30}}, {"translate_m": [0.5, 0, 0]}]
    entry = {"file": "triangle.obj", "transform": move, "motion": turn}
    ours = load_scene(write_scene({"camera": CAMERA, "objects": [entry]}), bare=True)
    assert ours.view == pbrt.view
    assert ours.view.shutter == (0.0, 0.5) and ours.view.samples_per_pixel == 6
    assert ours.view.array.tile == (16, 16)
    assert len(ours.motions) == len(pbrt.motions) == 1
    said = first_instant(0, 1)
    assert said in ours.summary() and said in pbrt.summary()
    (tmp_path / "later.pbrt").write_text(PBRT.replace("Film", "TransformTimes 2 4\nFilm"))
    later = build_pbrt_scene(tmp_path / "later.pbrt")
    assert later.instants == (2, 4)
    for time in (-1.0, 0.0, 0.3, 1.0):
        places = ours.at(time).triangles
        for scene, then in ((pbrt, time), (later, 2 + 2 * time)):
            np.testing.assert_allclose(scene.at(then).triangles, places, atol=1e-6)
    assert np.abs(ours.at(1.0).triangles - ours.triangles).max() > 0.3

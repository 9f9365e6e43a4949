"""glTF as people export it: lights, cameras, extensions, and what is said of what is dropped."""

import math
from functools import partial

import numpy as np
import pytest
import trimesh
from PIL import Image
from plain_scenes import load_mesh, refused
from trimesh.visual.material import PBRMaterial

from lfcore.colour import srgb_decode
from lfcore.readers.gltf.materials import GLOSSY
from lfcore.readers.load import load_scene
from lfcore.readers.meshes import read_mesh
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.needs import Needs
from lfcore.scene.notes import Notebook

UV = [[0, 0], [1, 0], [1, 1], [0, 1]]


@pytest.fixture
def write(tmp_path):
    """A function that exports a square, changes its JSON, and gives the path."""

    def make(change=lambda tree: None, **material):
        corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
        visual = trimesh.visual.TextureVisuals(UV, material=PBRMaterial(**material))
        mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
        mesh.export(tmp_path / "m.glb", tree_postprocessor=change)
        return tmp_path / "m.glb"

    return make


def picture(mode="RGB", colour=(255, 0, 0)):
    return Image.new(mode, (4, 4), colour)


@pytest.fixture
def made(write):
    """A function: the part that is read of such a square, and the notes."""

    def read(*change, **material):
        notebook = Notebook()
        parts = load_mesh(write(*change, **material), notebook=notebook)
        return (parts[0] if parts else None), [f"{n.kind}: {n.what}" for n in notebook.notes()]

    return read


def use(tree, name, value):
    """Put an extension into the only material, and among those used."""
    tree.setdefault("extensionsUsed", []).append(name)
    tree["materials"][0].setdefault("extensions", {})[name] = value


def add_node(tree, **node):
    tree["nodes"].append(node)
    tree["scenes"][0].setdefault("nodes", []).append(len(tree["nodes"]) - 1)


def lights(*kinds):
    def change(tree):
        tree["extensionsUsed"] = ["KHR_lights_punctual"]
        given = [{"type": kind, "intensity": 10.0, "color": [1, 0.5, 0]} for kind in kinds]
        tree["extensions"] = {"KHR_lights_punctual": {"lights": given}}
        turn = [math.sqrt(0.5), 0, 0, math.sqrt(0.5)]  # a quarter about x: -z becomes +y
        for number in range(len(kinds)):
            reference = {"KHR_lights_punctual": {"light": number}}
            add_node(tree, translation=[1, 2, 3], rotation=turn, extensions=reference)

    return change


def test_punctual_lights(write):
    path = write(lights("point", "directional", "spot"))
    point, sun, spot = read_mesh(path).lights
    assert (point.kind, point.vector) == (POINT, (1, 2, 3)) and point.reference_distance_m == 1
    np.testing.assert_allclose(point.colour, np.array([10, 5, 0]) / math.pi)
    # It shines along +y, so it stands below.
    assert sun.kind == DIRECTIONAL
    np.testing.assert_allclose(sun.vector, (0, -1, 0), atol=1e-12)
    assert spot.kind == POINT and not load_scene(path, bare=True).notes
    np.testing.assert_allclose(spot.normal, (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(spot.cone, (1, math.sqrt(0.5)))


def test_lights_of_a_file_replace_the_default_and_move_with_their_object(write, write_scene):
    path = write(lights("point", "point"))
    assert [light.kind for light in load_scene(path, bare=True).lights] == [POINT, POINT]
    sun = [{"towards_light": [0, 1, 0], "colour": [1, 1, 1]}]
    scene = load_scene(write_scene({"objects": [{"file": path.name}], "lights": sun}), bare=True)
    assert [light.kind for light in scene.lights] == [DIRECTIONAL]
    assert "2 lights: the scene has its own" in scene.summary()
    entry = {"file": write(lights("point")).name, "transform": [{"translate_m": [5, 0, 0]}]}
    pose = {"position_m": [6, 2, 9], "look_at_m": [6, 2, 0]}
    scene = load_scene(write_scene({"objects": [entry], "camera": {"pose": pose}}), bare=True)
    np.testing.assert_allclose(scene.lights[0].vector, (0, 0, 6), atol=1e-12)


def camera(tree):
    tree["cameras"] = [
        {"type": "orthographic", "name": "plan", "orthographic": {}},
        {"type": "perspective", "perspective": {"yfov": 1.0, "aspectRatio": 1.5, "znear": 0.1}},
        {"type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 0.5, "znear": 0.1}},
    ]
    for number in range(3):
        add_node(tree, camera=number, translation=[0.5, 0.5, 4 + number])


def test_the_first_perspective_camera_looks_unless_the_scene_has_a_pose(write, write_scene):
    scene = load_scene(write(camera), bare=True)
    assert scene.camera.field_width == pytest.approx(2 * math.tan(0.5))
    assert scene.camera.focus_m == pytest.approx(5)
    # From (0.5, 0.5, 5) along -z: x to the right, y down.
    np.testing.assert_allclose(scene.triangles[0, 0], (-0.5, 0.5, 5), atol=1e-6)
    assert "camera 'plan'" in scene.summary() and "camera 2" in scene.summary()
    pose = {"position_m": [0, 0, 9], "look_at_m": [0, 0, 0]}
    description = {"objects": [{"file": write(camera).name}], "camera": {"pose": pose}}
    scene = load_scene(write_scene(description), bare=True)
    np.testing.assert_allclose(scene.triangles[0, 0], (0, 0, 9), atol=1e-6)
    assert "the scene has another" in scene.summary()


def test_a_texture_is_moved(made):
    change = {"offset": [0.25, 0.5], "rotation": math.pi / 2, "scale": [2, 3]}

    def move(tree):
        info = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        info["extensions"] = {"KHR_texture_transform": change}
        tree["extensionsRequired"] = tree["extensionsUsed"] = ["KHR_texture_transform"]

    plain, _ = made(baseColorTexture=picture())
    part, notes = made(move, baseColorTexture=picture())
    # With glTF's v, down: (u, v) to (2 u, 3 v), a quarter to (3 v, -2 u), then the offset.
    u, v = plain.uvs[..., 0], 1 - plain.uvs[..., 1]
    np.testing.assert_allclose(part.uvs[..., 0], 3 * v + 0.25, atol=1e-6)
    np.testing.assert_allclose(1 - part.uvs[..., 1], -2 * u + 0.5, atol=1e-6)
    assert notes == []


def test_what_glows(made):
    unlit = partial(use, name="KHR_materials_unlit", value={})
    part, notes = made(unlit, baseColorFactor=[1.0, 0.2, 0, 1])
    assert part.surface.emission == (1, 0.2, 0)
    assert part.surface.diffuse == part.surface.specular == (0, 0, 0) and notes == []
    five = {"emissiveStrength": 5.0}
    strong = partial(use, name="KHR_materials_emissive_strength", value=five)
    part, notes = made(strong, emissiveFactor=[0.5, 1.0, 0])
    assert part.surface.emission == pytest.approx((2.5, 5, 0)) and notes == []
    grey = picture(colour=(128, 128, 128))
    part, notes = made(strong, emissiveFactor=[1.0, 1, 0], emissiveTexture=grey)
    assert part.surface.emission == pytest.approx((5, 5, 0)) and notes == []
    assert (part.surface.emission_texture == 128).all()


def test_metal_and_roughness(made):
    image = picture(colour=(0, 51, 255))
    for material, expected in (
        ({"metallicRoughnessTexture": image, "roughnessFactor": 0.5}, (1, 0.5)),
        ({"metallicFactor": 0.25}, (0.25, 1)),
        ({"baseColorFactor": [1.0, 0, 0, 1]}, (1, 1)),  # glTF's default
    ):  # fmt: skip
        part, notes = made(**material)
        assert (part.surface.metallic, part.surface.roughness) == expected and notes == []
        if "metallicRoughnessTexture" in material:
            assert (part.surface.metal_texture == (0, 51, 255)).all()
    assert part.surface.specular == (0, 0, 0)


def test_bumps_with_their_scale(write, made):
    def scale(tree):
        tree["materials"][0]["normalTexture"]["scale"] = 0.3

    part, notes = made(scale, normalTexture=picture(colour=(128, 128, 255)))
    assert part.surface.normal_scale == 0.3 and notes == []
    assert (part.surface.normal_texture == (128, 128, 255)).all()
    scene = load_scene(write(scale, normalTexture=picture(), emissiveTexture=picture(),
                              emissiveFactor=[1.0, 1, 1]), bare=True)  # fmt: skip
    # One picture, once as numbers and once as colours.
    (material,) = scene.materials
    assert {material.normal_texture, material.emission_texture} == {0, 1}
    assert Needs.of(scene).physical and len(scene.uvs)


def test_what_one_set_of_coordinates_cannot_say_is_noted(made):
    def change(tree):
        entry = tree["materials"][0]
        entry["normalTexture"]["texCoord"] = 1
        move = {"KHR_texture_transform": {"scale": [2, 2]}}
        entry["emissiveTexture"]["extensions"] = move

    halves = picture(colour=(0, 0, 0))
    halves.paste((255, 255, 255), (0, 0, 4, 2))
    pictures = {"normalTexture": picture(), "emissiveTexture": halves}
    part, notes = made(change, emissiveFactor=[1.0, 1, 1], baseColorTexture=picture(), **pictures)
    assert part.surface.normal_texture is None
    assert part.surface.emission_texture.tolist() == [[[188] * 3]], "half of the light"
    assert [note.split("'m': ")[1] for note in notes] == [
        "emissiveTexture has coordinates of its own; its mean is used",
        "normalTexture has coordinates of its own; it is left out",
    ]  # fmt: skip


@pytest.mark.parametrize(("wrap", "scale", "said"), [(33071, 2, 1), (33071, 1, 0), (10497, 2, 0)])
def test_a_texture_that_should_not_repeat_and_does_is_noted(made, wrap, scale, said):
    def change(tree):
        tree["samplers"] = [{"wrapT": wrap}]
        tree["textures"][0]["sampler"] = 0
        info = tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]
        info["extensions"] = {"KHR_texture_transform": {"scale": [1, scale]}}

    _, notes = made(change, baseColorTexture=picture())
    assert len(notes) == said and all("it repeats" in note for note in notes)


def test_a_description_may_ask_for_metal_or_for_none(write, write_scene):
    name = write(metallicFactor=0.5).name
    for given, expected in (
        ({"metallic": 1, "roughness": 0.2}, (1, 0.2)), ({"roughness": 0.3}, (0.5, 0.3)),
        ({"shininess": 9}, (-1, 1)),
    ):  # fmt: skip
        scene = load_scene(write_scene({"objects": [{"file": name, "material": given}]}), bare=True)
        assert (scene.materials[0].metallic, scene.materials[0].roughness) == expected


@pytest.mark.parametrize(
    ("mode", "alpha", "said"),
    [
        ("MASK", 0, "cut out wholly"),
        ("MASK", 255, None),
        ("BLEND", 255, None),
        ("BLEND", 0, "cut out wholly"),
        ("BLEND", 200, None),
        ("OPAQUE", 0, None),
    ],
)
def test_alpha(made, mode, alpha, said):
    part, notes = made(baseColorTexture=picture("RGBA", (255, 0, 0, alpha)), alphaMode=mode)
    assert (part is None) == (said == "cut out wholly")
    assert part is None or part.surface.alpha_cutoff == 0
    assert (said is None) == (not notes) and (said is None or said in notes[-1])


@pytest.mark.parametrize(
    ("mode", "factor", "cutoff"), [("MASK", 1.0, 0.25), ("MASK", 0.5, 0.5), ("BLEND", 0.75, 0)]
)
def test_a_texture_cuts_holes_by_its_alpha(write, made, mode, factor, cutoff):
    """glTF compares factor times alpha with the cutoff, and draws what is not below it."""
    image = picture("RGBA", (255, 0, 0, 255))
    image.putpixel((1, 2), (0, 0, 0, 40))
    alpha = {"alphaMode": mode, "alphaCutoff": 0.25, "baseColorFactor": [1.0, 1.0, 1.0, factor]}
    part, notes = made(baseColorTexture=image, **alpha)
    assert part.surface.alpha_cutoff == pytest.approx(
        cutoff, rel=4e-3
    )  # trimesh writes rounded ones
    assert part.surface.texture.shape == (4, 4, 4) and part.surface.texture[2, 1, 3] == 40
    assert not notes and part.surface.opacity == pytest.approx(1 if cutoff else factor, rel=4e-3)
    scene = load_scene(write(baseColorTexture=image, **alpha), bare=True)
    needs, (material,) = Needs.of(scene), scene.materials
    assert needs.alpha_tests == scene.has_alpha_test(material) == (mode == "MASK")
    assert needs.specular == scene.has_alpha_blend(material) == (mode == "BLEND")


GLOSSY_CASES = [
    # diffuse, specular, gloss; base colour, metal, roughness
    ([0.5, 0.2, 0, 1], [0.04] * 3, 0.25, (0.5, 0.2, 0), 0, 0.75),
    ([0, 0, 0, 1], [0.9, 0.6, 0.1], 1, (0.9, 0.6, 0.1), 1, 0),
]


@pytest.mark.parametrize("textured", [False, True])
@pytest.mark.parametrize(("diffuse", "specular", "gloss", "base", "metal", "rough"), GLOSSY_CASES)
def test_diffuse_and_specular_become_metal_and_roughness(
    made, textured, diffuse, specular, gloss, base, metal, rough
):
    value = {"diffuseFactor": diffuse, "specularFactor": specular, "glossinessFactor": gloss}
    images = {}
    if textured:
        value["diffuseTexture"] = {"index": 0}
        images["baseColorTexture"] = picture(colour=(255, 255, 255)).quantize()
    part, notes = made(partial(use, name=GLOSSY, value=value), **images)
    assert notes == [f"approximated: extension {GLOSSY}: as metal and roughness"]
    surface = part.surface
    found = surface.diffuse, surface.metallic, surface.roughness
    if textured:
        assert found == ((1, 1, 1), 1, 1)
        _, green, blue = surface.metal_texture[0, 0] / 255
        found = srgb_decode(surface.texture[0, 0] / 255), blue, green
    np.testing.assert_allclose(found[0], base, atol=0.01)
    np.testing.assert_allclose(found[1:], (metal, rough), atol=0.01)


def test_what_is_left_out_is_listed_by_name(made):
    def change(tree):
        tree["skins"] = [{"name": "bones", "joints": [0]}]
        tree["animations"] = [{"name": "walk"}]
        tree["meshes"][0]["name"] = "square"
        primitives = tree["meshes"][0]["primitives"]
        primitives.append({"attributes": primitives[0]["attributes"], "mode": 1})
        tree["extensionsUsed"] = ["KHR_xmp"]

    _, notes = made(change)
    assert set(notes) == {
        "not used: 1 of 1 skins", "left out: animation 'walk': it moves no node",
        "left out: lines of mesh 'square'", "left out: extension KHR_xmp: not known",
    }  # fmt: skip


def test_a_required_extension_that_is_not_known_is_refused(write):
    def change(tree):
        tree["extensionsRequired"] = ["KHR_texture_transform", "KHR_of_tomorrow"]

    refused(r"m\.glb: extensionsRequired: .*KHR_of_tomorrow", load_scene, write(change))


def test_names_of_materials_stay(made):
    part, _ = made(lambda tree: tree["materials"][0].update(name="7"), name="x")
    assert part.surface.name == "7"
    part, _ = made(lambda tree: tree["materials"][0].pop("name", None))
    assert part.surface.name == "m"

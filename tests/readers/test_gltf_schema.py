"""Every key of glTF's schema is in the scene, or noted, or is one of those that say nothing.

The keys are those of the specification's JSON schema and of the extensions that are read.
"""

import copy
import json
import re
from pathlib import Path

import numpy as np
import pytest
from gltf_files import CORNERS, UVS, File, png

from lfcore.errors import LfcoreError
from lfcore.readers.gltf import extensions
from lfcore.readers.meshes import read_mesh
from lfcore.scene.notes import Notebook

SCHEMA = {
    "glTF": "extensionsUsed extensionsRequired accessors animations asset buffers bufferViews "
    "cameras images materials meshes nodes samplers scene scenes skins textures",
    "accessors": "bufferView byteOffset componentType normalized count type max min sparse",
    "sparse": "count indices values",
    "sparse.indices": "bufferView byteOffset componentType",
    "sparse.values": "bufferView byteOffset",
    "animations": "channels samplers name",
    "animations.samplers": "input output interpolation",
    "channels": "sampler target",
    "target": "node path",
    "asset": "copyright generator version minVersion",
    "buffers": "uri byteLength",
    "bufferViews": "buffer byteOffset byteLength byteStride target",
    "cameras": "orthographic perspective type name",
    "perspective": "aspectRatio yfov zfar znear",
    "images": "uri mimeType bufferView",
    "materials": "name pbrMetallicRoughness normalTexture occlusionTexture emissiveTexture "
    "emissiveFactor alphaMode alphaCutoff doubleSided",
    "pbrMetallicRoughness": "baseColorFactor baseColorTexture metallicFactor roughnessFactor "
    "metallicRoughnessTexture",
    "baseColorTexture": "index texCoord",
    "normalTexture": "index scale",
    "meshes": "primitives weights name",
    "primitives": "attributes indices material mode targets",
    "nodes": "camera children skin matrix mesh rotation scale translation weights name",
    "samplers": "magFilter minFilter wrapS wrapT",
    "scenes": "nodes",
    "skins": "inverseBindMatrices skeleton joints",
    "textures": "sampler source",
    "KHR_texture_transform": "offset rotation scale texCoord",
    "lights": "color intensity type range spot name",
    "spot": "innerConeAngle outerConeAngle",
    "KHR_materials_emissive_strength": "emissiveStrength",
    "KHR_materials_ior": "ior",
    "KHR_materials_transmission": "transmissionFactor transmissionTexture",
    "KHR_materials_volume": "thicknessFactor thicknessTexture attenuationDistance attenuationColor",
    "KHR_materials_clearcoat": "clearcoatFactor clearcoatTexture clearcoatRoughnessFactor "
    "clearcoatRoughnessTexture clearcoatNormalTexture",
    "EXT_mesh_gpu_instancing": "attributes",
    "KHR_node_visibility": "visible",
}
SILENT = {
    "accessors": {"max", "min"}, "asset": {"copyright", "generator"}, "buffers": {"byteLength"},
    "bufferViews": {"target"}, "cameras": {"orthographic", "type"},
    "perspective": {"zfar", "znear"},
    "images": {"mimeType"}, "materials": {"doubleSided"}, "samplers": {"minFilter"},
    "skins": {"skeleton"},
}  # fmt: skip
"""Keys that say nothing of the picture, or what another key says; docs/formats.md lists them."""


def everything():
    """A tree that has every key."""
    file = File()
    picture = np.random.default_rng(1).integers(0, 255, (4, 4, 3))
    sampler = file.add("samplers", magFilter=9728, minFilter=9987, wrapS=33071, wrapT=10497)
    plain = file.texture(np.full((4, 4, 3), 90, np.uint8))
    data = file.view(png(np.uint8([[[255, 0, 90]]])))
    held = file.add("textures", source=file.add("images", bufferView=data, mimeType="image/png"))
    alpha = np.dstack([picture, np.tile([0, 255], (4, 2))])
    moved = {"offset": [0.1, 0.2], "rotation": 0.3, "scale": [2, 3]}
    base = file.texture(alpha, sampler=sampler) | {
        "texCoord": 1, "extensions": {"KHR_texture_transform": moved},
    }  # fmt: skip
    coat = {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.5, "clearcoatTexture": plain,
            "clearcoatRoughnessTexture": plain, "clearcoatNormalTexture": plain}  # fmt: skip
    volume = {"thicknessFactor": 1, "thicknessTexture": plain, "attenuationDistance": 2,
              "attenuationColor": [0.5, 0.5, 1]}  # fmt: skip
    material = {
        "name": "all", "alphaMode": "MASK", "alphaCutoff": 0.25, "doubleSided": True,
        "emissiveFactor": [0.5, 0.25, 0.125], "emissiveTexture": {"index": held},
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 0.25, 0.125, 0.75], "baseColorTexture": base,
            "metallicFactor": 0.5, "roughnessFactor": 0.25, "metallicRoughnessTexture": plain,
        },
        "normalTexture": {"index": plain["index"], "scale": 0.5, "extensions": {
            "KHR_texture_transform": {**moved, "texCoord": 1}}}, "occlusionTexture": plain,
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 3},
            "KHR_materials_ior": {"ior": 1.25}, "KHR_materials_volume": volume,
            "KHR_materials_transmission": {"transmissionFactor": 0.5, "transmissionTexture": plain},
            "KHR_materials_clearcoat": coat,
        },
    }  # fmt: skip
    file.tree["bufferViews"][data]["target"] = 34962
    codes = file.accessor(np.uint8(UVS * 255), normalized=True, min=[0, 0], max=[1, 1], stride=4)
    primitive = file.primitive(
        material, TEXCOORD_1=codes, COLOR_0=CORNERS / 2, NORMAL=CORNERS + 1,
        JOINTS_0=np.tile(np.uint8([0, 1, 0, 0]), (4, 1)),
        WEIGHTS_0=np.tile(np.float32([0.5, 0.5, 0, 0]), (4, 1)),
    )  # fmt: skip
    target = file.accessor(np.concatenate([CORNERS * 0 + 9, CORNERS]), byteOffset=48)
    file.tree["accessors"][target]["count"] = 4
    places, values = np.uint8([7, 1, 3]), np.concatenate([CORNERS[:1] + 8, CORNERS[:2] + 3])
    file.tree["accessors"][target]["sparse"] = {
        "count": 2, "values": {"bufferView": file.view(values.tobytes()), "byteOffset": 12},
        "indices": {"bufferView": file.view(places.tobytes()), "byteOffset": 1,
                    "componentType": 5121},
    }  # fmt: skip
    primitive["targets"], primitive["mode"] = [{"POSITION": target}], 5
    lines = {"attributes": primitive["attributes"], "mode": 1}
    sampler = file.add("samplers", wrapT=33071)
    base = file.texture(picture, sampler=sampler) | {
        "texCoord": 1, "extensions": {"KHR_texture_transform": {"scale": [3, 3]}},
    }  # fmt: skip
    other = file.primitive({"pbrMetallicRoughness": {"baseColorTexture": base}}, TEXCOORD_1=codes)
    file.node(primitive, lines, other, mesh={"weights": [0.5], "name": "square"})
    many = {"TRANSLATION": file.accessor(CORNERS)}
    turn = [0, 0, 0.6, 0.8]
    joints = [
        file.node(root=False, rotation=turn, scale=[1, 2, 1], translation=[1, 2, 3]),
        file.node(root=False, matrix=(2 * np.eye(4) + np.eye(4, k=1)).ravel().tolist()),
    ]
    instances = {"EXT_mesh_gpu_instancing": {"attributes": many}}
    file.node(mesh=None, extensions=instances, children=joints, translation=[0, 0, 1])
    binds = file.accessor(np.tile(np.eye(4, dtype=np.float32) * 2, (2, 1, 1)))
    skin = file.add("skins", joints=joints, inverseBindMatrices=binds, skeleton=joints[0])
    file.node(mesh=None, skin=skin, weights=[0.25])
    for node in (-1, -2):
        file.tree["nodes"][node]["mesh"] = 0
    file.node(children=[file.node(root=False)],
              extensions={"KHR_node_visibility": {"visible": False}})  # fmt: skip
    file.tree["nodes"][-2]["mesh"] = 0
    flat = file.add("cameras", type="orthographic", orthographic={"xmag": 1}, name="plan")
    lens = {"aspectRatio": 0.5, "yfov": 1, "zfar": 9, "znear": 1}
    eye = file.add("cameras", type="perspective", perspective=lens)
    spot = {"color": [1, 0.5, 0.25], "intensity": 3, "type": "spot", "range": 4, "name": "lamp",
            "spot": {"innerConeAngle": 0.5, "outerConeAngle": 0.75}}  # fmt: skip
    file.tree["extensions"] = {"KHR_lights_punctual": {"lights": [spot]}}
    file.node(camera=flat)
    file.node(camera=file.add("cameras", type="orthographic"), name="drawing")
    file.node(camera=eye, extensions={"KHR_lights_punctual": {"light": 0}})
    keys = {"input": file.accessor(np.float32([0, 1])), "interpolation": "STEP"}
    keys["output"] = file.accessor(np.float32([[1, 2, 3], [5, 6, 7]]))
    moved = [{"sampler": 0, "target": {"node": joints[0], "path": "translation"}}]
    for name in ("turn", "rest"):
        file.add("animations", channels=moved, samplers=[keys], name=name)
    file.tree["asset"] |= {"copyright": "none", "generator": "test", "minVersion": "2.0"}
    file.tree |= {"extensionsUsed": ["KHR_xmp"], "extensionsRequired": ["KHR_texture_transform"]}
    file.tree["scenes"].insert(0, {"nodes": []})
    file.tree["scene"] = 1
    return file


def found(path):
    """All that is read of a file, in words and numbers; or that it is refused."""
    notebook = Notebook()
    try:
        content = read_mesh(path, notebook=notebook)
    except LfcoreError:
        return "refused"
    parts = [
        [part.triangles, part.normals, part.uvs, part.colours, *vars(part.surface).values()]
        for part in content.parts
    ]
    plain = [[v.tolist() if isinstance(v, np.ndarray) else v for v in part] for part in parts]
    camera = content.camera and [content.camera.to_world.tolist(), content.camera.field_width]
    counts = [vars(count) for count in notebook.counts[path]]
    now = content.animation and [p.triangles.tolist() for p in content.animation.at(0.5).parts]
    return str([plain, content.lights, camera, notebook.notes(), counts, now])


def objects_of(tree, kind):
    """All objects of a kind below a tree, found by the key that holds them."""
    if kind == "glTF":
        return [tree]
    last, nested, waiting = kind.rpartition(".")[2], [], [("", tree)]
    while waiting:
        above, value = waiting.pop()
        items = value.items() if isinstance(value, dict) else enumerate(value)
        for key, each in items:
            name = above if isinstance(value, list) else key
            if isinstance(each, dict) and name == last:
                nested.append(each)
            if isinstance(each, (dict, list)):
                waiting.append((name, each))
    return nested


def others(value):
    """Other values in the place of one."""
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, (int, float)):
        return [value + 1, value / 2]
    if isinstance(value, str):
        return ["x"]
    if isinstance(value, list):
        return [value[:-1], value[::-1], ["x"]]
    return [{}]


def changed(tree, kind, key):
    """Copies of a tree where one object has another value under a key, or none."""
    for number, entry in enumerate(objects_of(tree, kind)):
        if key in entry:
            for value in [None, *others(entry[key])]:
                copied = copy.deepcopy(tree)
                target = objects_of(copied, kind)[number]
                if value is None:
                    del target[key]
                else:
                    target[key] = value
                yield copied


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = everything().write(tmp_path_factory.mktemp("schema"))
    return path, json.loads(path.read_text()), found(path)


@pytest.mark.parametrize("kind", SCHEMA)
def test_every_key_is_read_or_says_nothing(whole, kind):
    path, tree, before = whole
    assert before != "refused"
    for key in SCHEMA[kind].split():
        copies = list(changed(tree, kind, key))
        assert copies, f"{kind}.{key} is not in the file"
        differs = False
        for copied in copies:
            path.write_text(json.dumps(copied))
            differs |= found(path) != before
            if differs:
                break
        assert differs == (key not in SILENT.get(kind, ())), f"{kind}.{key}"


def test_the_manual_lists_the_extensions_with_their_notes():
    text = Path(__file__).parents[2].joinpath("docs/formats.md").read_text()
    text = text.partition("## glTF")[2]
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*) \|$", text, re.M))
    lost = {name: f"{kind}: {words}" for name, (kind, words) in extensions.LOST.items()}
    assert rows == {**dict.fromkeys(extensions.READ, "read"), **lost}
    silent = re.findall(r"`([\w.]+)`", text.partition("These keys say nothing")[2])
    assert set(silent) >= {f"{kind}.{key}" for kind, keys in SILENT.items() for key in keys}

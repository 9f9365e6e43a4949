"""glTF as the web has it: meshes compressed by Draco, textures in WebP, and KTX2, which is refused.

The files are made here, with the encoders of DracoPy and Pillow.
"""

import base64
import builtins
import io
import json
import struct

import numpy as np
import pytest
from PIL import Image
from test_gltf import packed

from lfcore.errors import SceneError
from lfcore.scene.build import build_scene
from lfcore.scene.meshes import load_mesh
from lfcore.scene.sources import files_of_scene

DracoPy = pytest.importorskip("DracoPy", reason="no wheel of it for this processor")
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
UVS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
DRACO, WEBP, BASIS = "KHR_draco_mesh_compression", "EXT_texture_webp", "KHR_texture_basisu"


def picture(form):
    stream = io.BytesIO()
    Image.new("RGB", (8, 8), (0, 255, 0)).save(stream, form, lossless=True)
    return stream.getvalue()


def draco(**changes):
    """The JSON of a compressed square with a texture, and its buffer."""
    packed = DracoPy.encode(POINTS, FACES, tex_coord=UVS.astype(float), preserve_order=True)
    ids = {each["attribute_type"]: each["unique_id"] for each in DracoPy.decode(packed).attributes}
    image = picture("PNG")
    data = packed + bytes(-len(packed) % 4) + image
    kinds = [("VEC3", 4, 5126), ("VEC2", 4, 5126), ("SCALAR", 6, 5123)]
    compressed = {
        "bufferView": 0,
        "attributes": {
            "POSITION": ids[DracoPy.AttributeType.POSITION],
            "TEXCOORD_0": ids[DracoPy.AttributeType.TEX_COORD],
        },
    }
    primitive = {
        "attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0,
        "extensions": {DRACO: compressed},
    }  # fmt: skip
    tree = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}],
        "accessors": [{"type": t, "count": n, "componentType": c} for t, n, c in kinds],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(packed)},
            {"buffer": 0, "byteOffset": len(data) - len(image), "byteLength": len(image)},
        ],
        "buffers": [{"byteLength": len(data)}],
        "images": [{"bufferView": 1, "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "extensionsUsed": [DRACO], "extensionsRequired": [DRACO],
    }  # fmt: skip
    return {**tree, **changes}, data


def written(folder, tree, data, how="glb"):
    if how == "glb":
        data += bytes(-len(data) % 4)
        path = folder / "m.glb"
        path.write_bytes(packed(tree, struct.pack("<II", len(data), 0x004E4942) + data))
        return path
    if how == "file":
        (folder / "m 1.bin").write_bytes(data)
        uri = "m%201.bin"
    else:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    path = folder / "m.gltf"
    path.write_text(json.dumps(tree | {"buffers": [{"byteLength": len(data), "uri": uri}]}))
    return path


@pytest.mark.parametrize("how", ["glb", "file", "data"])
def test_a_mesh_compressed_by_draco(tmp_path, how):
    path = written(tmp_path, *draco(), how)
    (part,) = load_mesh(path)
    np.testing.assert_allclose(part.triangles, POINTS[FACES], atol=1e-3)
    uvs = UVS[FACES] * (1, -1) + (0, 1)  # trimesh turns v round
    np.testing.assert_allclose(part.uvs, uvs, atol=1e-3)
    assert (part.surface.texture == (0, 255, 0)).all()
    scene = build_scene(path)
    assert scene.triangle_count == 2 and not scene.notes
    assert len(files_of_scene(path)) == (2 if how == "file" else 1)


def test_a_mesh_that_is_not_compressed_beside_one_that_is(tmp_path):
    tree, data = draco()
    plain = POINTS[FACES].reshape(-1, 3).tobytes()
    data += bytes(-len(data) % 4)
    tree["bufferViews"].append({"buffer": 0, "byteOffset": len(data), "byteLength": len(plain)})
    tree["accessors"].append(
        {"bufferView": 2, "type": "VEC3", "count": 6, "componentType": 5126, "min": [0, 0, 0],
         "max": [1, 1, 0.5]}
    )  # fmt: skip
    tree["meshes"].append({"primitives": [{"attributes": {"POSITION": 3}}]})
    tree["nodes"].append({"mesh": 1, "translation": [3, 0, 0]})
    tree["scenes"][0]["nodes"].append(1)
    parts = load_mesh(written(tmp_path, tree, data + plain))
    first, second = sorted(parts, key=lambda part: part.triangles.max())
    np.testing.assert_allclose(first.triangles, POINTS[FACES], atol=1e-3)
    np.testing.assert_allclose(second.triangles, POINTS[FACES] + (3, 0, 0))


DAMAGED = {
    "no draco": lambda tree: tree["bufferViews"][0].update(byteOffset=4),
    "cut off": lambda tree: tree["bufferViews"][0].update(byteLength=40),
    "beyond the buffer": lambda tree: tree["bufferViews"][0].update(byteLength=10**6),
    "no view": lambda tree: primitive_of(tree).update(bufferView=7),
    "no such attribute": lambda tree: primitive_of(tree)["attributes"].update(POSITION=9),
    "no accessor": lambda tree: tree["accessors"].clear(),
    "a word": lambda tree: primitive_of(tree).update(bufferView="first"),
    "no buffer": lambda tree: tree["buffers"].clear(),
}


def primitive_of(tree):
    return tree["meshes"][0]["primitives"][0]["extensions"][DRACO]


@pytest.mark.parametrize("change", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_mesh_is_one_line(tmp_path, change):
    tree, data = draco()
    change(tree)
    with pytest.raises(SceneError, match=r"m\.glb: mesh cannot be read") as caught:
        build_scene(written(tmp_path, tree, data))
    assert "\n" not in str(caught.value)


def test_without_the_decoder_its_package_is_named(tmp_path, monkeypatch):
    path, real = written(tmp_path, *draco()), builtins.__import__

    def without(name, *more, **options):
        if name == "DracoPy":
            raise ImportError(name)
        return real(name, *more, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(SceneError, match=r"Draco.*Install the package DracoPy"):
        build_scene(path)


def textured(texture, required, image="WEBP", mime="image/webp"):
    """The square without compression, with one texture."""
    pixels = picture(image) if image else b"\xabKTX 20\xbb" + bytes(80)
    parts = [POINTS.tobytes(), UVS.tobytes(), FACES.astype("<u2").tobytes(), pixels]
    data, views = b"", []
    for part in parts:
        data += bytes(-len(data) % 4)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(part)})
        data += part
    tree, _ = draco()
    del tree["meshes"][0]["primitives"][0]["extensions"]
    for number, accessor in enumerate(tree["accessors"]):
        accessor["bufferView"] = number
    return tree | {
        "bufferViews": views, "buffers": [{"byteLength": len(data)}],
        "images": [{"bufferView": 3, "mimeType": mime}], "textures": [texture],
        "extensionsUsed": [WEBP, BASIS], "extensionsRequired": required,
    }, data  # fmt: skip


@pytest.mark.parametrize("required", [[], [WEBP]])
def test_a_texture_in_webp(tmp_path, required):
    texture = {"extensions": {WEBP: {"source": 0}}}
    (part,) = load_mesh(written(tmp_path, *textured(texture, required)))
    assert (part.surface.texture == (0, 255, 0)).all()


@pytest.mark.parametrize("start", [0, 30])
@pytest.mark.parametrize("how", ["glb", "data"])
def test_a_damaged_texture_is_refused_not_ignored(tmp_path, start, how):
    tree, data = textured({"extensions": {WEBP: {"source": 0}}}, [])
    (view,) = tree["bufferViews"][3:]
    if how == "glb":
        first = view["byteOffset"] + start
        data = data[:first] + bytes(len(data) - first)
    else:
        text = base64.b64encode(picture("WEBP")[:start] + bytes(50)).decode()
        tree["images"] = [{"uri": f"data:image/webp;base64,{text}"}]
    with pytest.raises(SceneError, match=r"m\.glb: image 0 cannot be decoded"):
        build_scene(written(tmp_path, tree, data))


@pytest.mark.parametrize("required", [[], [BASIS]])
def test_a_texture_in_ktx2_is_refused_by_name(tmp_path, required):
    texture = {"extensions": {BASIS: {"source": 0}}}
    path = written(tmp_path, *textured(texture, required, None, "image/ktx2"))
    with pytest.raises(SceneError, match=r"m\.glb: .*KHR_texture_basisu.*PNG, JPEG or WebP"):
        build_scene(path)


def test_a_texture_in_ktx2_with_another_beside_it(tmp_path):
    texture = {"source": 0, "extensions": {BASIS: {"source": 5}}}
    path = written(tmp_path, *textured(texture, [], "PNG", "image/png"))
    assert (load_mesh(path)[0].surface.texture == (0, 255, 0)).all()

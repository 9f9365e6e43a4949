"""glTF as the web has it: meshes compressed by Draco, textures in WebP, and KTX2, which is refused.

The files are made here, with the encoders of DracoPy and Pillow.
"""

import base64
import io
import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from plain_scenes import load_mesh, refused

from lfcore import Slab
from lfcore.optics.bundles import macropixels
from lfcore.oracle.slab import all_pixels, trace
from lfcore.readers.load import load_scene
from lfcore.readers.sources import files_of_scene
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.specular import specular_triangles
from lfcore.tracing.tracer import Tracer

DracoPy = pytest.importorskip("DracoPy", reason="no wheel of it for this processor")
EXAMPLE = runpy.run_path(str(Path(__file__).parents[2] / "docs/examples/gltf_features.py"))
POINTS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], np.float32)
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
UVS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
GREEN = np.full((8, 8, 3), (0, 255, 0), np.uint8)
DRACO, WEBP, BASIS = "KHR_draco_mesh_compression", "EXT_texture_webp", "KHR_texture_basisu"


def draco():
    """A compressed square with a texture."""
    packed = DracoPy.encode(POINTS, FACES, tex_coord=UVS.astype(float), preserve_order=True)
    ids = {each["attribute_type"]: each["unique_id"] for each in DracoPy.decode(packed).attributes}
    kinds = [("VEC3", 4, 5126), ("VEC2", 4, 5126), ("SCALAR", 6, 5123)]
    glb = EXAMPLE["Glb"]()
    compressed = {
        "bufferView": glb.view(packed),
        "attributes": {
            "POSITION": ids[DracoPy.AttributeType.POSITION],
            "TEXCOORD_0": ids[DracoPy.AttributeType.TEX_COORD],
        },
    }
    position, uv, indices = (
        glb.add("accessors", type=kind, count=count, componentType=component)
        for kind, count, component in kinds
    )
    primitive = {
        "attributes": {"POSITION": position, "TEXCOORD_0": uv}, "indices": indices, "material": 0,
        "extensions": {DRACO: compressed},
    }  # fmt: skip
    glb.add("materials", pbrMetallicRoughness={"baseColorTexture": glb.texture(GREEN)})
    glb.add("nodes", mesh=glb.add("meshes", primitives=[primitive]))
    glb.tree |= {"extensionsUsed": [DRACO], "extensionsRequired": [DRACO]}
    return glb


def written(folder, glb, how="glb"):
    if how == "glb":
        glb.write(folder / "m.glb")
        return folder / "m.glb"
    if how == "file":
        (folder / "m 1.bin").write_bytes(glb.data)
        uri = "m%201.bin"
    else:
        uri = "data:application/octet-stream;base64," + base64.b64encode(glb.data).decode()
    nodes = list(range(len(glb.tree["nodes"])))
    buffers = [{"byteLength": len(glb.data), "uri": uri}]
    path = folder / "m.gltf"
    path.write_text(json.dumps(glb.tree | {"scenes": [{"nodes": nodes}], "buffers": buffers}))
    return path


@pytest.mark.parametrize("how", ["glb", "file", "data"])
def test_a_mesh_compressed_by_draco(tmp_path, how):
    path = written(tmp_path, draco(), how)
    (part,) = load_mesh(path)
    np.testing.assert_allclose(part.triangles, POINTS[FACES], atol=1e-3)
    uvs = UVS[FACES] * (1, -1) + (0, 1)  # trimesh turns v round
    np.testing.assert_allclose(part.uvs, uvs, atol=1e-3)
    assert (part.surface.texture == (0, 255, 0)).all()
    scene = load_scene(path, bare=True)
    assert scene.triangle_count == 2 and not scene.notes
    assert len(files_of_scene(path)) == (2 if how == "file" else 1)


def test_a_mesh_that_is_not_compressed_beside_one_that_is(tmp_path):
    glb = draco()
    shape = {"POSITION": POINTS, "TEXCOORD_0": UVS, "indices": FACES.ravel()}
    glb.mesh(shape, 0, translation=[3, 0, 0])
    parts = load_mesh(written(tmp_path, glb))
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
}


def primitive_of(tree):
    return tree["meshes"][0]["primitives"][0]["extensions"][DRACO]


@pytest.mark.parametrize("change", DAMAGED.values(), ids=DAMAGED.keys())
def test_a_damaged_mesh_is_one_line(tmp_path, change):
    glb = draco()
    change(glb.tree)
    refused(r"m\.glb: mesh cannot be read", load_scene, written(tmp_path, glb))


def test_a_buffer_that_is_not_there_is_named_itself(tmp_path):
    path = written(tmp_path, draco(), "file")
    (tmp_path / "m 1.bin").unlink()
    assert refused(None, load_mesh, path).file.name == "m 1.bin"


def test_without_the_decoder_its_package_is_named(tmp_path, monkeypatch):
    path = written(tmp_path, draco())
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    refused(r"Draco.*Install the package DracoPy", load_scene, path)


def textured(texture, required, form="WEBP"):
    """A square without compression, with one texture, at the end of the data."""
    stream, glb = io.BytesIO(), EXAMPLE["Glb"]()
    if form == "KTX2":
        stream.write(b"\xabKTX 20\xbb" + bytes(80))
    else:
        Image.fromarray(GREEN).save(stream, form, lossless=True)
    glb.mesh(EXAMPLE["square"](1, 1), 0)
    view = glb.view(stream.getvalue())
    glb.add("images", bufferView=view, mimeType=f"image/{form.lower()}")
    index = glb.add("textures", **texture)
    glb.add("materials", pbrMetallicRoughness={"baseColorTexture": {"index": index}})
    glb.tree |= {"extensionsUsed": [WEBP, BASIS], "extensionsRequired": required}
    return glb


@pytest.mark.parametrize(
    ("texture", "required", "form"),
    [
        ({"extensions": {WEBP: {"source": 0}}}, [], "WEBP"),
        ({"extensions": {WEBP: {"source": 0}}}, [WEBP], "WEBP"),
        ({"source": 0, "extensions": {BASIS: {"source": 5}}}, [], "PNG"),  # beside one in KTX2
    ],
)
def test_a_texture_in_webp_or_another(tmp_path, texture, required, form):
    (part,) = load_mesh(written(tmp_path, textured(texture, required, form)))
    assert (part.surface.texture == (0, 255, 0)).all()


@pytest.mark.parametrize("start", [0, 30])
@pytest.mark.parametrize("how", ["glb", "data"])
def test_a_damaged_texture_is_refused_not_ignored(tmp_path, start, how):
    glb = textured({"extensions": {WEBP: {"source": 0}}}, [])
    first = glb.tree["bufferViews"][-1]["byteOffset"]
    damaged = glb.data[first : first + start] + bytes(50)
    if how == "glb":
        glb.data = glb.data[:first] + damaged + bytes(len(glb.data))
    else:
        text = base64.b64encode(damaged).decode()
        glb.tree["images"] = [{"uri": f"data:image/webp;base64,{text}"}]
    refused(r"m\.glb: images\[0\]: .* cannot be decoded", load_scene, written(tmp_path, glb))


@pytest.mark.parametrize("required", [[], [BASIS]])
def test_a_texture_in_ktx2_is_refused_by_name(tmp_path, required):
    texture = {"extensions": {BASIS: {"source": 0}}}
    path = written(tmp_path, textured(texture, required, "KTX2"))
    refused(r"m\.glb: .*KHR_texture_basisu.*PNG, JPEG or WebP", load_scene, path)


SAID = {
    'assumed: its own camera; view_from="front" frames all of it',
    "assumed: it moves from 0 to 1 s, shown is the first instant; .at() has others",
    "left out: material 'bumps': baked shadows",
    "left out: reflections of emitting surfaces (lamp, sign) in glossy ones (bumps)",
}


@pytest.fixture(scope="module")
def features(tmp_path_factory):
    path = tmp_path_factory.mktemp("gltf") / "features.glb"
    EXAMPLE["main"]([str(path)])
    return load_scene(path, bare=True)


def test_everything_is_found_and_what_is_dropped_is_said(features):
    needs = Needs.of(features)
    assert needs.alpha_tests and needs.physical and needs.vertex_colours and needs.specular
    assert sorted(light.kind for light in features.lights) == [POINT, POINT, DIRECTIONAL]
    assert sum(light.is_spot for light in features.lights) == 1
    assert {f"{note.kind}: {note.what}" for note in features.notes} == SAID
    assert features.dropped == {}


@pytest.mark.slow
def test_it_looks_as_in_float64(features, device):
    """All but pixels at edges, and at highlights of a few of them.  Where rays go on, as at veils,
    tests/tracing/test_specular_paths.py looks."""
    slab = Slab(features.camera, 2, 12)
    pixels = all_pixels(slab)
    tracer = Tracer(features, build_bvh(features.triangles), device, mipmaps=False)
    found = tracer.bundle_radiance(macropixels(slab, pixels))
    expected = trace(features, slab, pixels).reshape(found.shape)
    triangle = tracer.slab_hits(slab, pixels)[0]
    ends = (triangle < 0) | ~specular_triangles(features)[triangle]
    difference = (np.abs(found - expected) / np.maximum(expected, 1)).max(-1)[ends]
    assert np.median(difference) < 1e-3 and (difference > 0.01).mean() < 0.01


def test_what_colours_of_vertices_lose_is_said(tmp_path):
    """Their alpha, where it would count, and all of them where a surface is unlit."""
    glb = EXAMPLE["Glb"]()
    faded = np.float32([[1, 0, 0, 1], [0, 1, 0, 0.5], [0, 0, 1, 1], [1, 1, 1, 1]])
    for entry in ({"name": "mist", "alphaMode": "BLEND"},
                  {"name": "sign", "extensions": {"KHR_materials_unlit": {}}},
                  {"name": "wall"}):  # fmt: skip
        glb.tree["materials"].append({**entry, "pbrMetallicRoughness": EXAMPLE["pbr"](0, 1)})
        shape = EXAMPLE["square"](1, 1) | {"COLOR_0": faded}
        glb.mesh(shape, len(glb.tree["materials"]) - 1)
    glb.write(tmp_path / "colours.glb")
    notes = load_scene(tmp_path / "colours.glb", bare=True).notes
    assert {note.what for note in notes if note.kind == "left out"} == {
        "material 'mist': alpha of vertices",
        "material 'sign': colours of vertices, which unlit surfaces do not take",
    }

"""glTF's arrays of every kind; the right values are those of the specification."""

import math

import numpy as np
import pytest
from gltf_files import CORNERS, FACES, UVS, File, square
from plain_scenes import load_mesh, refused

from lfcore.readers.meshes import read_mesh
from lfcore.scene.notes import Notebook

QUARTER = [0, 0, math.sqrt(0.5), math.sqrt(0.5)]
"""A quarter turn about z."""


def read(file, folder):
    notebook = Notebook()
    parts = load_mesh(file.write(folder), notebook=notebook)
    return parts, [note.what for note in notebook.notes()]


def corners(part):
    return part.triangles.reshape(-1, 3)[[0, 1, 2, 5]]


INTEGERS = [(np.uint8, 255), (np.uint16, 65535), (np.int8, 127), (np.int16, 32767)]


@pytest.mark.parametrize("stride", [None, 8, 12])
@pytest.mark.parametrize(("kind", "most"), INTEGERS)
def test_normalized_integers_of_every_attribute(tmp_path, kind, most, stride):
    file, unit = File(), np.clip(CORNERS / 2, 0, 1)

    def packed(values):
        codes = np.rint(np.asarray(values) * most).astype(kind)
        return file.accessor(codes, normalized=True, stride=stride)

    attributes = {"POSITION": packed(unit), "TEXCOORD_0": packed(UVS)}
    attributes["NORMAL"] = packed(np.tile([0, 0, 1], (4, 1)))
    attributes["COLOR_0"] = packed(np.tile([1, 0.5, 0], (4, 1)))
    file.node(file.primitive(**attributes), scale=[2, 2, 2])
    ((part,), notes) = read(file, tmp_path)
    np.testing.assert_allclose(corners(part), CORNERS, atol=2.1 / most)
    np.testing.assert_allclose(part.uvs[0], UVS[:3] * (1, -1) + (0, 1), atol=1.1 / most)
    np.testing.assert_allclose(part.normals[0] / 2, np.tile([0, 0, 2], (3, 1)), atol=1e-6)
    np.testing.assert_allclose(part.colours[0], np.tile([1, 0.5, 0], (3, 1)), atol=1.1 / most)
    assert notes == []


@pytest.mark.parametrize("kind", [np.uint8, np.int8, np.uint16, np.int16])
def test_quantized_integers_that_are_not_normalized(tmp_path, kind):
    file = square(POSITION=(CORNERS * 50).astype(kind))
    file.tree["nodes"][0]["scale"] = [0.02] * 3
    file.use("KHR_mesh_quantization")
    file.tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    ((part,), notes) = read(file, tmp_path)
    np.testing.assert_allclose(corners(part), CORNERS, atol=1e-6)
    assert notes == []


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.uint32])
def test_indices_of_every_kind_and_none(tmp_path, kind):
    ((part,), _) = read(square(indices=FACES.astype(kind)), tmp_path)
    np.testing.assert_array_equal(corners(part), CORNERS)
    ((part,), _) = read(square(POSITION=CORNERS[FACES], indices=None), tmp_path)
    np.testing.assert_array_equal(corners(part), CORNERS)


def sparse(file, accessor, changes):
    places, values = np.array(list(changes), np.uint8), np.array(list(changes.values()), np.float32)
    file.tree["accessors"][accessor]["sparse"] = {
        "count": len(changes), "values": {"bufferView": file.view(values.tobytes())},
        "indices": {"bufferView": file.view(places.tobytes()), "componentType": 5121},
    }  # fmt: skip


@pytest.mark.parametrize("name", ["POSITION", "TEXCOORD_0", "COLOR_0", "NORMAL"])
@pytest.mark.parametrize("base", [True, False])
def test_sparse_accessors(tmp_path, name, base):
    given = {"TEXCOORD_0": UVS, "COLOR_0": np.abs(CORNERS) / 2, "NORMAL": CORNERS + 1}
    right = given.get(name, CORNERS).astype(np.float32)
    file, wrong = File(), right.copy()
    wrong[2] = 9
    index = file.accessor(wrong)
    sparse(file, index, {2: right[2]} if base else dict(enumerate(right)))
    if not base:
        file.tree["accessors"][index].pop("bufferView")
    file.node(file.primitive(**{**given, name: index}))
    ((part,), notes) = read(file, tmp_path)
    expected = square(**{**given, name: right})
    ((same,), _) = read(expected, tmp_path)
    for array in ("triangles", "uvs", "colours", "normals"):
        np.testing.assert_array_equal(getattr(part, array), getattr(same, array))
    assert notes == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 5}, "accessor ends beyond"), ({"byteOffset": 4}, "accessor ends beyond"),
        ({"componentType": 7}, "known type"), ({"type": "VEC9"}, "known type"),
        ({"count": -1}, "accessor of -1"), ({"bufferView": 99}, r"bufferViews\[99\]"),
        ({"type": "VEC2"}, "POSITION has 2 numbers"), ({"count": 10**12}, "accessor of"),
        ({"byteOffset": -4}, "makes no sense"),
    ],
)  # fmt: skip
def test_accessors_that_make_no_sense_are_one_line(tmp_path, change, words):
    file = square()
    file.tree["accessors"][0].update(change)
    refused(rf"file\.gltf: .*{words}", load_mesh, file.write(tmp_path))


def test_morph_targets_count_with_their_weights_sparse_ones_too(tmp_path):
    file = File()
    up, aside = file.accessor(CORNERS * 0), file.accessor(np.tile(np.float32([1, 0, 0]), (4, 1)))
    sparse(file, up, {3: [0, 0, 4]})
    primitive = file.primitive()
    primitive["targets"] = [{"POSITION": up}, {"POSITION": aside}]
    file.node(primitive, mesh={"weights": [0.5, 0]})
    file.node(mesh=None)
    file.tree["nodes"][1] |= {"mesh": 0, "weights": [0, 2]}
    ((one, other), notes) = read(file, tmp_path)
    np.testing.assert_allclose(corners(one), CORNERS + ([[0, 0, 0]] * 3 + [[0, 0, 2]]))
    np.testing.assert_allclose(corners(other), CORNERS + (2, 0, 0))
    assert notes == ["1 of 2 morph targets"]


def test_a_skin_is_in_its_pose_and_its_node_s_own_place_is_ignored(tmp_path):
    file = File()
    joints = np.array([[0, 1, 0, 0]] * 4, np.uint8)
    weights = np.array([[255, 0, 0, 0], [255, 0, 0, 0], [0, 255, 0, 0], [51, 204, 0, 0]], np.uint8)
    weights = file.accessor(weights, normalized=True)
    normals = np.tile(np.float32([1, 0, 0]), (4, 1))
    file.node(file.primitive(JOINTS_0=joints, WEIGHTS_0=weights, NORMAL=normals),
              skin=0, translation=[70, 80, 90], scale=[5, 5, 5])  # fmt: skip
    first = file.node(root=False, translation=[10, 0, 0])
    second = file.node(root=False, rotation=QUARTER)
    file.node(children=[first, second], translation=[0, 0, 1])
    binds = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    binds[1, 3, :3] = [-1, 0, 0]  # by columns: the second joint is bound at x = 1
    file.add("skins", joints=[first, second], inverseBindMatrices=file.accessor(binds))
    ((part,), notes) = read(file, tmp_path)
    by_first = CORNERS + (10, 0, 1)
    by_second = np.stack([-CORNERS[:, 1], CORNERS[:, 0] - 1, CORNERS[:, 2] + 1], 1)
    mixed = 0.2 * by_first + 0.8 * by_second
    expected = [by_first[0], by_first[1], by_second[2], mixed[3]]
    np.testing.assert_allclose(corners(part), expected, atol=1e-6)
    normals = part.normals.reshape(-1, 3)[[0, 2]]
    np.testing.assert_allclose(normals, [[1, 0, 0], [0, 1, 0]], atol=1e-6)
    assert notes == []


def test_instances(tmp_path):
    file = square()
    places = {"TRANSLATION": np.float32([[1, 0, 0], [0, 5, 0]]),
              "ROTATION": np.array([[0, 0, 0, 32767], [0, 0, 23170, 23170]], np.int16),
              "SCALE": np.float32([[1, 1, 1], [2, 2, 2]]), "_ID": np.float32([1, 2])}  # fmt: skip
    attributes = {
        name: file.accessor(values, normalized=name == "ROTATION")
        for name, values in places.items()
    }
    instancing = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    file.tree["nodes"][0] |= {"extensions": instancing, "translation": [0, 0, 7]}
    file.use("EXT_mesh_gpu_instancing")
    ((part,), notes) = read(file, tmp_path)
    turned = np.stack([-CORNERS[:, 1], CORNERS[:, 0], CORNERS[:, 2]], 1)
    expected = np.concatenate([(CORNERS + (1, 0, 7))[FACES], (2 * turned + (0, 5, 7))[FACES]])
    np.testing.assert_allclose(part.triangles.reshape(-1, 3), expected, atol=1e-4)
    assert notes == []


@pytest.mark.parametrize("name", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_buffers_packed_by_meshoptimizer(tmp_path, name):
    meshopt = pytest.importorskip("meshopt", reason="no wheel of it for this processor")
    file = File()
    codes = np.zeros((4, 4), np.uint16)  # rows of 8 bytes, as gltfpack pads them
    codes[:, :3] = CORNERS * 1000

    def packed(array, mode, stride, **more):
        data = meshopt.encode_gltf_buffer(array, mode)
        view = file.view(data)
        where = file.tree["bufferViews"][view]
        given = {**where, "count": len(array), "byteStride": stride, "mode": mode, **more}
        size = {"byteOffset": 0, "byteLength": len(array) * stride}
        file.tree["bufferViews"][view] = {"buffer": 1, **size, "extensions": {name: given}}
        return view

    position = file.add("accessors", bufferView=packed(codes, "ATTRIBUTES", 8), count=4,
                        componentType=5123, type="VEC3")  # fmt: skip
    indices = file.add("accessors", bufferView=packed(FACES.astype(np.uint32), "TRIANGLES", 2),
                       count=6, componentType=5123, type="SCALAR")  # fmt: skip
    packed_normals = meshopt.encode_filter_oct(np.float32([[0, 0, 1, 1]] * 4), 4, 8)
    view = packed(packed_normals, "ATTRIBUTES", 4, filter="OCTAHEDRAL")
    normal = file.add("accessors", bufferView=view, count=4, componentType=5120, type="VEC3",
                      normalized=True)  # fmt: skip
    file.node(file.primitive(POSITION=position, NORMAL=normal, indices=indices), scale=[0.001] * 3)
    file.use(name, "KHR_mesh_quantization")
    file.tree["extensionsRequired"] = [name]
    path = file.write(tmp_path)
    ((part,), notes) = load_mesh(path), []
    triangles = np.sort(part.triangles.reshape(-1, 3), axis=0)
    np.testing.assert_allclose(triangles, np.sort(CORNERS[FACES], axis=0), atol=1e-6)
    np.testing.assert_allclose(part.normals[0, 0] / 1e-6, [0, 0, 1], atol=0.01)
    assert notes == []
    file.tree["bufferViews"][1]["extensions"][name]["byteLength"] = 3
    refused("a packed buffer is damaged", load_mesh, file.write(tmp_path))


@pytest.mark.parametrize(("mode", "order"), [(5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
def test_strips_and_fans(tmp_path, mode, order):
    file = square(indices=np.array(order, np.uint8))
    file.tree["meshes"][0]["primitives"][0]["mode"] = mode
    ((part,), notes) = read(file, tmp_path)
    area = np.cross(*np.diff(part.triangles, axis=1).swapaxes(0, 1))
    assert area[:, 2].sum() == 4 and (area[:, 2] > 0).all() and notes == []


def test_nodes_that_are_shown(tmp_path):
    """Children once, hidden ones never, and those of another scene are noted."""
    file = square()
    child = file.node(root=False, translation=[0, 0, 1])
    hidden = file.node(root=False)
    file.node(children=[child, hidden], translation=[0, 3, 0])
    file.tree["nodes"][child]["mesh"] = file.tree["nodes"][hidden]["mesh"] = 0
    file.tree["nodes"][hidden]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    file.use("KHR_node_visibility")
    (parts, notes) = read(file, tmp_path)
    assert [part.triangles[0, 0].tolist() for part in parts] == [[0, 0, 0], [0, 3, 1]]
    assert notes == []
    del file.tree["scenes"], file.tree["scene"]
    assert len(read(file, tmp_path)[0]) == 2
    file.tree |= {"scenes": [{"nodes": [0]}, {"nodes": [3]}], "scene": 1}
    (parts, notes) = read(file, tmp_path)
    assert len(parts) == 1 and notes == ["1 of 2 scenes"]


def test_a_mesh_without_normals_is_flat_and_with_them_smooth(tmp_path):
    assert load_mesh(square().write(tmp_path))[0].normals is None
    bent = square(NORMAL=CORNERS + np.float32([0, 0, 1])).write(tmp_path)
    assert load_mesh(bent)[0].surface.curved
    assert load_mesh(bent, shading="flat")[0].normals is None


def test_the_account(tmp_path):
    file = square(TEXCOORD_0=UVS, COLOR_1=np.abs(CORNERS))
    file.add("meshes", primitives=[])
    notebook = Notebook()
    path = file.write(tmp_path)
    read_mesh(path, notebook=notebook)
    counts = {one.what: (one.held, one.used) for one in notebook.counts[path]}
    assert counts == {
        "scenes": (1, 1), "primitives": (1, 1), "attributes POSITION": (1, 1),
        "attributes TEXCOORD_0": (1, 1), "attributes COLOR_1": (1, 0), "meshes": (2, 1),
    }  # fmt: skip

"""PLY, OFF and STL: elements of every type, colours under every name, text and binary."""

import itertools
import struct

import numpy as np
import pytest
from PIL import Image
from plain_scenes import load_mesh, refused

from lfcore.colour import srgb_decode
from lfcore.scene.notes import Notebook

POINTS = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 2, 0)], float)
FACES = [[0, 1, 2, 3], [3, 2, 4]]
COLOURS = np.array([(255, 0, 0), (0, 128, 0), (64, 0, 9), (1, 2, 3), (200, 100, 50)])
CODES = {
    "char": "b", "uchar": "B", "short": "h", "ushort": "H", "int": "i", "uint": "I", "float": "f",
    "double": "d", "uint8": "B", "int32": "i", "float32": "f",
}  # fmt: skip


def ply(kind, vertex, face, rows, faces, more=""):
    """A PLY file: properties as (type, name) or (count type, type, name) for lists."""
    lines = ["ply", f"format {kind} 1.0", *more.splitlines(), f"element vertex {len(rows)}"]
    lines += [f"property {' '.join(p)}" for p in vertex]
    lines += [f"element face {len(faces)}"]
    lines += [f"property {'list ' if len(p) == 3 else ''}{' '.join(p)}" for p in face]
    body = b"" if kind != "ascii" else []
    order = ">" if "big" in kind else "<"
    for properties, values in [*((vertex, row) for row in rows), *((face, row) for row in faces)]:
        flat, code = [], order
        for p, value in zip(properties, values, strict=True):
            if len(p) == 3:
                flat += [len(value), *value]
                code += CODES[p[0]] + CODES[p[1]] * len(value)
            else:
                flat.append(value)
                code += CODES[p[0]]
        body += [" ".join(map(str, flat))] if kind == "ascii" else struct.pack(code, *flat)
    head = "\n".join([*lines, "end_header", ""]).encode()
    return head + ("\n".join(body) + "\n").encode() if kind == "ascii" else head + body


def read(path, data):
    path.write_bytes(data)
    notebook = Notebook()
    parts = load_mesh(path, notebook=notebook, shading="flat")
    return parts, [str(note) for note in notebook.notes()]


XYZ = [("float", axis) for axis in "xyz"]
INDEX = ("uchar", "int", "vertex_indices")
KINDS = ["ascii", "binary_little_endian", "binary_big_endian"]
EXPECTED = [0, 1, 2, 0, 2, 3, 3, 2, 4]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("type", "names", "scale"),
    [("uchar", "red green blue", 1), ("ushort", "red green blue", 257), ("float", "r g b", 1 / 255),
     ("uint", "diffuse_red diffuse_green diffuse_blue", 1), ("double", "red green blue", 1)],
)  # fmt: skip
@pytest.mark.parametrize("of_faces", [False, True])
def test_colours_of_vertices_and_faces(tmp_path, kind, type, names, scale, of_faces):
    """Of any type, with texture coordinates beside them, on quads and triangles."""
    colours = (COLOURS * scale).tolist() if type in ("float", "double") else COLOURS * round(scale)
    named = [(type, name) for name in names.split()]
    vertex = [*XYZ, ("float", "s"), ("float", "t"), *(() if of_faces else named)]
    face = [INDEX, *(named if of_faces else ())]
    rows = [
        [*p, p[0], p[1], *(() if of_faces else c)] for p, c in zip(POINTS, colours, strict=True)
    ]
    faces = [[f, *(c if of_faces else ())] for f, c in zip(FACES, colours, strict=False)]
    (part,), notes = read(tmp_path / "a.ply", ply(kind, vertex, face, rows, faces))
    linear = srgb_decode(COLOURS / 255)
    expected = linear[[0, 0, 0, 0, 0, 0, 1, 1, 1] if of_faces else EXPECTED].reshape(3, 3, 3)
    np.testing.assert_allclose(part.colours, expected, atol=1e-6)
    np.testing.assert_array_equal(part.triangles.reshape(-1, 3), POINTS[EXPECTED])
    np.testing.assert_array_equal(part.uvs, part.triangles[..., :2])
    assert not notes and part.surface.diffuse == (1, 1, 1)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_not_used_is_named(tmp_path, kind):
    vertex = [*XYZ, ("float", "quality"), ("uchar", "alpha")]
    face = [INDEX, ("int", "flags")]
    rows = [[*p, 0.5, k] for k, p in enumerate(POINTS)]
    data = ply(kind, vertex, face, rows, [[f, 0] for f in FACES])
    extra = b"1 2 3" if kind == "ascii" else b"123"
    data = data.replace(b"end_header", b"element camera 1\nproperty float fov\nend_header")
    data += (b"45\n" if kind == "ascii" else b"\0" * 4) + extra
    _, notes = read(tmp_path / "a.ply", data)
    said = " ".join(notes)
    for words in ("vertex.quality", "vertex.alpha", "face.flags", "elements 'camera'", "3 "):
        assert words in said


def test_a_row_is_a_line(tmp_path):
    """Numbers that no property has are left out, and noted; rows may run over several lines."""
    data = ply("ascii", XYZ, [INDEX], POINTS, [[f] for f in FACES])
    head, body = data.split(b"end_header\n")
    lines = body.splitlines()
    for k in range(2):  # all rows alike, then of several lengths
        more = [line + b" 7 7" for line in lines[5:]]
        more[1] += k * b" 7"
        (part,), notes = read(
            tmp_path / "a.ply", head + b"end_header\n\n" + b"\n".join(lines[:5] + more)
        )
        np.testing.assert_array_equal(part.triangles.reshape(-1, 3), POINTS[EXPECTED])
        assert f"{4 + k} numbers that belong to no element" in notes[0]
    (part,), notes = read(tmp_path / "a.ply", head + b"end_header\n" + body.replace(b" ", b"\n"))
    np.testing.assert_array_equal(part.triangles.reshape(-1, 3), POINTS[EXPECTED])
    assert not notes


def test_textures_of_wedges(tmp_path):
    """MeshLab's: coordinates per corner, and the number of a texture per face."""
    for k in range(2):
        Image.new("RGB", (2, 2), (9 * k, 5, 5)).save(tmp_path / f"t{k}.png")
    face = [INDEX, ("uchar", "float", "texcoord"), ("int", "texnumber")]
    faces = [[f, list(itertools.chain(*((v / 8, 1) for v in f))), k] for k, f in enumerate(FACES)]
    more = "comment TextureFile t0.png\ncomment TextureFile t1.png"
    data = ply("binary_little_endian", XYZ, face, POINTS, faces, more)
    parts, notes = read(tmp_path / "a.ply", data)
    assert [part.count for part in parts] == [2, 1] and not notes
    for k, part in enumerate(parts):
        assert (part.surface.texture[..., 0] == 9 * k).all()
    np.testing.assert_allclose(parts[1].uvs[..., 0], [[3 / 8, 2 / 8, 4 / 8]])
    (tmp_path / "t1.png").unlink()
    assert "texture 't1.png', not found" in read(tmp_path / "a.ply", data)[1][0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_ply_that_is_damaged_is_refused(tmp_path, kind):
    data = ply(kind, XYZ, [INDEX], POINTS, [[f] for f in FACES])
    for wrong in (
        data[:-3], data.replace(b"element face 2", b"element face 3"), data[:40],
        data.replace(b"property float x", b"property float q"),
        data.replace(b"element vertex 5", b"element vertex 999999999999"),
        ply(kind, XYZ, [INDEX], POINTS, [[[0, 1, 9]]]), data.replace(b"float z", b"folat z"),
    ):  # fmt: skip
        refused("a.ply: mesh cannot be read", read, tmp_path / "a.ply", wrong)


def off(head, vertices, faces):
    lines = [head, "# a comment", f"{len(vertices)} {len(faces)} 0", ""]
    return "\n".join(lines + [" ".join(map(str, row)) for row in [*vertices, *faces]]).encode()


def test_off_colours_normals_and_coordinates(tmp_path):
    rows = [[*p, 0, 0, 1, *c, 255, 0.25, 0.5] for p, c in zip(POINTS, COLOURS, strict=True)]
    (part,), notes = read(tmp_path / "a.off", off("STCNOFF", rows, [[len(f), *f] for f in FACES]))
    expected = srgb_decode(COLOURS / 255)[EXPECTED].reshape(3, 3, 3)
    np.testing.assert_allclose(part.colours, expected)
    assert (part.uvs == [0.25, 0.5]).all() and not notes
    faces = [[4, *FACES[0], 1.0, 0.5, 0], [3, *FACES[1]]]
    (part,), _ = read(tmp_path / "a.off", off("OFF", POINTS, faces))
    np.testing.assert_allclose(part.colours[0, 0], srgb_decode(np.array([1, 0.5, 0])))
    assert (part.colours[2] == 1).all()
    (part,), notes = read(tmp_path / "a.off", off("OFF", POINTS, [[3, 0, 1, 2, 7]]) + b"\n9 9\n")
    assert part.colours is None and len(notes) == 2  # an index of a colour, a line more
    for wrong in (off("4OFF", POINTS, faces), off("OFF", POINTS, [[3, 0, 1]]), b"OFF\n",
                  off("OFF", POINTS, [[3, 0, 1, 9]]), off("OFF", [[1, 2]], [])):  # fmt: skip
        refused("a.off", read, tmp_path / "a.off", wrong)


TRIANGLES = POINTS[np.array(EXPECTED)].reshape(3, 3, 3).astype("<f4")


def stl(head=b"", colours=(0, 0, 0), end=b""):
    body = b"".join(
        bytes(12) + corners.tobytes() + struct.pack("<H", colour)
        for corners, colour in zip(TRIANGLES, colours, strict=True)
    )
    return head.ljust(80, b"\0") + struct.pack("<I", 3) + body + end


@pytest.mark.parametrize("head", [b"", b"solid of an exporter"])
@pytest.mark.parametrize("end", [b"", bytes(7), b"more data"])
def test_a_binary_stl_may_be_padded(tmp_path, head, end):
    (part,), notes = read(tmp_path / "a.stl", stl(head, end=end))
    np.testing.assert_array_equal(part.triangles, TRIANGLES)
    assert bool(notes) == (end == b"more data") and part.colours is None


def test_colours_of_stl(tmp_path):
    red, blue = 31 << 10, 31
    (part,), _ = read(tmp_path / "a.stl", stl(colours=(red | 1 << 15, blue | 1 << 15, 0)))
    np.testing.assert_array_equal(part.colours[:, 0], [(1, 0, 0), (0, 0, 1), (1, 1, 1)])
    magics = stl(b"COLOR=" + bytes((0, 255, 0, 255)), (red, blue, 1 << 15))
    (part,), _ = read(tmp_path / "a.stl", magics)
    np.testing.assert_array_equal(part.colours[:, 0], [(0, 0, 1), (1, 0, 0), (0, 1, 0)])
    assert "spare" in read(tmp_path / "a.stl", stl(colours=(7, 7, 7)))[1][0]


@pytest.mark.parametrize("change", [str, str.upper, lambda text: text.replace("\n", "\r\n")])
def test_an_stl_in_text(tmp_path, change):
    lines = ["solid a b c"]
    for corners in TRIANGLES:
        lines += ["  facet normal 0 0 1", "\touter loop"]
        lines += [f"    vertex {x:e} {y:e} {z:e}" for x, y, z in corners]
        lines += ["  endloop", "endfacet"]
    text = change("\n".join([*lines, "endsolid a b c"]))
    (part,), notes = read(tmp_path / "a.stl", text.encode())
    np.testing.assert_array_equal(part.triangles, TRIANGLES)
    assert not notes
    for wrong in (stl()[:-1], b"solid nothing\nendsolid", text.encode()[: len(text) // 2]):
        refused("a.stl", read, tmp_path / "a.stl", wrong)

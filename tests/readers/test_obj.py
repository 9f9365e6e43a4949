"""OBJ and MTL: every statement is used or noted; what is written is what is read."""

import numpy as np
import pytest
from PIL import Image
from plain_scenes import load_mesh, refused

from lfcore.colour import srgb_decode
from lfcore.readers.load import load_scene
from lfcore.scene.notes import Notebook
from lfcore.scene.surface_mesh import area_vectors

CORNERS = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
QUAD = CORNERS + "f 1/1 2/2 3/3 4/4\n"
OBJ = "mtllib o.mtl\nusemtl m\n" + QUAD
PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [9, 99, 199]]], np.uint8)


@pytest.fixture
def read(tmp_path):
    """Parts and notes of an OBJ and its MTL, beside a texture t.png."""
    Image.fromarray(PIXELS).save(tmp_path / "t.png")

    def read(obj=OBJ, mtl="newmtl m\nKd 1 1 1\n", name="o.mtl"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(mtl.encode())
        (tmp_path / "o.obj").write_bytes(obj.encode())
        notebook = Notebook()
        parts = load_mesh(tmp_path / "o.obj", notebook=notebook)
        return parts, [str(note) for note in notebook.notes()]

    read.folder = tmp_path
    return read


def test_text_of_two_bytes(read):
    _, _ = read()
    for kind in ("utf-16-le", "utf-16-be"):
        (read.folder / "o.obj").write_bytes(("\ufeff" + QUAD).encode(kind))
        assert load_mesh(read.folder / "o.obj")[0].count == 2


def area(parts):
    return sum(np.linalg.norm(area_vectors(part.triangles), axis=1).sum() / 2 for part in parts)


@pytest.mark.parametrize(
    "text",
    [
        QUAD.replace(" ", "\t"), QUAD.replace("\n", "\r\n"), QUAD.replace("\n", "\r"),
        "".join(f"   {line}\n" for line in QUAD.splitlines()),
        QUAD.replace("f 1/1 2/2", "f 1/1 \\\n 2/2"), "\ufeff" + QUAD, QUAD.rstrip("\n"),
        QUAD.replace("f 1/1 2/2 3/3 4/4", "f 1/1/ 2/2/ 3/3/ 4/4/"), QUAD + "# the end",
        QUAD.replace("f 1/1 2/2 3/3 4/4", "f -4/-4 -3/-3 -2/-2 -1/-1 # all"),
        QUAD.replace("f 1/1 2/2 3/3 4/4", "f\t1/1 2/2 3/3\nf  1/1 3/3 4/4"),
    ],
)  # fmt: skip
def test_a_quad_in_any_writing(read, text):
    (part,), notes = read(text)
    assert not notes and part.count == 2
    np.testing.assert_array_equal(part.uvs, part.triangles[..., :2] / 2 + 0.5)


def test_corners_of_several_kinds_in_one_file(read):
    text = CORNERS + "vn 0 0 1\nf 1 2 3\nf 1//1 3//1 4//1\nf 1/1/1 2/2/1 3/3/1\nf 2/2 3/3 4/4\n"
    (part,), _ = read(text)
    assert part.count == 4
    np.testing.assert_array_equal(part.uvs[:2], np.zeros((2, 3, 2)))
    np.testing.assert_array_equal(part.uvs[2:], part.triangles[2:, :, :2] / 2 + 0.5)


def test_indices_count_back_from_their_line(read):
    """In blocks, each with its own vertices."""
    text = "".join(
        f"v {x} 0 0\nv {x + 1} 0 0\nv {x + 1} 1 0\nvt {x} 5\nf -3/-1 -2/-1 -1/-1\n"
        for x in range(5)
    )
    (part,), _ = read(text)
    np.testing.assert_array_equal(part.triangles[:, 0, 0], np.arange(5))
    np.testing.assert_array_equal(part.uvs[:, :, 0], np.repeat(np.arange(5)[:, None], 3, 1))
    for wrong in ("f -16 -2 -1\n", "f 1 2 16\n", "f 0 1 2\n", "f 1 2 x\n", "f 1/1/1/1 2 3\n"):
        refused("o.obj: mesh cannot be read", read, text + wrong)


def test_texture_coordinates_and_normals_that_are_not_there_are_noted(read):
    (part,), notes = read(CORNERS + "f 1/1/1 2/2/1 3/9/1\n")
    assert part.count == 1 and part.normals is None and (part.uvs[0, 2] == 0).all()
    assert len(notes) == 2 and all("that the file lacks" in note for note in notes)


STAR = np.array([(np.cos(t), np.sin(t)) for t in np.arange(10) * np.pi / 5])
STAR[1::2] *= 0.4
TEETH = [(5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
COMB = np.array([(0, 0), (5, 0), *TEETH])
HOLE = np.array([(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)])
SHAPES = {
    "star": STAR,
    "comb": COMB,
    "hole": HOLE,
    "dart": np.array([(0, 0), (2, 1), (4, 0), (2, 5)]),
}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("turned", [False, True])
def test_polygons_of_any_shape(read, name, turned):
    """Their area is theirs from whatever corner they begin, and triangles are wound as they are."""
    shape = SHAPES[name].astype(float)
    x, y = shape.T
    expected = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
    shape = shape[::-1] if turned else shape
    for first in range(len(shape)):
        points = np.roll(shape, first, axis=0)
        lines = "".join(f"v {a} {0.3 * a - b} {b}\n" for a, b in points)  # on a slanting plane
        parts, notes = read(lines + "f " + " ".join(map(str, range(1, len(points) + 1))) + "\n")
        normals = area_vectors(parts[0].triangles)
        assert not notes and (normals @ normals.sum(0) > -1e-9).all()
        assert abs(normals.sum(0)[1]) / 2 == pytest.approx(expected)
        assert area(parts) == pytest.approx(np.linalg.norm(normals.sum(0)) / 2)


def test_a_polygon_that_crosses_itself_is_noted(read):
    bow = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 3 0\nv -1 1 0\nf 1 2 3 4 5\n"
    _, notes = read(bow)
    assert "1 faces that cross themselves" in notes[0]


def test_colours_of_vertices_stay_beside_materials(read):
    for most in (1, 255):
        colours = [[0.2 * most, 0.4 * most, 0.6 * most]] * 2
        lines = CORNERS.split("\n")
        for k in range(2):
            lines[k] += " " + " ".join(map(str, colours[k]))
        (part,), _ = read("mtllib o.mtl\nusemtl m\n" + "\n".join(lines) + "f 1/1 2/2 3/3\n")
        expected = [*srgb_decode(np.array(colours) / most), np.ones(3)]
        np.testing.assert_allclose(part.colours, [expected])
        (part,), _ = read("\n".join(lines) + "f 1 2 3\n")
        assert part.surface.diffuse == (1, 1, 1)  # no grey below them


def test_names_of_libraries_and_materials(read):
    Image.fromarray(PIXELS).save(read.folder / "my wood.png")
    mtl = "\ufeffnewmtl my wood \r\nKd 1 1 1\r\n  map_Kd\tmy wood.png\r\n"
    obj = "mtllib none.mtl my lib.mtl\nusemtl my wood\n" + QUAD
    (part,), notes = read(obj, mtl, "my lib.mtl")
    np.testing.assert_array_equal(part.surface.texture, PIXELS)
    assert len(notes) == 1 and "'none.mtl', not found" in notes[0]
    _, notes = read("mtllib my lib.mtl\nusemtl other\n" + QUAD)
    assert "material 'other', in no library" in notes[0]


def test_textures_are_beside_their_library(read):
    (read.folder / "sub").mkdir()
    Image.fromarray(PIXELS[::-1].copy()).save(read.folder / "sub" / "t.png")
    for name in ("t.png", "C:\\\\work\\\\t.png", ".\\t.png", '"t.png"'):
        mtl = f"newmtl m\nKd 1 1 1\nmap_Kd {name}\n"
        (part,), _ = read(OBJ.replace("o.mtl", "sub/o.mtl"), mtl, "sub/o.mtl")
        np.testing.assert_array_equal(part.surface.texture, PIXELS[::-1])


@pytest.mark.parametrize(
    ("options", "scale", "offset", "noted"),
    [
        ("-s 2 3 1 -o .5 .25 0", (2, 3), (0.5, 0.25), ""), ("-s 2", (2, 1), (0, 0), ""),
        ("-blendu off -texres 512 -boost 1 -cc off", (1, 1), (0, 0), ""),
        ("-clamp on", (1, 1), (0, 0), "clamped"), ("-mm 0.1 0.5", (1, 1), (0, 0), "range"),
        ("-t 1 1 1", (1, 1), (0, 0), "turbulence"), ("-imfchan r", (1, 1), (0, 0), "channel"),
    ],
)  # fmt: skip
def test_options_of_maps(read, options, scale, offset, noted):
    (part,), notes = read(mtl=f"newmtl m\nKd 1 1 1\nmap_Kd {options} t.png\n")
    np.testing.assert_array_equal(part.surface.texture, PIXELS)
    plain = part.triangles[..., :2] / 2 + 0.5
    np.testing.assert_allclose(part.uvs, plain * scale + offset)
    assert noted in " ".join(notes) and bool(noted) == bool(notes)


def alpha_picture(folder):
    rgba = np.dstack([PIXELS, np.array([[0, 255], [255, 255]], np.uint8)])
    Image.fromarray(rgba).save(folder / "cut.png")
    Image.fromarray(rgba[..., 3]).save(folder / "grey.png")


@pytest.mark.parametrize(
    "name", ["cut.png", "grey.png", "-imfchan m cut.png", "-imfchan l grey.png"]
)
@pytest.mark.parametrize("base", ["", "map_Kd t.png\n"])
def test_holes_by_map_d(read, name, base):
    alpha_picture(read.folder)
    (part,), notes = read(mtl=f"newmtl m\nKd 1 1 1\n{base}map_d {name}\n")
    surface = part.surface
    np.testing.assert_array_equal(surface.texture[..., 3], [[0, 255], [255, 255]])
    assert (surface.texture[..., :3] == (PIXELS if base else 255)).all()
    assert surface.alpha_cutoff == 0.5 and not notes


@pytest.mark.parametrize(
    ("lines", "opacity", "noted"),
    [("d 1", 1, False), ("Tr 0", 1, False), ("d 0.7", 0.7, False), ("Tr 0.25", 0.75, False),
     ("Tr 1", 1, True), ("d -halo 0.4", 0.4, False)],
)  # fmt: skip
def test_opacity(read, lines, opacity, noted):
    (part,), notes = read(mtl=f"newmtl m\nKd 1 1 1\n{lines}\n")
    assert bool(notes) == noted and part.surface.opacity == opacity
    (gone,), notes = read(mtl="newmtl m\nd 0\n")
    assert gone.surface.texture[..., 3].max() == 0 and "cut out wholly" in notes[0]


@pytest.mark.parametrize(
    ("lines", "fields"),
    [("d 0.3", {"opacity": 0.3}), ("Tr 0.25", {"opacity": 0.75}),
     ("d 0.25\nNi 1.25\nillum 6\nTf 1 0.5 0", {"transmission": 0.75, "ior": 1.25,
                                               "diffuse": (1, 0.625, 0.25)}),
     ("Pc 0.5\nPcr 0.25", {"clearcoat": 0.5, "clearcoat_roughness": 0.25}),
     ("d 0.5\nmap_d grey.png", {"opacity": 0.5, "alpha_blend": True}),
     ("map_d grey.png", {"opacity": 1, "alpha_blend": False, "alpha_cutoff": 0.5})],
)  # fmt: skip
def test_veils_glass_and_coats(read, lines, fields):
    alpha_picture(read.folder)
    (part,), notes = read(mtl=f"newmtl m\nKd 1 1 1\n{lines}\n")
    for name, value in fields.items():
        assert getattr(part.surface, name) == value
    assert not notes


def test_alpha_that_nothing_asks_for_is_noted(read):
    alpha_picture(read.folder)
    (part,), notes = read(mtl="newmtl m\nmap_Kd cut.png\n")
    assert part.surface.texture.shape == (2, 2, 3) and "no map_d asks for" in notes[0]


def test_emission_and_metal(read):
    (part,), notes = read(mtl="newmtl m\nKd 0 0 0\nKe 5 5 5\nmap_Ke t.png\nPm 1\nPr .25\n")
    assert part.surface.emission == (5, 5, 5) and not notes
    np.testing.assert_array_equal(part.surface.emission_texture, PIXELS)
    assert (part.surface.metallic, part.surface.roughness) == (1, 0.25)


def test_what_cannot_be_kept_apart_is_noted(read):
    _, notes = read(mtl="newmtl m\nKs 1 1 1\nmap_Kd -s 2 2 t.png\nmap_Ke t.png\n")
    assert "no exponent Ns" in notes[0] and "all as the first" in notes[1]
    _, notes = read(mtl="newmtl m\nKs 1 1 1\nNs 9\nPm 1\n")
    assert {"statements 'Ks'", "statements 'Ns'"} <= {note[-15:] for note in notes}


def test_grey_of_16_bits(read):
    grey = np.array([[20, 90], [160, 230]], np.uint16) * 257
    Image.fromarray(grey).save(read.folder / "g.png")
    (part,), _ = read(mtl="newmtl m\nmap_Kd g.png\n")
    np.testing.assert_array_equal(part.surface.texture[..., 1], grey // 257)


# What a statement may hold, by the formats' specifications and their extensions.
OF_MTL = {
    **dict.fromkeys("Ka Kd Ks Ke Tf".split(), "0.2 0.3 0.4"),
    **dict.fromkeys("Ns Ni d Tr Pr Pm Ps Pc Pcr aniso anisor sharpness".split(), "0.5"),
    **dict.fromkeys(
        "map_Ka map_Kd map_Ks map_Ke map_Ns map_d map_Tr map_bump bump disp decal refl norm map_Pr "
        "map_Pm map_Ps map_RMA map_opacity".split(), "t.png",
    ), "illum": "7", "map_aat": "on", "invented": "1",
}  # fmt: skip


@pytest.mark.parametrize("word", OF_MTL)
def test_every_statement_of_mtl_is_used_or_noted(read, word):
    lines = f"newmtl m\nNs 10\n{word} {OF_MTL[word]}\n"
    (read.folder / "o.mtl").write_text(lines)
    (read.folder / "o.obj").write_text(OBJ)
    scene = load_scene(read.folder / "o.obj", bare=True)
    counts = {count.what: count for count in scene.account}
    count = counts[f"statements '{word}'"]
    assert count.held and (count.used or f"statements '{word}'" in scene.summary())


OF_OBJ = {
    "v": "0 0 0", "vt": "0 0", "vn": "0 0 1", "vp": "0 0 1", "cstype": "bezier", "deg": "1 1",
    "bmat": "u 1", "step": "1", "p": "1", "l": "1 2", "f": "1 2 3", "curv": "0 1 1 2",
    "curv2": "1 2", "surf": "0 1 0 1 1", "parm": "u 0 1", "trim": "0 1 1", "hole": "0 1 1",
    "scrv": "0 1 1", "sp": "1", "end": "", "con": "1 0 1 1 2 0 1 1", "g": "a b", "s": "1",
    "mg": "1 1", "o": "name", "bevel": "on", "c_interp": "on", "d_interp": "on", "lod": "1",
    "usemtl": "m", "mtllib": "o.mtl", "usemap": "a", "maplib": "b", "shadow_obj": "c.obj",
    "trace_obj": "d.obj", "ctech": "cparm 1", "stech": "cparma 1", "call": "e.obj", "csh": "-f",
    "fo": "1 2 3", "bsp": "1", "invented": "1",
}  # fmt: skip
CALLED = {
    "v": "vertices", "vt": "texture coordinates", "vn": "normals", "f": "faces",
    "usemtl": "materials", "mtllib": "materials",
}  # fmt: skip


@pytest.mark.parametrize("word", OF_OBJ)
def test_every_statement_of_obj_is_used_or_noted(read, word):
    (read.folder / "o.mtl").write_text("newmtl m\nKd 1 1 1\n")
    (read.folder / "o.obj").write_text(OBJ + f"{word} {OF_OBJ[word]}\n")
    scene = load_scene(read.folder / "o.obj", bare=True)
    counts = {count.what: count for count in scene.account}
    what = CALLED.get(word, f"statements '{word}'")
    noted = "left out" in scene.summary() or what in scene.summary()
    assert counts[what].held and (counts[what].used or noted)

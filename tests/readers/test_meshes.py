"""Meshes from files and from builders: formats, materials, soundness, and what can be wrong."""

import numpy as np
import pytest
import trimesh
from PIL import Image
from plain_scenes import SCENES, load_mesh, refused
from trimesh.visual.material import PBRMaterial

from lfcore.colour import srgb_decode
from lfcore.readers.load import load_scene
from lfcore.scene.needs import Needs
from lfcore.scene.procedural import book, build, primitives, textures, turned
from lfcore.scene.surface_mesh import Surface, crease_normals, face_normals
from robustness.scene_checks import check_scene

SQUARE = (
    "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "usemtl skin\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
)


@pytest.fixture
def textured(tmp_path):
    """A unit square in OBJ and MTL whose texture has four different corners."""
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "skin.png")
    (tmp_path / "m.mtl").write_text(
        "newmtl skin\nKd 0.5 0.25 1\nKs 0.1 0.1 0.1\nNs 40\nmap_Kd skin.png\n"
    )
    (tmp_path / "square.obj").write_text(SQUARE)
    return tmp_path / "square.obj", pixels


def test_obj_material_texture_and_coordinates(textured):
    path, pixels = textured
    library = path.with_name("m.mtl")
    for name in ("skin.png", ".\\skin.png"):  # as Windows has it
        library.write_text(library.read_text().replace("skin.png", name))
        (part,) = load_mesh(path)
        np.testing.assert_array_equal(part.surface.texture, pixels)
        assert part.surface.diffuse == pytest.approx((0.5, 0.25, 1))
        assert part.surface.specular == pytest.approx((0.1, 0.1, 0.1))
        assert part.surface.shininess == 40
        # v is up: the corner (0, 0) of the square has the texture coordinate (0, 0).
        np.testing.assert_allclose(part.uvs, part.triangles[..., :2], atol=1e-6)


@pytest.mark.parametrize("name", ["m.mtl", "m.materials"])
def test_without_its_mtl_an_obj_has_the_default_material_and_says_so(textured, name):
    path, _ = textured
    path.with_name("m.mtl").unlink()
    path.write_text(SQUARE.replace("m.mtl", name))
    scene = load_scene(path, bare=True)
    assert scene.materials[0].diffuse == (0.8, 0.8, 0.8) and scene.textures == []
    assert scene.summary().startswith(f"{path}: left out: material library '{name}', not found")


COORDINATES = {
    "obj": SQUARE.replace("mtllib m.mtl\n", "").replace("usemtl skin\n", ""),
    "ply": (
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nproperty float s\nproperty float t\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0\n1 0 0 1 0\n0 1 0 0 1\n3 0 1 2\n"
    ),
}


@pytest.mark.parametrize("kind", COORDINATES)
def test_coordinates_without_a_material_do_not_darken(tmp_path, kind):
    """trimesh makes up a dark picture for them."""
    path = tmp_path / f"m.{kind}"
    path.write_text(COORDINATES[kind])
    (part,) = load_mesh(path)
    assert part.surface.texture is None
    assert part.surface.diffuse == (0.8, 0.8, 0.8)
    # They are there for a texture that a scene gives.
    assert np.ptp(part.uvs) == 1


def test_a_texture_for_a_mesh_without_coordinates_is_refused(write_scene, minimal, tmp_path):
    Image.new("RGB", (2, 2)).save(tmp_path / "skin.png")
    minimal["objects"][0]["material"] = {"texture": "skin.png"}
    words = r"objects\[0\]\.material\.texture.*coordinates"
    refused(words, load_scene, write_scene(minimal))


STRIPS = (
    "ply\nformat {} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
    "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
)
STRIP = [0, 1, 2, 3, -1, 2, 3, 4, 4]
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0), (0.5, 2, 0)]
ROWS = "".join(f"{x} {y} {z} 255 0 0\n" for x, y, z in CORNERS)


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian"])
def test_triangle_strips(tmp_path, kind):
    path = tmp_path / "strips.ply"
    head = STRIPS.format(kind)
    if kind == "ascii":
        path.write_text(f"{head}{ROWS}{len(STRIP)} {' '.join(map(str, STRIP))}\n")
    else:
        rows = b"".join(np.float32(c).tobytes() + bytes((255, 0, 0)) for c in CORNERS)
        path.write_bytes(head.encode() + rows + np.int32([len(STRIP), *STRIP]).tobytes())
    (part,) = load_mesh(path)
    corners = np.array(CORNERS)
    np.testing.assert_array_equal(part.triangles, corners[[[0, 1, 2], [2, 1, 3], [2, 3, 4]]])
    np.testing.assert_allclose(face_normals(part.triangles), [[0, 0, 1]] * 3)
    np.testing.assert_allclose(part.colours, [[[1, 0, 0]] * 3] * 3)


def test_a_texture_that_is_not_there_is_noted_and_a_damaged_one_refused(textured):
    path, _ = textured
    path.with_name("skin.png").write_bytes(b"none")
    assert refused("texture", load_scene, path).remedy
    path.with_name("skin.png").unlink()
    scene = load_scene(path, bare=True)
    assert scene.textures == [] and "texture 'skin.png', not found" in scene.summary()


def test_texture_override_and_removal(textured, write_scene):
    path, _ = textured
    Image.new("L", (3, 2), 7).save(path.parent / "grey.png")
    entry = {"file": path.name, "material": {"texture": "grey.png"}}
    scene = load_scene(write_scene({"objects": [entry]}), bare=True)
    assert len(scene.textures) == 1 and np.all(scene.textures[0] == 7)
    entry["material"] = {"texture": None}
    scene = load_scene(write_scene({"objects": [entry]}), bare=True)
    assert scene.textures == [] and len(scene.uvs) == 0 and scene.materials[0].texture == -1
    path, _ = textured
    Image.new("RGB", (2, 2), (100, 100, 100)).save(path.parent / "skin.png")
    (part,) = load_mesh(path)
    assert (part.surface.texture == 100).all()


def test_glb_with_pbr_texture_normals_and_node_transform(tmp_path):
    mesh = trimesh.creation.icosphere(subdivisions=1)
    uv = mesh.vertices[:, :2] * 0.5 + 0.5
    image = Image.fromarray(np.random.default_rng(0).integers(0, 255, (8, 8, 3), np.uint8))
    material = PBRMaterial(
        name="gold", baseColorFactor=[255, 128, 0, 255], baseColorTexture=image,
        metallicFactor=1.0, roughnessFactor=0.5,
    )  # fmt: skip
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    _ = mesh.vertex_normals
    scene = trimesh.Scene(mesh)
    scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix([10, 0, 0]))
    path = tmp_path / "two.glb"
    path.write_bytes(scene.export(file_type="glb", include_normals=True))
    parts = load_mesh(path)
    assert sum(part.count for part in parts) == 2 * 80
    centres = sorted(part.triangles.reshape(-1, 3).mean(0)[0] for part in parts)
    assert centres == pytest.approx([0, 10], abs=0.05)
    for part in parts:
        assert part.surface.name == "gold"
        assert (part.surface.metallic, part.surface.roughness) == (1, 0.5)
        assert part.surface.texture.shape == (8, 8, 3)
        centre = part.triangles.reshape(-1, 3).mean(0)
        np.testing.assert_allclose(part.normals, part.triangles - centre, atol=0.05)
    built = load_scene(path, bare=True)
    assert built.triangle_count == 160 and len(built.textures) == 1 and len(built.materials) == 1


def test_ply_vertex_colours_are_decoded(tmp_path):
    mesh = trimesh.creation.box()
    mesh.visual.vertex_colors = np.tile([[188, 0, 255, 255]], (8, 1)).astype(np.uint8)
    mesh.export(tmp_path / "box.ply")
    (part,) = load_mesh(tmp_path / "box.ply")
    expected = srgb_decode(np.array([188, 0, 255]) / 255)
    np.testing.assert_allclose(part.colours, np.broadcast_to(expected, (12, 3, 3)))
    scene = load_scene(tmp_path / "box.ply", bare=True)
    assert scene.colours.shape == (12, 3, 3)


def test_stl_is_smoothed_where_round_and_flat_where_not(tmp_path):
    trimesh.creation.icosphere(subdivisions=3).export(tmp_path / "ball.stl")
    trimesh.creation.box().export(tmp_path / "box.stl")
    (ball,) = load_mesh(tmp_path / "ball.stl")
    np.testing.assert_allclose(ball.normals, ball.triangles, atol=0.02)
    assert load_mesh(tmp_path / "box.stl")[0].normals is None
    assert load_mesh(tmp_path / "ball.stl", shading="flat")[0].normals is None
    assert load_mesh(tmp_path / "box.stl", crease_deg=120)[0].normals is not None


@pytest.mark.parametrize(
    "name, content, words",
    [
        ("a.glb", b"glTF garbage", "cannot be read"),
        ("a.stl", b"\x00" * 10, "cannot be read|no triangles"),
        ("a.stl", b"solid a\nendsolid a\n", "no triangles"),
        ("a.ply", b"", "cannot be read"),
        ("a.obj", b"# nothing\n", "cannot be read|no triangles"),
        ("a.xyzzy", b"1 2 3", "no reader"),
        ("a.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "cannot be read|vertex"),
        ("a.obj", b"v 1v2 3 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "'v': '1v2' is no number"),
        ("nan.obj", b"v nan 0 0\nv 0 nan 0\nv 0 0 nan\nf 1 2 3\n", "empty"),
        ("line.obj", b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "zero area"),
        ("a.ply", f"{STRIPS.format('ascii')}{ROWS}3 0 1 7\n".encode(), "names vertex 7 of 5"),
    ],
)
def test_unreadable_mesh(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    caught = refused(words, load_scene, tmp_path / name)
    assert name in str(caught)


def slow_crease_normals(triangles, crease_deg):
    unit, area = face_normals(triangles), trimesh.triangles.cross(triangles)
    result = np.zeros_like(triangles)
    for t in range(len(triangles)):
        for c in range(3):
            total = np.zeros(3)
            for other in range(len(triangles)):
                meets = (triangles[other] == triangles[t, c]).all(1).sum()
                if meets and unit[t] @ unit[other] >= np.cos(np.radians(crease_deg)):
                    total += meets * area[other]
            result[t, c] = total / np.linalg.norm(total)
    return result


@pytest.mark.parametrize("crease_deg", [0.001, 25, 50, 180])
def test_crease_normals_against_the_obvious_way(crease_deg):
    mesh = trimesh.creation.cylinder(radius=1, height=1, sections=9)
    triangles = np.asarray(mesh.triangles, np.float64)
    expected = slow_crease_normals(triangles, crease_deg)
    np.testing.assert_allclose(crease_normals(triangles, crease_deg), expected, atol=1e-12)


def test_crease_normals_of_vertices_whose_keys_are_equal(monkeypatch):
    triangles = np.asarray(trimesh.creation.icosphere(1).triangles, np.float64)
    expected = crease_normals(triangles)
    monkeypatch.setattr("lfcore.scene.surface_mesh.MIXING", np.uint64(0))
    np.testing.assert_array_equal(crease_normals(triangles), expected)


# Triangles of the thesis, section 7.2.
SIZES = {"bike": 10_000, "cabin": 15_000, "bedroom": 207_000, "chart": 6}


@pytest.mark.slow
@pytest.mark.parametrize("name", SIZES)
def test_scenes_of_the_thesis(name):
    built = load_scene(SCENES / name, bare=True)
    check_scene(built)
    assert built.triangle_count == pytest.approx(SIZES[name], rel=0.03) and not built.dropped
    assert all(max(material.diffuse) <= 1 for material in built.materials)
    needs = Needs.of(built)
    assert needs.textures and needs.smooth_normals == needs.shadows == (name != "chart")
    # Nothing in the field, widened for all lens points, is nearer than 0.2 m.
    camera, corners = built.camera, built.triangles.astype(np.float64)
    reach = camera.lens_radius_m + camera.field_width / 2 * 0.2
    low, high = corners[..., :2].min(1), corners[..., :2].max(1)
    inside = ((low < reach) & (high > -reach)).all(1) & (corners[..., 2].max(1) > 0)
    assert corners[inside][..., 2].min() >= 0.2
    # Ends of the visible depths blur over at least 4 of 128 pixels at the recorded focus.
    off = np.abs(1 / np.array(built.focus_distances_m)[[0, -1]] - camera.delta)
    assert (2 * camera.lens_radius_m * off / (camera.field_width / 128) > 4).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("bike", {}), ("cabin", {}), ("chart", {}), ("book", {}), ("sphere", {"segments": 12}),
        ("ecosys", {"plants": 0.01, "tree_leaves": 50, "terrain": 20}),
    ],
)  # fmt: skip
def test_builders_are_deterministic_and_seeded(name, parameters):
    def same(seed):
        pairs = zip(first, build(name, parameters, seed), strict=True)
        return all(
            np.array_equal(a.triangles, b.triangles)
            and np.array_equal(a.surface.texture, b.surface.texture)
            for a, b in pairs
        )

    first = build(name, parameters, 1)
    assert same(1) and (name == "chart" or not same(2))
    for part in first:
        # Of some area, and finite.
        assert np.isfinite(1 / trimesh.triangles.area(part.triangles)).all()


@pytest.mark.parametrize("triangles", [9800, 10300])
def test_triangle_count_is_met_exactly(triangles):
    assert sum(p.count for p in build("bike", {"triangles": triangles}, 1)) == triangles


PLAIN = Surface("plain")
SHAPES = {
    "box": (lambda: primitives.box((1, 2, 3), PLAIN), 12, 6.0),
    "sphere": (
        lambda: turned.sphere(1.0, PLAIN, segments=64, rings=48), 2 * 64 * 47, 4 / 3 * np.pi
    ),
    "tube": (
        lambda: turned.cylinder((0, 0, 0), (0, 0, 2), 0.5, PLAIN, segments=64), 256, np.pi / 2
    ),
    "torus": (
        lambda: turned.tube(turned.ring(1, 96), 0.2, PLAIN, segments=48, closed=True),
        2 * 96 * 48, 2 * np.pi**2 * 0.04,
    ),
    "cushion": (
        lambda: primitives.cushion((2, 2, 2), PLAIN, power=2.0, pieces=24), 12 * 576, 4 / 3 * np.pi
    ),
    "lathe": (
        lambda: turned.lathe([(0, 0), (1, 0), (1, 3), (0, 3)], PLAIN, segments=96),
        96 * 4, 3 * np.pi,
    ),
}  # fmt: skip


@pytest.mark.parametrize("make, count, volume", SHAPES.values(), ids=SHAPES.keys())
def test_closed_shapes_have_their_volume_and_normals(make, count, volume):
    """Divergence theorem: only closed shapes whose faces all turn outwards reach it."""
    part = make()
    a, b, c = part.triangles.transpose(1, 0, 2)
    assert part.count == count
    assert abs((a * np.cross(b, c)).sum() / 6) == pytest.approx(volume, rel=0.02)
    assert part.uvs.shape == (count, 3, 2)
    if part.normals is not None:
        cosine = (part.normals * face_normals(part.triangles)[:, None]).sum(-1)
        assert np.abs(cosine).min() > 0.5
        assert len(set(np.sign(cosine).ravel())) == 1


@pytest.mark.parametrize(
    ("texture", "colours"),
    [
        (textures.speckle, [((0, 0, 0), (255, 255, 255))]),
        (textures.bricks, [((90, 40, 30), (140, 70, 50)), (170, 160, 150)]),
        (textures.cobbles, [((90, 90, 90), (140, 130, 120)), (50, 50, 50)]),
        (textures.wood, [(60, 40, 20), (180, 130, 80)]),
        (textures.weave, [(200, 180, 160)]),
    ],
)
def test_textures_repeat_and_tile(texture, colours):
    picture = texture(1, *colours)
    np.testing.assert_array_equal(picture, texture(1, *colours))
    # Across the seam the picture changes no more than it does elsewhere.
    values = picture.astype(float)
    inside = np.abs(np.diff(values, axis=1)).mean((0, 2))
    seam = np.abs(values[:, 0] - values[:, -1]).mean()
    assert seam <= 1.5 * np.percentile(inside, 99) + 2


@pytest.mark.parametrize(
    ("builder", "parameters", "words"),
    [
        ("sphere", {"radius_m": 1.0}, "radius_m: builder 'sphere' has no such parameter"),
        ("bike", {"triangles": 2_000_000_000}, "triangles: more than"),
        ("ecosys", {"plants": 1e9}, "plants: must be from 0 to"),
        ("ecosys", {"terrain": 100_000}, "terrain: must be from 2 to"),
        ("ecosys", {"plants": -1.0}, "plants: must be from 0 to"),
        ("sphere", {"segments": 2}, r"parameters\.segments: must be from 3 to 4096"),
        ("sphere", {"segments": 10**30}, r"parameters\.segments: must be from 3 to 4096"),
    ],
)
def test_parameters_beyond_measure(builder, parameters, words):
    refused(words, build, builder, parameters, 0)


def test_the_book_leans_back_and_faces_the_cameras():
    cover = next(part for part in book.build(0) if part.surface.name == "cover")
    # The image of +y under the pose of the pbrt scene.
    normal = face_normals(cover.triangles)[0]
    np.testing.assert_allclose(normal, [0.267, 0.664, 0.698], atol=2e-3)
    top, bottom = (cover.triangles[cover.uvs[..., 1] == v] for v in (1, 0))
    assert top[:, 1].min() > bottom[:, 1].max() and top[:, 2].max() < bottom[:, 2].min()
    right, left = (cover.triangles[cover.uvs[..., 0] == u] for u in (1, 0))
    assert right[:, 0].mean() > left[:, 0].mean()

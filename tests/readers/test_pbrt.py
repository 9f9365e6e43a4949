"""Reading pbrt scenes: geometry in camera space, materials, lights, cameras, errors, notes."""

import gzip
import math
import shutil
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from plain_scenes import refused

import lfcore
from lfcore import BakeOptions
from lfcore.cli import main
from lfcore.colour import srgb_decode
from lfcore.exr import read_exr_picture
from lfcore.oracle.shading import arriving
from lfcore.readers.pbrt.build import build_pbrt_scene
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.emitters import POINTS, emitter_points
from lfcore.scene.sky import radiance

HEAD = 'LookAt 0 0 0  0 0 1  0 1 0\nCamera "perspective" "float fov" [60]\n'
FILM = 'Film "image" "integer xresolution" [100] "integer yresolution" [100]\n'
TRIANGLE = 'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [0 0 5  1 0 5  0 2 5]\n'
QUAD = 'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" '
QUAD += "[0 0 5  .1 0 5  .1 .1 5  0 .1 5]"


@pytest.fixture
def read(tmp_path):
    def build(world, head=HEAD + FILM, tail="WorldEnd\n", **options):
        path = tmp_path / "scene.pbrt"
        path.write_text(f"{head}WorldBegin\n{world}\n{tail}")
        return build_pbrt_scene(path, **options)

    return build


PLACED = {
    # pbrt looks along +z with x right and y up; ours has y down and nothing mirrored.
    "up is up": (HEAD, TRIANGLE, {(0, 0, 5), (0, -2, 5), (1, 0, 5)}),
    # forward = (-1, 0, 0); right = up x forward = (0, 1, 0) x (-1, 0, 0) = (0, 0, 1).
    "from (4, 1, -2) along -x": (
        HEAD.replace("0 0 0  0 0 1  0 1 0", "4 1 -2  3 1 -2  0 1 0"),
        'Shape "trianglemesh" "point P" [1 2 -1  1 2 0  1 5 -1]',
        {(1, -1, 3), (2, -1, 3), (1, -4, 3)},
    ),
    # (1,0,0) -> z + 1 -> x 2 -> turned to y -> moved: (1, 4, 4)
    "from outside in": (
        HEAD,
        "Translate 1 2 3 Rotate 90 0 0 1 Scale 2 1 1 "
        "ConcatTransform [1 0 0 0  0 1 0 0  0 0 1 0  0 0 1 1]\n"
        'Shape "trianglemesh" "point P" [1 0 0  0 1 0  0 0 0]',
        {(1, -4, 4), (0, -2, 4), (1, -2, 4)},
    ),
    "columns, which replace": (
        HEAD, f"Translate 9 9 9\nTransform [1 0 0 0 0 1 0 0 0 0 1 0 0 0 2 1]\n{TRIANGLE}",
        {(0, 0, 7), (0, -2, 7), (1, 0, 7)},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("head", "world", "corners"), PLACED.values(), ids=PLACED.keys())
def test_transformations(read, head, world, corners):
    found = read(world, head + FILM).triangles[0]
    assert {tuple(np.round(corner, 6)) for corner in found.tolist()} == corners


def test_mirroring_keeps_fronts_in_front(read):
    """`Scale -1 1 1` before LookAt mirrors the picture; normals still face as the shape's."""
    sphere = 'Translate 0 0 5\nShape "sphere"'
    for head in (HEAD, f"Scale -1 1 1\n{HEAD}"):
        scene = read(sphere, head + FILM)
        outward = scene.triangles - np.float64([0, 0, 5])
        front = trimesh.triangles.cross(scene.triangles.astype(np.float64))
        assert ((front * outward.mean(1)).sum(1) > 0).all()
        assert ((scene.normals * outward).sum(-1) > 0.99).all()
    left = read("Translate 1 0 5\n" + sphere, f"Scale -1 1 1\n{HEAD}{FILM}")
    assert left.triangles[..., 0].max() < 0.01


def test_attribute_blocks_and_coordinate_systems(read):
    world = (
        'AttributeBegin Translate 0 0 1 CoordinateSystem "near" AttributeEnd\n'
        f'{TRIANGLE}CoordSysTransform "near"\n{TRIANGLE}'
        f'CoordSysTransform "camera"\nTransformBegin Translate 0 0 9 TransformEnd\n{TRIANGLE}'
    )
    assert read(world).triangles[:, 0, 2].tolist() == [5, 6, 5]


def test_instances_are_flattened_in_place(read):
    scene = read(
        f'AttributeBegin Translate 1 0 0 ObjectBegin "tree" Scale 2 2 1 {TRIANGLE} ObjectEnd\n'
        'AttributeEnd ObjectInstance "tree" Translate 0 0 4 ObjectInstance "tree"'
    )
    assert scene.triangle_count == 2
    # The object was defined under Translate 1 0 0, which pbrt keeps with the shape.
    assert scene.triangles[:, 0].tolist() == [[1, 0, 5], [1, 0, 9]]
    assert scene.triangles[0, 1].tolist() == [1, -4, 5]


def area(scene):
    return trimesh.triangles.area(scene.triangles.astype(np.float64)).sum()


def closed(scene):
    """The mesh of a scene, which has no hole."""
    mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(scene.triangles))
    assert mesh.is_watertight
    return mesh


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        ('"sphere" "float radius" 2', 16 * math.pi),
        ('"sphere" "float zmin" 0 "float phimax" 180', math.pi),
        ('"disk" "float radius" 2 "float innerradius" 1', 3 * math.pi),
        ('"cylinder" "float radius" 2 "float zmin" 0 "float zmax" 3', 12 * math.pi),
    ],
)
def test_curved_shapes_keep_their_tolerance(read, shape, expected, monkeypatch):
    for tolerance in (1e-2, 1e-3):
        monkeypatch.setattr("lfcore.readers.pbrt.shapes.TOLERANCE", tolerance)
        scene = read(f"Translate 0 0 9\nShape {shape}")
        assert expected * (1 - 4 * tolerance) < area(scene) < expected
    if "sphere" in shape:
        radius = 2.0 if "radius" in shape else 1.0
        middles = scene.triangles.astype(np.float64).mean(1) - [0, 0, 9]
        assert (np.linalg.norm(middles, axis=1) > radius * (1 - 1e-3)).all()
    if "zmin" not in shape and "inner" not in shape:
        closed(scene)


def test_loop_subdivision_of_a_regular_mesh_stays_flat_and_converges(read):
    """A cube's subdivision is smooth, symmetric and inside the cube; its levels agree."""
    box = trimesh.creation.box((2, 2, 2))
    words = f'"integer indices" [{" ".join(map(str, box.faces.ravel()))}] '
    words += f'"point P" [{" ".join(map(str, box.vertices.ravel()))}]'
    volumes = []
    for levels in (2, 3, 4):
        scene = read(f'Translate 0 0 9\nShape "loopsubdiv" "integer levels" {levels} {words}')
        assert scene.triangle_count == 12 * 4**levels
        volumes.append(abs(closed(scene).volume))
    steps = np.abs(np.diff(volumes))
    assert steps[1] < 0.35 * steps[0] and 0.5 < volumes[-1] < 8


def test_loop_subdivision_keeps_planes_and_boundaries(read):
    scene = read(QUAD.replace('"trianglemesh"', '"loopsubdiv" "integer nlevels" 3'))
    assert (scene.triangles[..., 2] == 5).all()
    # A square's closed cubic spline is nearly a circle, of radius 0.465 for a side of 1.
    assert area(scene) == pytest.approx(math.pi * 0.0465**2, rel=0.03)


def test_ply_meshes_with_normals_and_coordinates(read, tmp_path):
    header = "ply\nformat ascii 1.0\nelement vertex 4\n"
    header += "".join(f"property float {name}\n" for name in "x y z nx ny nz u v".split())
    header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    rows = ["0 0 5 0 0 -1 0 0", "1 0 5 0 0 -1 1 0", "1 1 5 0 0 -1 1 1", "0 1 5 0 0 -1 0 1"]
    text = header + "\n".join(rows) + "\n4 0 1 2 3\n"
    (tmp_path / "quad.ply").write_text(text)
    (tmp_path / "quad.ply.gz").write_bytes(gzip.compress(text.encode()))
    body = b"".join(struct.pack("<8f", *map(float, row.split())) for row in rows)
    binary = header.replace("ascii", "binary_little_endian").encode() + body
    (tmp_path / "binary.ply").write_bytes(binary + struct.pack("<B4i", 4, 0, 1, 2, 3))
    cv2.imwrite(str(tmp_path / "t.png"), np.full((2, 2, 3), 99, np.uint8))
    material = 'Texture "t" "color" "imagemap" "string filename" "t.png"\n'
    material += 'Material "matte" "texture Kd" "t"\n'
    for name in ("quad.ply", "quad.ply.gz", "binary.ply"):
        scene = read(f'{material}Shape "plymesh" "string filename" "{name}"')
        assert scene.triangle_count == 2 and len(scene.textures) == 1
        np.testing.assert_allclose(scene.normals, np.broadcast_to([0, 0, -1], (2, 3, 3)))
        # u follows x, v follows y: up in pbrt is minus y here.
        np.testing.assert_allclose(scene.uvs[..., 0], scene.triangles[..., 0])
        np.testing.assert_allclose(scene.uvs[..., 1], -scene.triangles[..., 1])


def test_materials_become_blinn_phong(read):
    world = "".join(
        f"Material {words}\n{TRIANGLE}"
        for words in (
            '"matte" "rgb Kd" [.1 .2 .3]',
            '"plastic" "rgb Kd" [.4 .4 .4] "rgb Ks" [.5 .5 .5] "float roughness" [.01]',
            '"plastic" "rgb Kd" [.4 .4 .4] "rgb Ks" [.5 .5 .5] "float roughness" [.3]',
            '"metal" "float roughness" [.02]',
        )
    )
    scene = read(world)
    matte, shiny, dull, metal = (scene.materials[i] for i in scene.material_ids)
    assert matte.diffuse == (0.1, 0.2, 0.3) and not any(matte.specular)
    assert shiny.shininess > dull.shininess and shiny.specular[0] > dull.specular[0] > 0
    assert metal.diffuse[0] > metal.diffuse[1] > metal.diffuse[2]  # copper
    assert 'Material "metal"' in scene.summary()


def test_mirrors_glass_coats_and_veils(read):
    words = {
        "mirror": '"mirror" "rgb Kr" [.9 .8 .7]',
        "metal": '"conductor" "rgb reflectance" [.5 .6 .7]',
        "glass": '"glass" "float index" 1.25 "rgb Kt" [1 .5 1]',
        "named": '"dielectric" "spectrum eta" "glass-BK7"',
        "pane": '"thindielectric"',
        "coat": '"coateddiffuse" "rgb reflectance" [.2 .3 .4]',
        "veil": '"uber" "rgb opacity" [.3 .3 .3] "rgb Kr" [.5 .5 .5]',
        "tinted": '"uber" "rgb Kd" [.1 .1 .1] "rgb Kt" [.2 .3 .4] "float eta" 1.4',
        "shade": '"translucent" "rgb Kd" [.8 .8 .8]',
    }
    text = "".join(f"Material {kind}\n{TRIANGLE}" for kind in words.values())
    scene = read(text)
    found = dict(zip(words, (scene.materials[i] for i in scene.material_ids), strict=True))
    for name, colour in (("mirror", (0.9, 0.8, 0.7)), ("metal", (0.5, 0.6, 0.7))):
        assert found[name].diffuse == colour
        assert (found[name].metallic, found[name].roughness) == (1, 0)
    glass, pane = found["glass"], found["pane"]
    assert (glass.transmission, glass.ior, glass.diffuse) == (1, 1.25, (1, 0.5, 1))
    assert pane.transmission == 1 and pane.thin_walled and not glass.thin_walled
    assert found["named"].ior == 1.5168
    assert found["coat"].clearcoat == 1 and found["coat"].diffuse == (0.2, 0.3, 0.4)
    assert (found["veil"].opacity, found["veil"].clearcoat) == (pytest.approx(0.3), 0.5)
    tinted = found["tinted"]
    assert tinted.ior == 1.4 and tinted.transmission == pytest.approx(0.75)
    np.testing.assert_allclose(tinted.diffuse, (0.3, 0.4, 0.5))
    assert found["shade"].diffuse == (0.4, 0.4, 0.4) and "shines through" in scene.summary()
    refused("index.*0.5", read, f'Material "glass" "float index" 0.5\n{TRIANGLE}')
    mixed = read(
        'MakeNamedMaterial "a" "string type" "glass"\nMakeNamedMaterial "b" "string type" "matte"\n'
        'Material "mix" "string materials" ["a" "b"] "float amount" .25\n' + TRIANGLE
    )
    assert mixed.materials[0].transmission == 0.75


def test_named_and_mixed_materials(read):
    scene = read(
        'MakeNamedMaterial "a" "string type" "matte" "rgb Kd" [1 0 0]\n'
        'MakeNamedMaterial "b" "string type" "matte" "rgb Kd" [0 0 1]\n'
        'MakeNamedMaterial "m" "string type" "mix" "string namedmaterial1" "a" '
        '"string namedmaterial2" "b" "rgb amount" [.25 .25 .25]\n'
        f'NamedMaterial "m"\n{TRIANGLE}'
        'Material "mix" "string materials" ["a" "b"] "float amount" .25\n' + TRIANGLE
    )
    found = [scene.materials[i].diffuse for i in scene.material_ids]
    # Version 3 counts the first material's share, version 4 the second's.
    np.testing.assert_allclose(found, [(0.25, 0, 0.75), (0.75, 0, 0.25)])


def test_textures_scale_and_place(read, tmp_path):
    picture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3) * 5
    cv2.imwrite(str(tmp_path / "t.png"), picture[..., ::-1])
    scene = read(
        'Texture "i" "color" "imagemap" "string filename" "t.png" "float uscale" 2 '
        '"float vdelta" .5\n'
        'Texture "half" "color" "constant" "rgb value" [.5 .5 .5]\n'
        'Texture "s" "color" "scale" "texture tex1" "i" "texture tex2" "half"\n'
        'Material "matte" "texture Kd" "s"\n'
        'Shape "trianglemesh" "point P" [0 0 5 1 0 5 0 1 5] "float uv" [0 0 1 0 0 1]'
    )
    np.testing.assert_array_equal(scene.textures[0], picture)
    assert scene.materials[0].diffuse == (0.5, 0.5, 0.5)
    corners = {tuple(c) for c in scene.uvs[0].tolist()}
    assert corners == {(0.0, 0.5), (2.0, 0.5), (0.0, 1.5)}


@pytest.mark.parametrize("deep", [False, True])
@pytest.mark.parametrize(
    ("encoding", "light"),
    [("sRGB", 0.2140), ("linear", 0.5), ("gamma 1.0", 0.5), ("gamma 2.2", 0.5**2.2)],
)
def test_an_encoding_is_of_codes(read, tmp_path, encoding, light, deep):
    code = np.full((2, 2, 3), 0.5 * (65535 if deep else 255))
    cv2.imwrite(str(tmp_path / "t.png"), code.astype(np.uint16 if deep else np.uint8))
    scene = read(
        f'Texture "i" "spectrum" "imagemap" "string filename" "t.png" '
        f'"string encoding" "{encoding}"\n'
        'Material "diffuse" "texture reflectance" "i"\n' + TRIANGLE
    )
    found = srgb_decode(scene.textures[0]) * scene.materials[0].diffuse
    np.testing.assert_allclose(found, light, atol=0.005)


def test_an_unknown_encoding_is_refused(read, tmp_path):
    cv2.imwrite(str(tmp_path / "t.png"), np.zeros((2, 2, 3), np.uint8))
    what = 'Texture "i" "spectrum" "imagemap" "string filename" "t.png" "string encoding" "gamma x"'
    refused("'gamma x' is none of sRGB", read, f"{what}\n{TRIANGLE}")


def test_checkerboard_colours_the_first_field(read):
    scene = read(
        'Texture "c" "color" "checkerboard" "rgb tex1" [1 0 0] "rgb tex2" [0 0 1]\n'
        'Material "matte" "texture Kd" "c"\n'
        'Shape "trianglemesh" "point P" [0 0 5 1 0 5 0 1 5] "float uv" [.5 .5 1.5 .5 .5 1.5]'
    )
    image, (height, width) = scene.textures[0], scene.textures[0].shape[:2]

    def look(uv):
        return image[int((1 - uv[1]) % 1 * height), int(uv[0] % 1 * width)].tolist()

    by_place = {tuple(p): look(uv) for p, uv in zip(scene.triangles[0], scene.uvs[0], strict=True)}
    assert by_place[0, 0, 5] == [255, 0, 0]
    assert by_place[1, 0, 5] == by_place[0, -1, 5] == [0, 0, 255]


def test_lights(read):
    scene = read(
        'LightSource "point" "rgb I" [1 2 3] "point from" [1 2 3]\n'
        'LightSource "distant" "rgb L" [2 2 2] "point from" [0 3 0] "point to" [0 0 0]\n'
        'LightSource "infinite" "rgb L" [.1 .2 .3] "rgb scale" [2 2 2]\n'
        'LightSource "spot" "rgb I" [1 1 1]\nLightSource "goniometric"\n' + TRIANGLE
    )
    point, sun, _spot = scene.lights
    assert point.kind == POINT and point.vector == (1, -2, 3) and point.reference_distance_m == 1
    np.testing.assert_allclose(point.colour, np.array([1, 2, 3]) / math.pi)
    assert sun.kind == DIRECTIONAL and sun.vector == (0, -1, 0)
    np.testing.assert_allclose(radiance(scene.sky, np.eye(3)), [(0.2, 0.4, 0.6)] * 3, rtol=1e-6)
    assert scene.ambient == (0, 0, 0) and scene.bake == BakeOptions()
    notes = {(note.kind, note.line) for note in scene.notes}
    assert notes == {("approximated", 8), ("left out", 9)}


def by_angles(u, v):
    """The direction of a place in a map of pbrt 3."""
    polar, turn = v * math.pi, 2 * u * math.pi
    return math.sin(polar) * math.cos(turn), math.sin(polar) * math.sin(turn), math.cos(polar)


def by_equal_areas(u, v):
    """The same of pbrt 4: Clarberg's map."""
    x, y = 2 * u - 1, 2 * v - 1
    from_edge = 1 - (abs(x) + abs(y))
    r = 1 - abs(from_edge)
    turn = ((abs(y) - abs(x)) / r + 1) * math.pi / 4
    across = r * math.sqrt(2 - r * r)
    z = math.copysign(1 - r * r, from_edge)
    return math.copysign(math.cos(turn), x) * across, math.copysign(math.sin(turn), y) * across, z


@pytest.mark.parametrize(
    ("name", "size", "direction"),
    [("mapname", (32, 64), by_angles), ("filename", (64, 64), by_equal_areas)],
)
def test_a_sky_is_where_pbrt_has_it(read, tmp_path, name, size, direction):
    """A bright square of a map, in a light space that is turned and mirrored."""
    picture = np.full((*size, 3), 0.5, np.float32)
    picture[8:12, 12:16] = 4
    lfcore.write_picture(tmp_path / "sky.exr", picture)
    scene = read(
        "AttributeBegin\nRotate 90 1 0 0\nScale -1 1 1\n"
        f'LightSource "infinite" "string {name}" "sky.exr"\nAttributeEnd\n'
        'LightSource "infinite" "rgb L" [1 0 0]\n' + TRIANGLE
    )
    assert scene.bake == BakeOptions()
    x, y, z = direction(14 / size[1], 10 / size[0])
    camera = np.float32([[-x, z, y]])  # mirrored, then turned about x, then y down
    assert radiance(scene.sky, camera)[0] == pytest.approx([5, 4, 4], rel=0.05)
    assert radiance(scene.sky, -camera)[0] == pytest.approx([1.5, 0.5, 0.5], rel=0.05)


def test_skies_films_and_numbers_of_points_that_cannot_be(read, tmp_path):
    lfcore.write_picture(tmp_path / "dark.exr", np.full((2, 4, 3), -1, np.float32))
    sky = 'LightSource "infinite" "string mapname" "dark.exr"\n'
    refused(r"scene.pbrt: line \d+.*mapname", read, sky + TRIANGLE)
    refused("remainder", read, TRIANGLE, 'Camera "lightfield"\n' + FILM)
    for points in (0, 5000):
        refused(r"light_points.*Give 1 to", read, TRIANGLE, light_points=points)


def test_area_lights_send_what_they_should(read):
    """The points of an area light add up to radiance times area, of a sphere to its disk."""
    ball = 'Translate 0 0 5\nShape "sphere" "float radius" .1'
    for shape, two_sided, facing, number, normals in (
        (QUAD, "false", 0.01, 16, {1}), (QUAD, "true", 0.02, 32, {1, -1}),
        (ball, "false", math.pi * 0.01, 12, {0}),
    ):  # fmt: skip
        light = f'AreaLightSource "diffuse" "rgb L" [7 7 7] "bool twosided" {two_sided}'
        scene = read(f"{TRIANGLE}\n{light}\n{shape}", light_points=16)
        assert len(scene.lights) == number
        total = sum(light.colour[0] for light in scene.lights) * math.pi
        assert total == pytest.approx(7 * facing, rel=2e-3)
        assert {light.normal[2] for light in scene.lights} == normals
        assert scene.materials[0].emission == (7, 7, 7)
        # Emitters come first, and are their lights' own.
        own = {light.own for light in scene.lights}
        assert own == {(0, (scene.material_ids == 0).sum())}


def test_light_of_what_moves_has_its_triangles(read):
    moving = "AttributeBegin\nActiveTransform EndTime\nTranslate 1 0 0\nActiveTransform All\n"
    moving += 'AreaLightSource "diffuse"\nTranslate 0 0 5\nShape "sphere"\nAttributeEnd\n'
    scene = read(moving + TRIANGLE)
    (motion,) = scene.motions
    assert {light.own for light in scene.lights} == {(motion.first, scene.triangle_count)}


def test_spectra(read):
    world = "".join(
        f'Material "matte" {words}\n{TRIANGLE}'
        for words in (
            '"spectrum Kd" [400 .5 700 .5]',
            '"spectrum Kd" [400 0 595 0 605 1 700 1]',
            '"blackbody Kd" [3000 .5]',
            '"xyz Kd" [.95047 1 1.08883]',
        )
    )
    scene = read(world)
    grey, red, warm, white = (scene.materials[i].diffuse for i in scene.material_ids)
    np.testing.assert_allclose(grey, 0.5, atol=1e-9)
    assert red[0] > 3 * red[1] and warm[0] > warm[1] > warm[2]
    np.testing.assert_allclose(white, 1, atol=1e-3)


def test_perspective_is_a_thin_lens(read):
    head = 'Camera "perspective" "float fov" 40 "float lensradius" .3 "float focaldistance" 6.8\n'
    camera = read(TRIANGLE, head + FILM).camera
    assert camera.field_width == pytest.approx(2 * math.tan(math.radians(20)))
    assert camera.lens_radius_m == pytest.approx(0.3) and camera.focus_m == 6.8
    pinhole = read(TRIANGLE).camera
    assert pinhole.lens_radius_m < 1e-6 and math.isinf(pinhole.focus_m)


def test_light_field_camera_of_the_assignment(read):
    """The handout's own lines, its missing quote included; the default is 90 degrees."""
    head = (
        'Camera "lightfield" "float fov" [ 50 ] "integer camerasperdim" [16 16] \n'
        '       "float cameragridbounds [-0.6 0.6 -0.6 0.6]\n'
        'Film "image" "integer xresolution" [8192] "integer yresolution" [4096]\n'
    )
    scene = read(TRIANGLE, head)
    array = scene.view.array
    assert array.cameras == (16, 16) and array.tile == (512, 256) and array.fov_deg == 50
    assert array.columns_m[0] == -0.6 and array.rows_m[-1] == 0.6
    assert "closing quote" in scene.summary()
    plain = read(TRIANGLE, 'Camera "lightfield"\n' + FILM.replace("100", "160"))
    assert plain.view.array.fov_deg == 90 and plain.view.array.cameras == (16, 16)


def test_include_follows_the_main_files_folder(read, tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "a.pbrt").write_text('Include "parts/b.pbrt"\n')
    (tmp_path / "parts" / "b.pbrt").write_text(TRIANGLE)
    assert read('Include "parts/a.pbrt"').triangle_count == 1
    (tmp_path / "parts" / "b.pbrt").write_text('Include "parts/a.pbrt"\n')
    caught = refused("includes itself", read, 'Include "parts/a.pbrt"')
    assert "b.pbrt" in str(caught) or "a.pbrt" in str(caught)


def test_version_4_words(read):
    head = HEAD + 'Film "rgb" "integer xresolution" 8 "integer yresolution" 8\n'
    head += 'Option "bool disablepixeljitter" true\nColorSpace "srgb"\n'
    world = (
        'Material "diffuse" "rgb reflectance" [.1 .2 .3]\n'
        'Shape "trianglemesh" "point3 P" [0 0 5 1 0 5 0 1 5] "point2 uv" [0 0 1 0 0 1]\n'
        'LightSource "distant" "float scale" 2 "rgb L" [1 1 1]\n'
    )
    scene = read(world, head, tail="")
    assert scene.materials[0].diffuse == (0.1, 0.2, 0.3)
    np.testing.assert_allclose(scene.lights[0].colour, 2 / math.pi)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("world", "words"),
    [
        ("Shpae", "line 5.*Shpae.*Shape"),
        ('Shape "sphere" "float radius" [1 x]', "line 5"),
        ('Shape "sphere" "flaot radius" [1]', "line 5.*flaot.*float"),
        ('Shape "sphere" "float radius" "big"', "line 5.*radius"),
        ('Shape "sphere" "float radius" [1', "line 6.*Shape"),
        ("Translate 1 2", "line 6.*Translate.*Shape"),
        ('Shape "sphere', "line 5.*closing quote"),
        ("AttributeEnd", "line 5.*AttributeEnd"),
        ("AttributeBegin", "line 5.*never closed"),
        ('ObjectInstance "x"', 'line 5.*"x"'),
        ('NamedMaterial "x"', 'line 5.*"x"'),
        ('Material "matte" "texture Kd" "x"', 'line 5.*"x"'),
        ('Shape "trianglemesh" "integer indices" [0 1 9] "point P" [0 0 0 1 0 0 0 1 0]', "9"),
        ('Shape "plymesh" "string filename" "no.ply"', r"line 5.*no\.ply"),
        ('Include "no.pbrt"', r"line 5.*no\.pbrt"),
        ("Scale 0 1 1", "line 5.*flattens"),
        ('Camera "perspective"', "line 5.*world block"),
        ("]", r"line 5.*\]"),
        ("4", "line 5.*4"),
        ("Translate 1e400 0 0", "line 5, column 11: 1e400"),
        ("Scale 1e200 1 1\nScale 1e200 1 1", "line 6, column 1: Scale .*transformation"),
        ('LightSource "point" "blackbody I" [1e300 1]', "Give 100 to 1e\\+07 K"),
        ('AreaLightSource "diffuse"\nTranslate 0 0 1e40', "emitter reaches farther than 1e\\+12"),
        ("Translate 0 0 1e40", "every triangle was dropped"),
        (
            'Shape "trianglemesh" "integer indices" [0 1 1e20] "point P" [0 0 0 1 0 0 1 1 0]',
            "whole numbers",
        ),
    ],
)
def test_errors_are_one_line_that_names_file_line_and_token(read, world, words):
    caught = refused(words, read, f"{world}\n{TRIANGLE}")
    assert "scene.pbrt" in str(caught)


def test_includes_that_multiply_end(tmp_path, monkeypatch):
    """Each of a few files includes the next twice: as many as two to the power of them."""
    monkeypatch.setattr("lfcore.readers.pbrt.parser.MOST_FILES", 1000)
    for number in range(40):
        (tmp_path / f"{number}.pbrt").write_text(f'Include "{number + 1}.pbrt"\n' * 2)
    (tmp_path / "40.pbrt").touch()
    refused("more than 1000", build_pbrt_scene, tmp_path / "0.pbrt")


def test_a_file_that_cannot_be(tmp_path):
    nul = r"is no file: .*null.*\. Check the path"
    for name, words in (("none.pbrt", r"none\.pbrt"), ("a\0.pbrt", nul)):
        refused(words, build_pbrt_scene, tmp_path / name)


def test_rigid_motion_is_kept_and_other_is_noted(read):
    scene = read(
        f"{TRIANGLE}AttributeBegin ActiveTransform EndTime Translate 2 0 0 Rotate 90 0 0 1\n"
        f"ActiveTransform All Translate 0 0 1\n{TRIANGLE}AttributeEnd"
    )
    (motion,) = scene.motions
    assert (motion.first, motion.count) == (1, 1)
    np.testing.assert_array_equal(scene.at(0).triangles, scene.triangles)
    still, moved = scene.at(1).triangles
    np.testing.assert_array_equal(still, scene.triangles[0])
    # (0, 2, 6) turns to (-2, 0, 6) and moves to (0, 0, 6); (1, 0, 6) to (2, 1, 6).
    corners = {tuple(np.round(c, 5) + 0.0) for c in moved.tolist()}
    assert corners == {(2.0, 0.0, 6.0), (2.0, -1.0, 6.0), (0.0, 0.0, 6.0)}
    half = scene.at(0.5).triangles[1].astype(np.float64)
    lengths = np.linalg.norm(half - np.roll(half, 1, 0), axis=1)
    np.testing.assert_allclose(sorted(lengths), [1, 2, math.sqrt(5)], rtol=1e-6)
    np.testing.assert_array_equal(scene.at(2).triangles, scene.at(1).triangles)
    refused("finite", scene.at, math.inf)
    scene = read(f"ActiveTransform EndTime Scale 2 1 1\n{TRIANGLE}")
    assert not scene.motions and "not rigid" in scene.summary()


BALL = trimesh.creation.icosphere(4, radius=0.5).triangles
PLACES = np.stack(np.meshgrid(np.linspace(-4, 4, 17), np.linspace(-4, 4, 17)), -1).reshape(-1, 2)
FLOOR = np.concatenate([PLACES, np.zeros((len(PLACES), 1))], axis=1)


def of_points(triangles, count=POINTS):
    """(P,) irradiance of the floor over radiance, as the oracle adds lights up."""
    points = emitter_points(triangles, count)
    total = np.zeros(len(FLOOR))
    for place, normal, area in zip(*points, strict=True):
        light = Light(POINT, tuple(place), (area,) * 3, 1.0, normal=tuple(normal))
        towards, strength = arriving(light, FLOOR)
        total += np.maximum(towards[:, 2], 0) * strength[:, 0]
    return total


@pytest.mark.parametrize("count, number", [(1, 1), (4, 4), (5, 4), (6, 6), (12, 12), (40, 12)])
def test_points_of_a_sphere_are_a_regular_solid(count, number):
    points = emitter_points(BALL + (3, 4, 5), count)
    assert len(points.areas) == number
    assert not points.normals.any()
    assert points.areas.sum() == pytest.approx(np.pi / 4, rel=1e-9)
    np.testing.assert_allclose(points.positions.mean(0), (3, 4, 5), atol=1e-9)


def test_other_surfaces_keep_their_area_and_have_normals():
    half = BALL[BALL[..., 2].mean(1) > 0]
    for triangles in (trimesh.creation.box().triangles, BALL[:, ::-1], BALL * (1, 1, 2), half):
        points = emitter_points(triangles)
        area = trimesh.triangles.area(triangles).sum()
        assert points.areas.sum() == pytest.approx(area, rel=1e-9)
        np.testing.assert_allclose(np.linalg.norm(points.normals, axis=1), 1, atol=1e-12)
        again = emitter_points(triangles.copy())
        np.testing.assert_array_equal(again.positions, points.positions)
    assert emitter_points(np.zeros((3, 3, 3))) is emitter_points(np.zeros((0, 3, 3))) is None


def test_stated_error_of_other_surfaces():
    """20% from a diameter on, 5% with 48 points: a long ellipsoid, summed over its triangles."""
    triangles = BALL * (2, 1, 1) + (0, 0, 2)
    ways = triangles.mean(1) - FLOOR[:, None]
    facing = np.maximum(-(ways * trimesh.triangles.cross(triangles) / 2).sum(-1), 0)
    truth = (facing * ways[..., 2] / (ways**2).sum(-1) ** 2).sum(1)
    for count, limit in ((POINTS, 0.2), (48, 0.05)):
        assert np.abs(of_points(triangles, count) / truth - 1).max() < limit


LISTED = {
    "left out": {
        'Texture "wrinkles"', 'MakeNamedMedium "fog"', 'MediumInterface "fog"', 'Shape "cone"',
        'Shape "curve"', 'Shape "paraboloid"', 'LightSource "goniometric"',
    },
    "approximated": {
        'LightSource "spot"', 'AreaLightSource "diffuse"',
        'Shape "plymesh": "alpha"', 'Material "matte" named "floor"', 'Material "metal"',
        'Material "mix" named "blend"', 'Material "subsurface"',
    },
    "not used": {
        'Integrator "volpath"', 'Sampler "halton"', 'PixelFilter "gaussian"', 'Accelerator "bvh"',
        'parameter "filename"', 'parameter "octaves"', 'parameter "I" of LightSource "gonio',
        'parameter "name"',
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    here = tmp_path_factory.mktemp("public") / "scene"
    shutil.copytree(Path(__file__).with_name("public_style"), here)
    (here / "textures").mkdir()
    grid = np.full((64, 64, 3), 60, np.uint8)
    grid[::8] = grid[:, ::8] = (0, 200, 255)
    cv2.imwrite(str(here / "textures" / "grid.png"), grid)
    return here


def test_what_has_no_counterpart_is_listed_with_file_and_line(folder):
    path = folder / "scene.pbrt"
    lines, listed = path.read_text().splitlines(), build_pbrt_scene(path).notes
    for kind, starts in LISTED.items():
        notes = [note for note in listed if note.kind == kind]
        for start in starts:
            assert any(note.what.startswith(start) for note in notes), (kind, start)
        for note in notes:
            assert any(note.what.startswith(start) for start in starts), str(note)
            assert note.file == path
            word = note.what.removeprefix("parameter ").split('"')[1]
            assert word in " ".join(lines[note.line - 1 : note.line + 2]), str(note)


@pytest.mark.kernels
def test_it_renders_as_the_file_says(folder, tmp_path):
    out = tmp_path / "out.exr"
    assert main(["render", str(folder / "scene.pbrt"), "-o", str(out), "--samples", "2"]) == 0
    picture = read_exr_picture(out)
    assert picture.shape == (100, 160, 3) and np.isfinite(picture).all()
    # Sky on top, the checked floor's contrast at the bottom.
    np.testing.assert_allclose(picture[0, 0], [0.3, 0.35, 0.4], rtol=1e-3)
    assert picture[70:].std() > 0.1

"""Scene descriptions: scene.yaml, pbrt as text and packed, the npz between two jobs."""

import gzip
import os
import shutil
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
from PIL import Image

from lfcore.scene.build import build_scene
from lfcore.scene.description import schema
from lfcore.scene.files import load_scene, save_scene
from robustness import extremes
from robustness.mutate import damage_bytes, damage_text, mixed
from robustness.outcome import ROOT, SilentlyWrong
from robustness.sound import check_scene
from robustness.targets import Target, of_file
from robustness.trees import damage_yaml

PLAIN = """\
objects:
  - file: mesh.obj
    transform: [{translate_m: [0, 1, 0]}, {rotate: {axis: y, angle_deg: 30}}, {scale: 2}]
    material: {diffuse: [0.5, 0.4, 0.3], specular: "#202020", shininess: 40, texture: skin.png}
camera:
  focal_length_mm: 50
  sensor_width_mm: 36
  f_number: 2
  focus_m: 4
  pose: {position_m: [0, 1, 6], look_at_m: [0, 0.5, 0], up: [0, 1, 0]}
lights:
  - {towards_light: [0.5, 1, 0.5], colour: [0.8, 0.8, 0.8]}
  - {position_m: [1, 4, 2], colour: [3, 3, 3], reference_distance_m: 2, casts_shadows: false}
ambient: [0.1, 0.1, 0.1]
background: "#203040"
focus_distances_m: [2, 4, 8]
"""
BUILT = """\
name: built
objects:
  - {builder: sphere, seed: 2, parameters: {radius_m: 1.0, segments: 8, checks: 1.0}}
  - file: mesh.ply
    shading: flat
    crease_deg: 20
    motion: [{translate_m: [0.1, 0, 0]}]
    transform: [{matrix: [[1, 0, 0, 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]
camera:
  pose: {position_m: [0, 1, 6], look_at_m: [0, 0.9, 0]}
  lightfield:
    fov_deg: 40
    cameras_per_dim: [2, 2]
    camera_grid_bounds_m: [-0.5, 0.5, -0.5, 0.5]
    film_px: [32, 32]
    samples_per_pixel: 1
    shutter: [0, 0.5]
"""
SHORT = "objects: [{file: mesh.obj}]\n"
FITTED = """\
objects: [{file: mesh.obj}]
camera: {view_from: "30,20", zoom: 1.5, focus_m: 40%, blur: 3%}
"""
OBJ = """\
mtllib mesh.mtl
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
vt 0 1
vn 0 0 1
usemtl skin
f 1/1/1 3/3/1 2/2/1
f 1/1 2/2 4/3
usemtl bone
f 1 4 3
f 2 3 4
"""
MTL = """\
newmtl skin
Kd 0.5 0.25 1
Ks 0.1 0.1 0.1
Ns 40
map_Kd skin.png
newmtl bone
Kd 0.9 0.9 0.8
Ke 0 0 0
"""
PLY = """\
ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float s
property float t
property uchar red
property uchar green
property uchar blue
element face 2
property list uchar int vertex_indices
end_header
0 0 0 0 0 255 0 0
1 0 0 1 0 0 255 0
1 1 0 1 1 0 0 255
0 1 0 0 1 255 255 255
3 0 1 2
3 0 2 3
"""
PBRT_SPHERE = """\
LookAt 0 1.4 6  0 0.9 0  0 1 0
Camera "perspective" "float fov" [ 40 ] "float lensradius" [ 0.05 ] "float focaldistance" [ 6 ]
Film "image" "integer xresolution" [ 16 ] "integer yresolution" [ 12 ]
Sampler "halton" "integer pixelsamples" [ 4 ]
WorldBegin
LightSource "distant" "blackbody L" [ 4500 0.6 ] "point from" [ -1 2 1 ] "point to" [ 0 0 0 ]
LightSource "point" "rgb I" [ 20 20 20 ] "point from" [ 3 5 3 ]
AttributeBegin
  AreaLightSource "diffuse" "rgb L" [ 8 8 8 ] "integer nsamples" [ 4 ]
  Translate -3 5 0
  Shape "sphere" "float radius" [ 0.4 ]
AttributeEnd
Texture "board" "color" "checkerboard" "float uscale" [ 20 ] "rgb tex1" [ .1 .1 .1 ]
Texture "skin" "spectrum" "imagemap" "string filename" "skin.png" "bool trilinear" "true"
Material "matte" "texture Kd" "board"
Shape "trianglemesh" "integer indices" [ 0 1 2 0 2 3 ]
      "point P" [ -10 0 6  10 0 6  10 0 -20  -10 0 -20 ] "float uv" [ 0 0 1 0 1 1 0 1 ]
Include "more.pbrt"
MakeNamedMaterial "red" "string type" "plastic" "rgb Kd" [ .6 .1 .1 ] "float roughness" .05
ObjectBegin "thing" NamedMaterial "red" Shape "plymesh" "string filename" "mesh.ply" ObjectEnd
AttributeBegin Rotate 40 0 1 0 Scale .4 .4 .4 ObjectInstance "thing" AttributeEnd
WorldEnd
"""
MORE = 'Material "metal"\nTranslate 0 1 0\nShape "cylinder" "float radius" .5\n'


def write_sides(folder: Path) -> None:
    """What seeds name, and things that are no files."""
    corners = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(corners).save(folder / "skin.png")
    for name, text in (
        ("mesh.obj", OBJ), ("mesh.mtl", MTL), ("mesh.ply", PLY), ("more.pbrt", MORE),
        ("self", 'Include "self"\n'), ("x.obj", "v 0 0\nf 1 1 1\n"), ("x.png", "no picture"),
    ):  # fmt: skip
        (folder / name).write_text(text)
    (folder / "folder").mkdir(exist_ok=True)
    os.mkfifo(folder / "fifo")
    shutil.copy(ROOT / "tests/scene/public_style/geometry/quad.ply", folder / "x.ply")


def yaml_seeds(folder: Path) -> list[bytes]:
    schema()  # read once, for all children
    return [text.encode() for text in (PLAIN, BUILT, SHORT, FITTED)]


def pbrt_seeds(folder: Path) -> list[bytes]:
    public = (ROOT / "tests/scene/public_style/scene.pbrt").read_bytes()
    public = public.replace(b"geometry/quad.ply", b"x.ply").replace(b"geometry/", b"")
    moving = (ROOT / "scenes/sphere/moving.pbrt").read_bytes()
    return [PBRT_SPHERE.encode(), public.replace(b"textures/grid.png", b"skin.png"), moving]


def check_built(file: Path) -> None:
    """Build the scene of a file; what is taken must be sound and survive saving."""
    scene = build_scene(file)
    check_scene(scene)
    if scene.triangle_count < 5000:
        check_saved(scene, file.parent)


def check_saved(scene, folder: Path) -> None:
    save_scene(folder / "scene.npz", scene)
    again = load_scene(folder / "scene.npz")
    for name in ("triangles", "normals", "uvs", "colours", "material_ids"):
        if getattr(again, name).tobytes() != getattr(scene, name).tobytes():
            raise SilentlyWrong(f"{name} differ after saving")
    if (again.camera, again.lights, again.materials, again.focus_distances_m) != (
        scene.camera, scene.lights, scene.materials, scene.focus_distances_m,
    ):  # fmt: skip
        raise SilentlyWrong("camera, lights or materials differ after saving")


def damage_pbrt(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """As text, and what only pbrt has: order of blocks, includes, deep nesting."""
    if draw.random() < 0.7:
        return damage_text(draw, data, seeds)
    lines = data.splitlines(keepends=True)
    kind, at = draw.randrange(5), draw.randrange(len(lines))
    if kind == 0:
        draw.shuffle(lines)
    elif kind == 1:
        name = extremes.text(draw).encode("utf-8", "surrogatepass")
        lines.insert(at, b'Include "' + name + b'"\n')
    elif kind == 2:
        lines.insert(at, b"AttributeBegin " * draw.choice((1, 100, 100_000)) + b"\n")
    elif kind == 3:
        lines.insert(at, b'ObjectBegin "a" ObjectInstance "a" ObjectEnd ObjectInstance "a"\n')
    else:
        lines[at], lines[-1] = lines[-1], lines[at]
    return b"".join(lines)


def packed_seeds(folder: Path) -> list[bytes]:
    return [gzip.compress(PBRT_SPHERE.encode(), mtime=0)]


def check_packed(file: Path) -> None:
    """A packed scene is as its text, or refused: the check sum tells."""
    scene = build_scene(file)
    check_scene(scene)
    plain = file.with_name("plain.pbrt")
    plain.write_bytes(gzip.decompress(file.read_bytes()))
    if scene.triangles.tobytes() != build_scene(plain).triangles.tobytes():
        raise SilentlyWrong("packed, it is another scene")


def repack(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Damage the stream, or pack what was damaged, or a great many zeros."""
    kind = draw.random()
    if kind < 0.7:
        return damage_bytes(draw, data, seeds)
    if kind < 0.95:
        text = damage_pbrt(draw, gzip.decompress(data), [gzip.decompress(data)])
        return gzip.compress(text, 1, mtime=0)
    return _bomb(draw.choice((b" ", b"\0", b"[", b"1 "))) * draw.choice((1, 8, 64))


@cache
def _bomb(letters: bytes) -> bytes:
    """8 MiB and more, packed into a few kilobytes."""
    return gzip.compress(letters * (8 << 20), 9, mtime=0)


def saved_seeds(folder: Path) -> list[bytes]:
    write_sides(folder)
    seeds = []
    for text in (PLAIN, BUILT):
        (folder / "seed.yaml").write_text(text)
        save_scene(folder / "seed.npz", build_scene(folder / "seed.yaml"))
        seeds.append((folder / "seed.npz").read_bytes())
    return seeds


def targets() -> list[Target]:
    text = mixed((0.6, damage_yaml), (0.4, damage_text))
    yaml, pbrt = (of_file(f"input.{kind}", check_built, named=False) for kind in ("yaml", "pbrt"))
    packed = of_file("input.pbrt.gz", check_packed, named=False)
    saved = of_file("input.npz", lambda file: check_scene(load_scene(file)))
    return [
        Target("scene.yaml", yaml_seeds, text, yaml, write_sides, weight=2),
        Target("pbrt", pbrt_seeds, damage_pbrt, pbrt, write_sides, weight=2),
        Target("pbrt.gz", packed_seeds, repack, packed, write_sides),
        Target("scene.npz", saved_seeds, damage_bytes, saved, weight=0.5),
    ]

"""Scene descriptions: scene.yaml, pbrt, the npz between two jobs; accepted scenes are traced."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from random import Random

import numpy as np
from PIL import Image

from lfcore.readers.load import load_scene
from lfcore.scene.description import schema
from lfcore.scene.files import read_scene, save_scene
from robustness import extremes
from robustness.children import Limits
from robustness.mutate import damage_bytes, damage_text, mixed
from robustness.outcome import ROOT, SEEDS, SilentlyWrong
from robustness.scene_checks import check_scene
from robustness.targets import Target, of_file
from robustness.trees import damage_yaml, extreme_yaml

PLAIN, BUILT, FITTED, OBJ, MTL, PLY, PBRT_SPHERE = (
    (SEEDS / name).read_text()
    for name in ("plain.yaml", "built.yaml", "fitted.yaml", "mesh.obj", "mesh.mtl", "mesh.ply",
                 "sphere.pbrt")
)  # fmt: skip
SHORT = "objects: [{file: mesh.obj}]\n"
PIXELS = 8
"""The pixels per side of traced pictures."""
VIEWS = 2
"""The views per side of traced pictures."""
MOST_TRIANGLES = 20_000
"""The most triangles of a traced scene."""
MORE = 'Material "metal"\nTranslate 0 1 0\nShape "cylinder" "float radius" .5\n'


def write_sides(folder: Path) -> None:
    """Write the files that seeds name, and a folder and a pipe."""
    corners = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(corners).save(folder / "skin.png")
    for name, text in (
        ("mesh.obj", OBJ), ("mesh.mtl", MTL), ("mesh.ply", PLY), ("more.pbrt", MORE),
        ("self", 'Include "self"\n'), ("x.obj", "v 0 0\nf 1 1 1\n"), ("x.png", "no picture"),
    ):  # fmt: skip
        (folder / name).write_text(text)
    (folder / "folder").mkdir(exist_ok=True)
    os.mkfifo(folder / "fifo")
    shutil.copy(ROOT / "tests/readers/public_style/geometry/quad.ply", folder / "x.ply")


def yaml_seeds(folder: Path) -> list[bytes]:
    schema()  # read once, for all children
    return [text.encode() for text in (PLAIN, BUILT, SHORT, FITTED)]


def pbrt_seeds(folder: Path) -> list[bytes]:
    public = (ROOT / "tests/readers/public_style/scene.pbrt").read_bytes()
    public = public.replace(b"geometry/quad.ply", b"x.ply").replace(b"geometry/", b"")
    moving = (ROOT / "scenes/sphere/moving.pbrt").read_bytes()
    return [PBRT_SPHERE.encode(), public.replace(b"textures/grid.png", b"skin.png"), moving]


def check_built(file: Path) -> None:
    """Build the scene of a file; it must be valid, and the same after saving."""
    scene = load_scene(file, bare=True)
    check_scene(scene)
    if scene.triangle_count < 5000:
        check_saved(scene, file.parent)


def check_saved(scene, folder: Path) -> None:
    save_scene(folder / "scene.npz", scene)
    again = read_scene(folder / "scene.npz")
    for name in ("triangles", "normals", "uvs", "colours", "material_ids"):
        if getattr(again, name).tobytes() != getattr(scene, name).tobytes():
            raise SilentlyWrong(f"{name} differ after saving")
    if (again.camera, again.lights, again.materials, again.focus_distances_m) != (
        scene.camera, scene.lights, scene.materials, scene.focus_distances_m,
    ):  # fmt: skip
        raise SilentlyWrong("camera, lights or materials differ after saving")


def damage_pbrt(draw: Random, data: bytes, seeds: Sequence[bytes]) -> bytes:
    """Damage text, or what only pbrt has: the order of blocks, includes, deep nesting."""
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


def saved_seeds(folder: Path) -> list[bytes]:
    write_sides(folder)
    seeds = []
    for text in (PLAIN, BUILT):
        (folder / "seed.yaml").write_text(text)
        save_scene(folder / "seed.npz", load_scene(folder / "seed.yaml", bare=True))
        seeds.append((folder / "seed.npz").read_bytes())
    return seeds


def check_traced(file: Path) -> None:
    """Trace a scene: the device must not crash, and the picture must be finite."""
    from lfcore.opencl.device import open_device
    from lfcore.optics.planes import SensorPlane
    from lfcore.rendering.direct import trace_picture
    from lfcore.tracing.bvh import build_bvh
    from lfcore.tracing.tracer import Tracer

    scene = load_scene(file, bare=True)
    if scene.triangle_count > MOST_TRIANGLES:
        return
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    camera = scene.camera
    plane = SensorPlane(camera.focus_m, camera.f_number)
    picture = trace_picture(tracer, camera, PIXELS, plane, views=VIEWS)
    if picture.shape != (PIXELS, PIXELS, 3):
        raise SilentlyWrong(f"a picture {picture.shape}")
    if not np.isfinite(picture).all() or picture.min() < 0:
        raise SilentlyWrong("a picture that is not finite or darker than black")


def targets() -> list[Target]:
    text = mixed((0.6, damage_yaml), (0.4, damage_text))
    yaml, pbrt = (of_file(f"input.{kind}", check_built, named=False) for kind in ("yaml", "pbrt"))
    traced_seeds = lambda folder: [PLAIN.encode(), SHORT.encode()]  # noqa: E731
    numbers = mixed((0.7, extreme_yaml), (0.2, damage_yaml), (0.1, damage_text))
    traced = of_file("input.yaml", check_traced, named=False)
    # Children build programs, and drivers map much memory: no limit of the address space.
    limits = Limits(cpu=60, wall=300, memory=None)
    saved = of_file("input.npz", lambda file: check_scene(read_scene(file)))
    return [
        Target("scene.yaml", yaml_seeds, text, yaml, write_sides, weight=2),
        Target("pbrt", pbrt_seeds, damage_pbrt, pbrt, write_sides, weight=2),
        Target("scene.npz", saved_seeds, damage_bytes, saved, weight=0.5),
        Target("trace", traced_seeds, numbers, traced, write_sides, limits, 1.5, batch=400),
    ]

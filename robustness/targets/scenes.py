"""Scene descriptions: scene.yaml, pbrt, the npz between two jobs; accepted scenes are traced."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from hypothesis import strategies as st
from PIL import Image

from lfcore.readers.load import load_scene
from lfcore.scene.description import schema
from lfcore.scene.files import read_scene, save_scene
from robustness.children import Limits
from robustness.inputs import (
    Inputs,
    damaged_bytes,
    damaged_text,
    damaged_yaml,
    extreme_yaml,
    texts,
)  # fmt: skip
from robustness.outcome import ROOT, SEEDS, SilentlyWrong
from robustness.scene_checks import check_scene
from robustness.targets import Target, of_file

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


def damaged_scene(seeds: Sequence[bytes]) -> Inputs:
    return damaged_yaml(seeds) | damaged_text(seeds)


def traced_seeds(folder: Path) -> list[bytes]:
    return [PLAIN.encode()]


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


def damaged_pbrt(seeds: Sequence[bytes]) -> Inputs:
    """Return damaged texts, and what only pbrt has: the order of lines, includes, deep nesting."""
    blocks = st.sampled_from([b"AttributeBegin " * count for count in (1, 100, 100_000)])
    instance = b'ObjectBegin "a" ObjectInstance "a" ObjectEnd ObjectInstance "a"'
    names = texts.map(lambda text: text.encode("utf-8", "surrogatepass"))
    lines = blocks | st.just(instance) | names.map(lambda name: b'Include "' + name + b'"')

    @st.composite
    def inserted(draw: st.DrawFn) -> bytes:
        whole = draw(st.sampled_from(seeds)).split(b"\n")
        whole.insert(draw(st.integers(0, len(whole))), draw(lines))
        return b"\n".join(whole)

    shuffled = st.sampled_from(seeds).flatmap(lambda seed: st.permutations(seed.split(b"\n")))
    return damaged_text(seeds) | inserted() | shuffled.map(b"\n".join)


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
    yaml, pbrt = (of_file(f"input.{kind}", check_built, named=False) for kind in ("yaml", "pbrt"))
    traced = of_file("input.yaml", check_traced, named=False)
    # Children build programs, and drivers map much memory: no limit of the address space.
    limits = Limits(cpu=60, wall=300, memory=None)
    saved = of_file("input.npz", lambda file: check_scene(read_scene(file)))
    return [
        Target("scene.yaml", yaml_seeds, damaged_scene, yaml, write_sides),
        Target("pbrt", pbrt_seeds, damaged_pbrt, pbrt, write_sides),
        Target("scene.npz", saved_seeds, damaged_bytes, saved),
        Target("trace", traced_seeds, extreme_yaml, traced, write_sides, limits),
    ]

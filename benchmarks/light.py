"""Compares baked light with Mitsuba: python -m benchmarks.light --out light.csv --pictures light/

Ten matt scenes: three published ones, and seven of :mod:`benchmarks.lit_scenes`.  *bake*: core
seconds and memory of a bake to an error bound; expected and real error of a pinhole's picture,
relative to the light; and its dB to Mitsuba's converged picture.  Further ``--parts``, for
published scenes: *planes*: pictures of five planes through the open lens, Mitsuba's and with
*cycles* Cycles', denoised: core seconds per plane, dB of all five, and the number of planes from
which ours, with the bake, take a tenth of Mitsuba's time.  *price*: the time of rays with baked
light and sky over that of the same rays with ambient light, in turn.  Rows of other scenes and
parts stay.
"""

import argparse
import itertools
import math
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.lit_scenes import MADE, made_scene
from benchmarks.peers.cycles_lens import cycles_lens, matt
from benchmarks.peers.method import Renderer, Samples, SkippedError
from benchmarks.peers.mitsuba import denoised, mitsuba_path
from benchmarks.results import parser_of, report, said, say, with_kept
from benchmarks.sample import SCENES
from docs.examples.sky import sky
from lfcore.api import load_scene
from lfcore.baking.bake import bake_light
from lfcore.baking.bounces import MOST_BOUNCES
from lfcore.colour import srgb_encode
from lfcore.evaluation.figures import contact_sheet
from lfcore.evaluation.true_picture import BORDER
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice, Slab
from lfcore.pictures import write_picture
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.prepared import hierarchy_of, opened
from lfcore.scene.baked import DARK, NO_SKY, BakedLight, BakeOptions
from lfcore.scene.model import Scene
from lfcore.timing import measure_in_turn
from lfcore.tracing.tracer import Tracer

PATHS = {"cornell": "cornell/scene.yaml", "bike": "bike/sky.yaml", "bedroom": "bedroom/window.yaml"}
DEFAULT = ("0.02:32",)
"""The error bounds of bakes, and the initial cells over the width of the picture."""
PINHOLE = 1e4
"""The f-number of a pinhole."""
SHARP = Lattice(2, 16)
"""The rays of a pinhole's picture."""
PEER, CYCLES = (f"{name} + OIDN, 64 samples" for name in ("Mitsuba path", "Cycles"))
DENOISED = Samples(64, "multijitter", "picture")
"""The samples of peers' pictures."""
LATTICES = Lattice(4, 2), Lattice(8, 1)
"""The rays of our pictures, in ascending quality."""
PRICED = 512
"""The pixels per side of the slab in the part *price*."""


def scene_of(name: str, folder: Path) -> Scene:
    """Load a scene and make it matt; the bicycle is under a panorama."""
    if name in MADE:
        return replace(matt(made_scene(name, folder)), clip=False)
    path, light = SCENES / PATHS[name], None
    if name == "bike":
        write_picture(folder / "sky.exr", sky())
        light = {"sky": {"file": str(folder / "sky.exr")}}
    return replace(matt(load_scene(path, light=light)), name=name, clip=False)


def bounces_of(scene: Scene) -> int | str:
    return (scene.bake or BakeOptions()).bounces


def baked(scene: Scene, options: BakeOptions, threads: int) -> tuple[BakedLight, float, float]:
    """Bake in another process; return the light, core seconds and MiB."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(_bake, scene, options, threads).result()


def _bake(scene: Scene, options: BakeOptions, threads: int) -> tuple[BakedLight, float, float]:
    from lfcore.opencl.device import open_device

    bvh, device = hierarchy_of(scene), open_device(threads=threads)
    small = load_scene(SCENES / PATHS["cornell"])
    bake_light(small, hierarchy_of(small), device, replace(options, error=1.0))  # programs
    Path("/proc/self/clear_refs").write_text("5")  # resets the peak
    before, begun = _peak_mib(), time.process_time()
    light = bake_light(scene, bvh, device, options)
    return light, time.process_time() - begun, _peak_mib() - before


def _peak_mib() -> float:
    """Return the process's peak of memory, from /proc: Linux's ru_maxrss includes the parent's."""
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmHWM:")[1].split()[0]) / 1024


def bakes(scene: Scene, peer: Renderer, options: argparse.Namespace, kept: dict) -> Iterator[tuple]:
    """Yield a row per bake, and the scene with its light."""
    camera = replace(scene.camera, f_number=PINHOLE)
    truth = np.array([truth_of(peer, camera, options, 1)])
    plane = SensorPlane(scene.camera.focus_m, PINHOLE)
    kept["converged"] = truth[0, 2]
    for error, cells in (map(float, bake.split(":")) for bake in options.bakes):
        how = replace(scene.bake or BakeOptions(), error=error, cells=int(cells))
        light, seconds, mib = baked(scene, how, options.threads)
        lit = replace(scene, light=light)
        tracer = Tracer(lit, hierarchy_of(scene), opened(None))
        pictures = pictures_by_depth(tracer, camera, [plane], options.pixels, SHARP)
        shown = f"error {error:g}, {cells:.0f} cells"
        kept.update({shown: pictures[0], f"{shown}, off": 0.5 + 4 * (pictures[0] - truth[0, 2])})
        yield said({
            "scene": scene.name, "part": "bake", "setting": shown,
            "core s": f"{seconds:.1f}", "MiB": f"{mib:.0f}", "expected": f"{light.error:.3f}",
            "real": f"{true_error(pictures, truth):.3f}",
            "points": len(light.values), "rays": light.rays,
            "dB": f"{true_psnr(pictures, truth):.1f}",
        }), lit  # fmt: skip


def planes(
    scene: Scene, lights: list, peer: Renderer, options: argparse.Namespace, kept: dict
) -> Iterator[dict]:
    """Yield rows of five planes through the open lens, until ours are as good as Mitsuba's."""
    wanted = [SensorPlane(f, scene.camera.f_number) for f in scene.focus_distances_m]
    cameras = [focused_camera(scene.camera, plane) for plane in wanted]
    truths = np.array([truth_of(peer, c, options, 2 + n) for n, c in enumerate(cameras)])

    def row(setting: str, pictures: np.ndarray, seconds: float) -> dict:
        picture, near = pictures[len(wanted) // 2], truths[len(wanted) // 2, 2]
        name = setting.split(",")[0]
        kept.update({"converged": near, name: picture, f"{name}, off": 0.5 + 4 * (picture - near)})
        return {
            "scene": scene.name, "part": "planes", "setting": setting,
            "core s": f"{seconds:.3g}", "dB": f"{true_psnr(pictures, truths):.1f}",
        }  # fmt: skip

    def theirs(name: str, other: Renderer) -> dict:
        other.picture(cameras[0], 64, DENOISED)  # compiles
        runs = [other.picture(c, options.pixels, DENOISED, 100 + n) for n, c in enumerate(cameras)]
        pictures, seconds = map(np.array, zip(*runs, strict=True))
        return said(row(name, pictures, seconds.mean()))

    if "cycles" in options.parts:
        try:
            bounces = bounces_of(scene)
            most = MOST_BOUNCES if isinstance(bounces, str) else bounces
            cycles = cycles_lens(scene, options.threads, most)
            yield theirs(CYCLES, cycles)
            cycles.close()
        except SkippedError as why:
            say(f"{CYCLES}: left out, {why}")
    mitsubas = theirs(PEER, peer)
    for (bake, lit), lattice in itertools.product(lights, LATTICES):
        tracer = Tracer(lit, hierarchy_of(scene), opened(None))
        pictures_by_depth(tracer, scene.camera, wanted, 16, lattice)  # programs
        begun = time.process_time()
        pictures = pictures_by_depth(tracer, scene.camera, wanted, options.pixels, lattice)
        traced = (time.process_time() - begun) / len(wanted)
        ours = row(f"baked, {bake['setting']}, {lattice}", pictures, traced)
        per_plane = float(mitsubas["core s"]) / 10 - traced
        first = max(1, math.ceil(float(bake["core s"]) / per_plane)) if per_plane > 0 else ""
        yield said(ours | {"bake core s": bake["core s"], "a tenth from plane": first})
        if float(ours["dB"]) >= float(mitsubas["dB"]):
            break
    yield mitsubas


def truth_of(peer: Renderer, camera: Camera, options: argparse.Namespace, seed: int) -> list:
    """Return two converged pictures with independent noise, and their mean, denoised."""
    how = camera, options.pixels, Samples(options.converged)
    pair = [peer.picture(*how, each)[0] for each in (2 * seed, 2 * seed + 1)]
    return [*pair, peer.ask(denoised, np.mean(pair, axis=0))]


def true_psnr(pictures: np.ndarray, truths: np.ndarray, where: np.ndarray | None = None) -> float:
    """Return the dB of pictures, in sRGB, to two noisy converged pictures; ``where`` (M, M) are
    the pixels that count.

    Independent noise cancels in the product of the differences to both.  Differences are linear,
    times the slope of sRGB between the picture and the denoised one: the mean of sRGB-encoded noise
    is biased.
    """
    one, two, near = np.swapaxes(truths, 0, 1)
    middle, half = (pictures + near) / 2, np.maximum(abs(pictures - near) / 2, 1e-4)
    slope = (srgb_encode(middle + half) - srgb_encode(middle - half)) / (2 * half)
    errors = slope**2 * (pictures - one) * (pictures - two)
    return -10 * math.log10(_mean_or_noise(errors.mean(-1), where))


def true_error(pictures: np.ndarray, truths: np.ndarray) -> float:
    """Return the root mean square error of pictures, relative to the light; noise cancels, too."""
    one, two, near = (picture.mean(-1) for picture in np.swapaxes(truths, 0, 1))
    level = np.maximum(near, DARK * near.mean())
    grey = pictures.mean(-1)
    return math.sqrt(_mean_or_noise((grey - one) * (grey - two) / level**2))


def _mean_or_noise(errors: np.ndarray, where: np.ndarray | None = None) -> float:
    """The mean of pixels (F, M, M) within the border, or its double standard error, if noise
    hides it: errors are at most as large."""
    border = math.ceil(BORDER * errors.shape[1])
    inner = errors[:, border:-border, border:-border]
    if where is not None:
        inner = inner[:, where[border:-border, border:-border]]
    return max(float(inner.mean()), 2 * float(inner.std()) / math.sqrt(inner.size))


def price(scene: Scene, options: argparse.Namespace) -> Iterator[dict]:
    """Yield rows with the time of rays with baked light over that with ambient light."""
    plain = replace(scene, light=None, sky=NO_SKY, bake=None, ambient=(0.3, 0.3, 0.3))
    tracers = [Tracer(version, hierarchy_of(scene), opened(None)) for version in (scene, plain)]
    for views in (16, 64):
        slab = Slab(scene.camera, views, PRICED)
        spread = (np.arange(views // 2, side, views) for side in slab.size)
        some = bundles.macropixels(slab, np.stack(np.meshgrid(*spread), -1).reshape(-1, 2))
        works = [partial(tracer.bundle_radiance, some) for tracer in tracers]
        timings = measure_in_turn(works, repeats=options.repeats, clock=time.process_time)
        ours, without = (min(timing.seconds) for timing in timings)
        yield said({
            "scene": scene.name, "part": "price", "setting": f"N = {views}",
            "core s": f"{ours:.3f}", "price": f"{ours / without:.2f}",
        })  # fmt: skip


SHOWN = {
    "bake": ["core s", "MiB", "expected", "real", "dB", "pixels"],
    "planes": ["core s", "bake core s", "a tenth from plane", "dB", "commit"],
    "price": ["price", "commit"],
}
"""The published columns of each part."""


def shown(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the published tables, one per part, by the suffix of their file."""
    return {
        f"_{part}": table.loc[table["part"] == part, ["scene", "setting", *columns]]
        for part, columns in SHOWN.items()
        if (table["part"] == part).any()
    }


def main() -> None:
    parser = parser_of(__doc__ or "", scenes=(*MADE, *PATHS), pixels=192)
    parser.add_argument("--pictures", type=Path, help="folder of pictures and differences")
    parts = ("planes", "cycles", "price")
    parser.add_argument("--parts", nargs="*", default=(), choices=parts, help="beside bakes")
    parser.add_argument("--bakes", nargs="+", default=DEFAULT, metavar="ERROR:CELLS")
    parser.add_argument("--converged", type=int, default=128, help="samples of converged pictures")
    parser.add_argument("--repeats", type=int, default=50)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--note", default="", help="sentence below the tables")
    options = parser.parse_args()
    rows: list[dict] = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.scenes:
            scene = scene_of(name, Path(folder))
            kept: dict[str, np.ndarray] = {}
            peer = mitsuba_path(scene, bounces_of(scene), options.threads)
            lights = list(bakes(scene, peer, options, kept))
            rows += [row for row, _ in lights]
            if "planes" in options.parts:
                rows += planes(scene, lights, peer, options, kept)
            peer.close()
            if "price" in options.parts:
                rows += price(lights[-1][1], options)
            if options.pictures:
                cells = [(picture, label) for label, picture in kept.items()]
                contact_sheet(options.pictures / f"{name}.png", cells, 3, panel_px=480)
    table = pd.DataFrame(rows).assign(pixels=options.pixels)
    table = with_kept(table, options.out, "scene", "part")
    report(options.out, "python -m benchmarks.light", table, options.note, shown(table))


if __name__ == "__main__":
    main()

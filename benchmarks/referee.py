"""Judges depth of field by others' formulas, and ours: python -m benchmarks.referee --out FILE.csv

Twelve scenes have converged pictures of both halves of the lens, a sharp picture and its depth,
kept in ``--set``.  Each method makes the picture of the whole lens, or the left and the right one.
PSNR is that of sRGB pictures without their border: over all pixels, near depth edges, elsewhere.

    python -m benchmarks.referee --set referee/ --out referee.csv --figures crops/
"""

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import uniform_filter

from benchmarks.peers import convolved
from benchmarks.peers.deeplens import deeplens, package
from benchmarks.peers.method import SkippedError
from benchmarks.quality import true_picture
from benchmarks.referee_scenes import BLUR_PX, OPENED, with_lens
from benchmarks.results import report, say
from benchmarks.teach import NEAR_PX, near_edges
from lfcore.colour import display_values
from lfcore.datasets import views
from lfcore.datasets.kinds import blur_px
from lfcore.evaluation.metrics import decibels, psnr
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice, Slab
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.depth import all_samples
from lfcore.rendering.prepared import open_tracer
from lfcore.timing import clocked
from lfcore.tracing.tracer import Tracer

PIXELS = 160
TRUTH = Lattice(16, 2), Lattice(14, 3)
"""The rays of converged pictures, in two halves that show their error."""
SHARP = (8, 1)
"""The pattern of the sharp picture's rays: 64 per pixel."""
OURS = {"ours, 16 rays": Lattice(4, 1), "ours, 64 rays": Lattice(4, 2)}
CROP_PX = 48
LEAST = 0.01
"""The share of pixels below which a region is too small to be judged."""


@dataclass(frozen=True)
class Case:
    """Converged pictures of the left and right half of the lens (2, H, W, 3), the sharp picture,
    its depth, the signed radius of blur, and the PSNR of the whole lens's picture."""

    halves: np.ndarray
    sharp: np.ndarray
    depth: np.ndarray
    radius: np.ndarray
    known_db: np.ndarray

    def true(self, halves: bool) -> np.ndarray:
        return self.halves if halves else self.halves.mean(0, keepdims=True)

    @property
    def inner(self) -> np.ndarray:
        """The pixels that count: not the border, into which others have nothing to blur."""
        inner, border = np.zeros(self.depth.shape, bool), int(BLUR_PX) + 2
        inner[border:-border, border:-border] = True
        return inner


def prepared(name: str, pixels: int) -> Tracer:
    """Open a scene with its lens."""
    tracer = open_tracer(OPENED[name]())
    return open_tracer(with_lens(tracer.scene, pinhole_depth(tracer, pixels)))


def pinhole_depth(tracer: Tracer, pixels: int) -> np.ndarray:
    slab = Slab.of(tracer.scene.camera, 1, pixels)
    return tracer.bundle_hits(bundles.views(slab, all_samples(slab)))[1][0]


def converged(tracer: Tracer, pixels: int) -> Case:
    """Trace a scene's converged pictures, at their focus, each ray in the pixel that it meets."""
    camera = tracer.scene.camera
    halves = SensorPlane(camera.focus_m, camera.f_number).halves()
    first, second = (
        np.stack([true_picture(tracer, plane, pixels, lattice) for plane in halves])
        for lattice in TRUTH
    )
    rays = [lattice.rays_per_pixel for lattice in TRUTH]
    apart = [display_values(pictures.mean(0)) for pictures in (first, second)]
    # Independent errors e of both: their difference has 2 e, and their mean has e / 2.
    known_db = decibels(np.square(apart[0] - apart[1]).mean() / 4, peak=255)
    depth = pinhole_depth(tracer, pixels)
    radius = blur_px(camera, pixels, depth, camera.focus_m) / 2
    sharp = views.view(tracer, Slab.of(camera, 1, pixels), 0, SHARP)
    pictures = np.average([first, second], axis=0, weights=rays).astype(np.float32)
    return Case(pictures, sharp, depth, radius, np.array(known_db))


Make = Callable[[], np.ndarray]


def methods(case: Case, tracer: Tracer) -> Iterator[tuple[str, bool, Make]]:
    """Yield name, whether of halves, and a function that returns the one or two pictures."""
    sharp, radius, camera = case.sharp, case.radius, tracer.scene.camera
    plane, pixels = SensorPlane(camera.focus_m, camera.f_number), len(sharp)

    def one(work: Callable, *arguments) -> Make:
        return lambda: work(*arguments)[None]

    def pair(work: Callable, kernel: convolved.Kernel) -> Make:
        both = kernel, convolved.right(kernel)
        return lambda: np.stack([work(sharp, radius, half) for half in both])

    yield "sharp picture", False, lambda: sharp[None]
    yield "layers", False, one(convolved.layered, sharp, radius)
    yield "FOSSA's program", False, one(convolved.fossa, sharp, radius)
    reach = int(np.ceil(np.abs(radius).max()))
    for halves in (False, True):
        render = partial(deeplens, sharp, case.depth, camera, reach, halves)
        yield "DeepLens", halves, render
    yield "splats", False, one(convolved.splats, sharp, radius)
    yield "Punnappurath et al.", True, pair(convolved.layered, convolved.translating_disc)
    yield "Abuolaim et al.", True, pair(convolved.gathered, convolved.butterworth)
    yield "layers, half discs", True, pair(convolved.layered, convolved.half_disc)
    for name, lattice in OURS.items():
        for halves in (False, True):
            planes = plane.halves() if halves else [plane]
            make = partial(pictures_by_depth, tracer, camera, planes, pixels, lattice)
            yield name, halves, make


def errors(pictures: np.ndarray, case: Case) -> np.ndarray:
    """Return squared errors of sRGB pictures, (H, W), means of channels and halves."""
    true = case.true(len(pictures) == 2)
    apart = display_values(np.clip(pictures, 0, None)) - display_values(true)
    return np.square(apart).mean((0, 3))


REGIONS = {"all": "all dB", "near": f"within {NEAR_PX} px of edges dB", "far": "elsewhere dB"}
VIEWS = {False: "whole lens", True: "left and right"}


Answers = dict[tuple[str, bool], tuple[np.ndarray, float]]
"""Pictures, one or two, and core seconds, by method and whether of halves."""


def answers(file: Path, case: Case, tracer: Callable[[], Tracer]) -> Answers:
    """Run all methods, or read the answers of an earlier run."""
    if not file.exists():
        found = {}
        with suppress(SkippedError):
            package()  # its import is not counted
        for method, halves, make in methods(case, tracer()):
            try:
                pictures, seconds = clocked(make, clock=time.process_time)
                if "ours" in method:  # the first has compiled kernels
                    pictures, seconds = clocked(make, clock=time.process_time)
            except SkippedError as skipped:
                say(f"SKIPPED {method}: {skipped}")
                continue
            found[f"{method}|{halves:d}"] = pictures
            found[f"{method}|{halves:d}|s"] = np.array(seconds)
        arrays: dict[str, Any] = found
        np.savez(file, **arrays)
    kept = np.load(file)
    return {(key[:-2], key[-1] == "1"): (kept[key], float(kept[f"{key}|s"]))
            for key in kept if not key.endswith("|s")}  # fmt: skip


def judged(name: str, case: Case, answers: Answers) -> Iterator[dict]:
    """Yield a row per method."""
    near = near_edges(case.depth)
    masks = {"all": case.inner, "near": case.inner & near, "far": case.inner & ~near}
    for (method, halves), (pictures, seconds) in answers.items():
        apart = errors(pictures, case)
        yield {
            "scene": name, "views": VIEWS[halves], "method": method,
            **{REGIONS[key]: round(decibels(float(apart[mask].mean()), peak=255), 2)
               if mask.mean() > LEAST else np.nan for key, mask in masks.items()},
            "core s": seconds, "known dB": round(float(case.known_db), 1),
            "share near edges": masks["near"].sum() / masks["all"].sum(),
        }  # fmt: skip


SHOWN = ["views", "method", *REGIONS.values(), "worst scene dB", "core s"]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return means of dB and seconds over scenes, and the dB of the worst scene."""
    groups = rows.groupby(["views", "method"], sort=False)
    means = groups[[*REGIONS.values(), "core s"]].mean()
    means["worst scene dB"] = groups["all dB"].min()
    texts = {column: means[column].map("{:.1f}".format) for column in means.columns[:-2]}
    texts["worst scene dB"] = means["worst scene dB"].map("{:.1f}".format)
    texts["core s"] = means["core s"].map("{:.2f}".format)
    table = means.assign(**texts).reset_index().assign(scene="mean")
    return table.sort_values("views", ascending=False, kind="stable")


def window_of(case: Case, pictures: list[np.ndarray], halves: bool) -> tuple[slice, slice]:
    """Return the crop in which these pictures differ most from the true one."""
    apart = sum(np.square(display_values(p) - display_values(case.true(halves)[0])).mean(-1)
                for p in pictures)  # fmt: skip
    half = CROP_PX // 2
    sums = uniform_filter(np.where(case.inner, apart, 0), CROP_PX)[half:-half, half:-half]
    y, x = np.unravel_index(sums.argmax(), sums.shape)
    return slice(y, y + CROP_PX), slice(x, x + CROP_PX)


def figure(path: Path, cases: dict[str, Case], found: dict[str, Answers], halves: bool) -> None:
    """Write a sheet: a row of crops per scene, with each method's dB in the crop."""
    from lfcore.evaluation.figures import contact_sheet

    cells = []
    for name, case in cases.items():
        row = {method: pictures[0] for (method, is_half), (pictures, _) in found[name].items()
               if is_half == halves and method != "sharp picture"}  # fmt: skip
        window = window_of(case, [p for m, p in row.items() if "ours" not in m], halves)
        true = case.true(halves)[0][window]
        cells += [(case.sharp[window], f"{name}: sharp"), (true, "converged")]
        for method, picture in row.items():
            db = psnr(display_values(picture[window]), display_values(true), peak=255)
            cells.append((picture[window], f"{method}: {db:.1f} dB"))
    shown = [(np.clip(picture, 0, 1), label) for picture, label in cells]
    contact_sheet(path, shown, len(row) + 2, panel_px=240)


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.referee", description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=list(OPENED), choices=OPENED)
    parser.add_argument("--pixels", type=int, default=PIXELS)
    parser.add_argument("--set", type=Path, required=True, help="folder of converged pictures")
    parser.add_argument("--figures", type=Path, help="folder for crops")
    parser.add_argument("--shown", nargs="+", choices=OPENED, help="scenes of the figures")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    options.set.mkdir(parents=True, exist_ok=True)
    cases, found = {}, {}
    for name in options.scenes:
        stem = f"{name.replace(',', '').replace(' ', '-')}-{options.pixels}"
        tracer = cache(partial(prepared, name, options.pixels))
        file = options.set / f"{stem}.npz"
        if not file.exists():
            np.savez(file, **asdict(converged(tracer(), options.pixels)))
        cases[name] = Case(**np.load(file))
        found[name] = answers(options.set / f"{stem}-answers.npz", cases[name], tracer)
        say(f"{name}: {float(cases[name].known_db):.1f} dB")
    rows = [row for name in cases for row in judged(name, cases[name], found[name])]
    table = pd.DataFrame(rows)
    known = table["known dB"].min(), table["known dB"].median()
    share = table["share near edges"].mean()
    note = (
        f"{len(cases)} scenes of {options.pixels} x {options.pixels} pixels; converged pictures "
        f"are right to {known[0]:.0f} dB or more (median {known[1]:.0f}); {share:.0%} of pixels "
        "are near edges."
    )
    means = summary(table)
    both = pd.concat([means, table.round(3)])
    report(options.out, "python -m benchmarks.referee", both, note, {"": means[SHOWN]})
    shown = {name: cases[name] for name in options.shown or cases}
    for halves, label in VIEWS.items() if options.figures else ():
        figure(options.figures / f"referee-{label.split()[0]}.png", shown, found, halves)


if __name__ == "__main__":
    main()

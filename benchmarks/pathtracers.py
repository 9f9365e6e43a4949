"""Compares our pictures with path tracers': python -m benchmarks.pathtracers --out FILE.csv

Each picture is through the open round lens, focused near, in the middle or far.  Ours are by depth
and to a quality; Mitsuba 3 has the same shading, raw and with Intel's denoiser; Blender's Cycles
has its own denoiser, and the scene without highlights.  Seconds are processor seconds of all
threads, with scene and hierarchy loaded: the least of --repeats in turn after a warm-up.  dB are
against our converged picture, for Cycles against its own; the note reports how these agree.

    python -m benchmarks.pathtracers --out pathtracers.csv --figure pathtracers.png --crops crops/
    python -m benchmarks.pathtracers --scenes bike model.glb --pixels 128 --out pathtracers.csv

Only the best peer is timed in more than one size.
"""

import argparse
import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.lib.stride_tricks import sliding_window_view

from benchmarks.peers.cycles_lens import cycles_lens, matt
from benchmarks.peers.method import Samples, SkippedError
from benchmarks.peers.mitsuba import mitsuba_lens
from benchmarks.results import parser_of, report, say
from benchmarks.sample import SCENES
from lfcore.evaluation.figures import contact_sheet, save_figure
from lfcore.evaluation.true_picture import inner_psnr, true_pictures
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice
from lfcore.readers.load import load_scene
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.quality import Quality, QualitySearch
from lfcore.scene.model import Scene
from lfcore.timing import clocked
from lfcore.tracing.tracer import Tracer

TRUTH = Lattice(12, 4), Lattice(10, 5)
"""The two lattices of converged pictures."""
LATTICES = [Lattice(*sides) for sides in ((1, 1), (2, 1), (4, 1), (4, 1.5), (4, 2), (8, 2))]
"""The rays of our pictures by depth."""
QUALITIES_DB = (35, 40, 45)
"""The qualities of our pictures to a quality, dB."""
MITSUBA = {
    "Mitsuba": Samples(1),
    "Mitsuba + OIDN": Samples(1, "multijitter", "picture"),
    "Mitsuba random + OIDN": Samples(1, "independent", "picture"),
    "Mitsuba + OIDN, aux.": Samples(1, "multijitter", "auxiliary"),
}
CYCLES = {"Cycles": Samples(1, ""), "Cycles + OIDN": Samples(1, "", "picture")}
PEERS: dict[str, tuple[dict[str, Samples], Callable]] = {
    "mitsuba": (MITSUBA, mitsuba_lens), "cycles": (CYCLES, cycles_lens),
}  # fmt: skip
RAYS = (1, 4, 16, 64, 256)
"""The samples per pixel of a peer's pictures."""
IN_LARGE = "Mitsuba + OIDN"
"""The peer with the least error in equal time: the only one in sizes above the smallest."""
MOST_MRAYS = 17.0
"""The most rays of a picture, millions."""
CONVERGED = 1024
"""The samples per pixel of a peer's converged picture."""
PLANES = ("near", "middle", "far")
CROP_PX = 40
"""The side of a crop, pixels."""
CROP_SECONDS = 0.25
"""The most core seconds of a picture in the sheet of crops."""


@dataclass(frozen=True)
class Point:
    """A method with one setting; ``make()`` returns P pictures (P, M, M, 3) and core seconds."""

    method: str
    setting: str
    rays: float
    make: Callable[[], tuple[np.ndarray, np.ndarray]]


def ours(
    tracer: Tracer, planes: list[SensorPlane], pixels: int, most_rays: float
) -> Iterator[Point]:
    """Yield our methods, each picture by itself, and all planes from the same rays."""
    camera, alone, together = tracer.scene.camera, [[plane] for plane in planes], [planes]

    def by_depth(lattice: Lattice, wanted: list[SensorPlane]) -> np.ndarray:
        return pictures_by_depth(tracer, camera, wanted, pixels, lattice)

    def to_quality(quality: float, wanted: list[SensorPlane]) -> np.ndarray:
        search = QualitySearch(tracer, camera, wanted, pixels, Quality(quality))
        return search.pictures().pictures

    def timed(make: Callable, groups: list[list[SensorPlane]]) -> tuple[np.ndarray, np.ndarray]:
        runs = [clocked(partial(make, group), clock=time.process_time) for group in groups]
        per_picture = [np.full(len(part), seconds / len(part)) for part, seconds in runs]
        return np.concatenate([part for part, _ in runs]), np.concatenate(per_picture)

    for lattice in LATTICES:
        if (rays := lattice.rays_per_pixel) <= most_rays:
            for name, groups in (("", alone), (", planes together", together)):
                run = partial(timed, partial(by_depth, lattice), groups)
                yield Point(f"by depth{name}", str(lattice), rays, run)
    for quality in QUALITIES_DB:
        run = partial(timed, partial(to_quality, quality), alone)
        yield Point("to a quality", f"{quality} dB", np.nan, run)


def peer(
    kinds: dict[str, Samples], opened, scene: Scene, planes: list[SensorPlane], pixels: int,
    most_rays: float,
) -> Iterator[Point]:  # fmt: skip
    """Yield a peer's methods, with new samples in every run."""
    seeds = itertools.count(1)
    for (name, kind), rays in itertools.product(kinds.items(), RAYS):
        if rays <= most_rays:
            samples = replace(kind, per_pixel=rays)

            def run(samples=samples):
                runs = [
                    opened.picture(focused_camera(scene.camera, p), pixels, samples, next(seeds))
                    for p in planes
                ]
                pictures, seconds = zip(*runs, strict=True)
                return np.stack(pictures), np.array(seconds)

            yield Point(name, f"{rays} sample{'s' * (rays > 1)}", rays, run)


def measured(points: list[Point], repeats: int) -> Iterator[tuple[Point, np.ndarray, np.ndarray]]:
    """Yield each point's last pictures and least seconds; the points take turns."""
    seconds: dict[int, np.ndarray] = {}
    for turn in range(repeats + 1):
        for number, point in enumerate(points):
            pictures, run_seconds = point.make()
            if turn:
                seconds[number] = np.minimum(run_seconds, seconds.get(number, np.inf))
            if turn == repeats:
                yield point, pictures, seconds[number]


def rows_of(
    scene: Scene, points: list[Point], truths: np.ndarray, pixels: int, repeats: int,
    kept: dict[tuple, np.ndarray],
) -> Iterator[dict]:  # fmt: skip
    """Yield a row per point; pictures of the middle plane are kept for crops."""
    for point, pictures, seconds in measured(points, repeats):
        errors = [inner_psnr(*pair) for pair in zip(pictures, truths, strict=True)]
        kept[scene.name, pixels, point.method, point.setting] = pictures[1]
        row = {"scene": scene.name, "M": pixels, "method": point.method, "setting": point.setting}
        row |= {"rays per pixel": point.rays, "core s": f"{seconds.mean():.3g}"}
        yield row | {f"{n} dB": f"{dB:.1f}" for n, dB in zip(PLANES, errors, strict=True)}


def study(options: argparse.Namespace) -> tuple[pd.DataFrame, str, dict[tuple, np.ndarray]]:
    """Return all rows, a text on the agreement of converged pictures, and pictures for crops."""
    rows: list[dict] = []
    agreements: list[str] = []
    kept: dict[tuple, np.ndarray] = {}
    for name in options.scenes:
        path = SCENES / name if (SCENES / name).exists() else Path(name)
        scene = replace(load_scene(path, bare=True), name=path.stem)
        for peer_name in options.peers:
            is_matt, (kinds, open_peer) = peer_name == "cycles", PEERS[peer_name]
            shown = replace(matt(scene), name=f"{scene.name}, matt") if is_matt else scene
            try:
                opened = open_peer(shown, options.threads)
            except SkippedError as skipped:
                say(f"SKIPPED {peer_name}: {skipped}")
                continue
            tracer = open_tracer(shown)
            try:
                for pixels in options.pixels:
                    is_least = pixels == min(options.pixels)
                    timed = {n: kind for n, kind in kinds.items() if is_least or n == IN_LARGE}
                    if not timed:
                        continue
                    more, dB = one_size(shown, tracer, opened, timed, pixels, options, kept)
                    rows += more
                    agreements.append(f"{shown.name} {pixels}: {dB:.0f} dB")
            finally:
                opened.close()
    return pd.DataFrame(rows), "; ".join(agreements), kept


def one_size(scene, tracer, opened, kinds, pixels, options, kept) -> tuple[list[dict], float]:
    """Return a size's rows, and the dB between converged pictures of the middle plane."""
    near, *_, far = scene.focus_distances_m
    middle = scene.focus_distances_m[len(scene.focus_distances_m) // 2]
    planes = [SensorPlane(focus, scene.camera.f_number) for focus in (near, middle, far)]
    say(f"{scene.name}, {pixels} pixels: converged pictures")
    truths = true_pictures(tracer, planes, pixels, TRUTH).pictures
    theirs, has_own_truth = truths.copy(), kinds == CYCLES
    converged = replace(next(iter(kinds.values())), per_pixel=CONVERGED)
    for index in range(len(planes)) if has_own_truth else [1]:
        camera = focused_camera(scene.camera, planes[index])
        theirs[index], _ = opened.picture(camera, pixels, converged, 0)
    agreement_db = inner_psnr(truths[1], theirs[1])
    judge = theirs if has_own_truth else truths
    kept[scene.name, pixels, "true", ""] = truths[1]
    most = options.most_mrays * 1e6 / pixels**2
    points = list(ours(tracer, planes, pixels, most))
    rows = list(rows_of(scene, points, truths, pixels, options.repeats, kept))
    points = list(peer(kinds, opened, scene, planes, pixels, most))
    rows += rows_of(scene, points, judge, pixels, options.repeats, kept)
    for row in rows:
        say(" ".join(map(str, row.values())))
    return rows, agreement_db


SHOWN = {
    "": (["bike", "bedroom"], ["by depth", "to a quality", "Mitsuba + OIDN"],
         ["4 x 1", "4 x 2", "40 dB", "16 samples", "64 samples"]),
    "_matt": (["bike, matt", "bedroom, matt"], ["by depth", "Cycles + OIDN"],
              ["4 x 1", "64 samples"]),
}  # fmt: skip
"""The scenes, methods and settings of the published tables; their size is the largest."""


def shown(table: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Return the published rows by the suffix of their file."""
    tables = {}
    for suffix, (scenes, methods, settings) in SHOWN.items():
        rows = table[table["scene"].isin(scenes)]
        rows = rows[rows["M"].astype(int) == rows["M"].astype(int).max()]
        rows = rows[rows["method"].isin(methods) & rows["setting"].isin(settings)]
        tables[suffix] = rows.drop(columns=["rays per pixel"])
    return tables


def figure(table: pd.DataFrame, path: Path) -> None:
    """Draw dB (mean of the three planes) over core seconds, a line per method and a panel per
    scene; matt scenes are drawn only if there are no others."""
    from matplotlib.figure import Figure

    table = table[table["M"] == table["M"].min()]
    is_matt = table["scene"].str.endswith(", matt")
    table = table if is_matt.all() else table[~is_matt]
    scenes = table["scene"].unique()
    drawn = Figure(figsize=(3.6 * len(scenes), 3.8))
    panels = np.atleast_1d(drawn.subplots(1, len(scenes), sharey=True))
    methods = list(table["method"].unique())
    for panel, scene in zip(panels, scenes, strict=True):
        rows = table[table["scene"] == scene]
        for method, curve in rows.groupby("method", sort=False):
            dB = curve[[f"{name} dB" for name in PLANES]].astype(float).mean(axis=1)
            is_ours = method.startswith(("by depth", "to a"))
            panel.plot(
                curve["core s"].astype(float), dB, "o-" if is_ours else "s--", ms=4,
                color=f"C{methods.index(method)}", label=method,
            )  # fmt: skip
        panel.set(xscale="log", xlabel="core seconds per picture", title=scene)
    panels[0].set_ylabel("PSNR, dB (mean of three planes)")
    lines: dict[str, Any] = {}
    for panel in panels:
        lines |= dict(zip(*reversed(panel.get_legend_handles_labels()), strict=True))
    drawn.legend(list(lines.values()), list(lines), loc="outside lower center", ncols=3)
    save_figure(path, drawn)


def crops(table: pd.DataFrame, kept: dict[tuple, np.ndarray], folder: Path) -> None:
    """Write a sheet per scene: a detail of each method's best picture within CROP_SECONDS."""
    for (scene, pixels), rows in table.groupby(["scene", "M"]):
        true = kept[scene, pixels, "true", ""]
        x, y = busiest(true)
        window = np.s_[y : y + CROP_PX, x : x + CROP_PX]
        cells = [(true[window], "converged")]
        for method, curve in rows.groupby("method", sort=False):
            seconds = curve["core s"].astype(float)
            if (seconds <= CROP_SECONDS).any() and "together" not in method:
                best = curve.loc[curve["middle dB"][seconds <= CROP_SECONDS].astype(float).idxmax()]
                label = f"{method}, {best['setting']}: {best['middle dB']} dB"
                cells.append((kept[scene, pixels, method, best["setting"]][window], label))
        name = f"{scene}-{pixels}".replace(", ", "-")
        contact_sheet(folder / f"{name}.png", cells, 4, panel_px=360)


def busiest(picture: np.ndarray) -> tuple[int, int]:
    """Return the corner (x, y) of the window with most detail, away from the border."""
    detail = np.hypot(*np.gradient(picture.mean(axis=2)))
    border = len(picture) // 10 + 1
    sums = sliding_window_view(detail, (CROP_PX, CROP_PX)).sum((2, 3))[border:, border:]
    inner = sums[: 1 - border, : 1 - border]
    y, x = np.unravel_index(inner.argmax(), inner.shape)
    return int(x) + border, int(y) + border


def main() -> None:
    parser = parser_of(__doc__ or "", pixels=[128, 256, 512])
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--crops", type=Path, help="folder of crops at equal time")
    parser.add_argument("--peers", nargs="+", default=list(PEERS), choices=PEERS)
    parser.add_argument("--most-mrays", type=float, default=MOST_MRAYS, help="per picture")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    table, agreement, kept = study(options)
    note = f"Converged pictures of the peers agree with ours: {agreement}."
    report(options.out, "python -m benchmarks.pathtracers", table, note, shown(table))
    if options.figure:
        figure(table, options.figure)
    if options.crops:
        crops(table, kept, options.crops)


if __name__ == "__main__":
    main()

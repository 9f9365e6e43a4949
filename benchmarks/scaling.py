"""The scaling model: its rates, the runs that it is held to, its table and its figure.

    python -m benchmarks.scaling --measure rates points      # 8 minutes on two quiet cores
    python -m benchmarks.scaling                             # table and figure from what is kept

``--measure rates`` fills benchmarks/published/scaling_rates.csv, ``--measure points``
scaling_points.csv, and both then draw docs/pictures/scaling.png and fill scaling.csv;
``python -m benchmarks.publish`` writes the documents.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pandas as pd

from benchmarks import scaling_points as measured
from benchmarks.publish import RESULTS, ROOT, Result, of_this_run, read_result, with_kept
from lfcore.evaluation import figures
from lfcore.workflow import scaling
from lfcore.workflow.scaling import Overheads, Rates
from robustness.local_slurm import local_slurm

FIGURE = ROOT / "docs" / "pictures" / "scaling.png"
POINTS = RESULTS / "scaling_points.csv"
LARGE_VIEWS, LARGE_PIXELS, LARGE_TILE_MIB = 512, 512, 96
"""What the large light fields' rates are drawn from: the thesis's N, tiles of 128 macropixels."""
JOB_MINUTES = 10.0
"""profiles/slurm."""
SHARED_STORAGE = 1e9
"""Bytes a second: assumed of a cluster's storage, where this machine's disk says nothing."""
THESIS = 512.0**4
"""Rays of its largest light fields."""
RAYS = (1e10, THESIS, 1e11, 1e12, 1e13, 1e14, 1e15)
CORES = (1, 3, 10, 30, 100, 300, 1000, 3000, 10_000)
QUIET = 0.2
"""Cores that others may use while the clock of the wall says something."""
ALL = "any"
"""The column of what is of no scene."""
RUNS = {"1 core": (1, False), "2 cores": (2, False),
        "SLURM, 1 place": (1, True), "SLURM, 2 places": (2, True)}  # fmt: skip


def measure_rates(account: measured.Account, folder: Path) -> pd.DataFrame:
    """A row a rate; a column for each scene and N, and one for what is of none."""
    columns: dict[str, dict[str, float]] = {ALL: {}}

    def keep(column: str, found: dict[str, float]) -> None:
        columns.setdefault(column, {}).update(found)
        print(column, found, flush=True)

    for scene in measured.SCENES:
        size = measured.Size(scene, measured.PIXELS, measured.BATCHES, measured.TILE_MIB)
        here = measured.overheads_here(account, folder / scene, size)
        results = folder / scene / "few" / "results" / scene
        keep(f"{scene} {measured.VIEWS}", here | asdict(measured.rates_of(results, size)))
        if scene == measured.SCENES[0]:
            keep(ALL, measured.overheads_of_slurm(account, folder, scene, here["many_s"]))
            large = measured.Size(scene, LARGE_PIXELS, 1, LARGE_TILE_MIB)
            sampled = measured.rates_of(results, large, LARGE_VIEWS)
            retrieve = {"retrieve_ns": measured.retrieve_ns(scene)}
            keep(f"{scene} {LARGE_VIEWS}", asdict(sampled) | retrieve)
    keep(ALL, measured.published_rates())
    keep(ALL, {"picture_ns": measured.picture_ns()})
    disk = {"sum_bytes_s": measured.sum_bytes_s(), "storage_bytes_s": measured.disk_bytes_s()}
    keep(ALL, disk)
    table = pd.DataFrame(columns).map(lambda value: "" if pd.isna(value) else f"{value:.4g}")
    return table.rename_axis("rate").reset_index()


def rates(kept: pd.DataFrame, scene: str, views: int) -> Rates:
    """Of a scene and N, from what was measured."""
    found = _values(kept, f"{scene} {views}")
    known = {field.name for field in fields(Rates)}
    given: dict[str, Any] = {name: value for name, value in found.items() if name in known}
    return Rates(**given | {"planes": int(given["planes"])})


def overheads(kept: pd.DataFrame, scene: str, storage_bytes_s: float | None = None) -> Overheads:
    """Of a scene's jobs and of SLURM's submissions; ``storage_bytes_s`` of another storage."""
    found, here = _values(kept, ALL), _values(kept, f"{scene} {measured.VIEWS}")
    few = (measured.PILOT_PIXELS * measured.VIEWS) ** 2
    work = few * (here["trace_ns"] + here["encode_ns"]) * 1e-9
    # What two batches take beside their plan, rays and starts: the scene, the join and the sum.
    beside = here["few_s"] - here["plan_s"] - 2 * here["start_s"] - work
    known = {field.name for field in fields(Overheads)}
    return Overheads(**{
        **{name: value for name, value in found.items() if name in known},
        "plan_s": here["plan_s"], "start_s": here["start_s"],
        "scene_s": beside / 2, "close_s": beside / 2, "poll_s": measured.FIRST_POLL,
        "storage_bytes_s": storage_bytes_s or found["storage_bytes_s"],
    })  # fmt: skip


def _values(kept: pd.DataFrame, column: str) -> dict[str, float]:
    rows = kept[kept[column] != ""]
    return dict(zip(rows.rate, rows[column].astype(float), strict=True))


def written(part: str, found: pd.DataFrame, command: str) -> None:
    """What was measured, as soon as it was."""
    Result(of_this_run(command), found).write(RESULTS / f"scaling_{part}.csv")


def measure_points(account: measured.Account, folder: Path, run: str) -> pd.DataFrame:
    """A row a scene: what the run took; with the rows kept of other runs, each of its commit."""
    rows = []
    cores, submitted = RUNS[run]
    for scene in measured.SCENES:
        size = measured.Size(scene, measured.PIXELS, measured.BATCHES, measured.TILE_MIB)
        place = folder / f"{scene}-{cores}-{submitted}"
        if submitted:
            with local_slurm(
                folder / f"s{scene}{cores}", cores=cores, memory_mib=measured.MEMORY_MIB
            ) as slurm:
                taken = measured.through_slurm(account, slurm, place, size)
        else:
            taken = measured.local(account, place, size, cores)
        rows.append({
            "scene": scene, "run": run, "core s": f"{taken.core_s:.1f}",
            "wall s": f"{taken.wall_s:.1f}", "others": f"{taken.others:.2f}",
        })  # fmt: skip
        print(rows[-1], flush=True)
    found = with_kept(pd.DataFrame(rows), POINTS.stem, "run")
    return found.sort_values("run", key=lambda names: names.map(list(RUNS).index), kind="stable")


def beside_model(points: pd.DataFrame, kept: pd.DataFrame) -> pd.DataFrame:
    """Measured points with what the model says of each."""
    rows = []
    for point in points.to_dict("records"):
        cores, submitted = RUNS[point["run"]]
        scene = point["scene"]
        size = measured.Size(scene, measured.PIXELS, measured.BATCHES, measured.TILE_MIB)
        said = scaling.estimate(
            size.field, rates(kept, scene, measured.VIEWS), overheads(kept, scene), cores,
            submitted=submitted,
        )  # fmt: skip
        rows.append({"scene": scene, "run": point["run"]})
        for what, seconds in (("core s", said.core_seconds), ("wall s", said.seconds)):
            rows[-1] |= {
                what: point[what], f"model's {what}": f"{seconds:.1f}",
                f"{what} / model's": f"{float(point[what]) / seconds:.2f}",
            }  # fmt: skip
        rows[-1] |= {"others": point["others"], "commit": point["commit"]}
    return pd.DataFrame(rows)


def extrapolated(kept: pd.DataFrame) -> pd.DataFrame:
    """A row for each number of rays and cores: hours, core hours, and what binds."""
    scene = measured.SCENES[0]
    ours, beside = rates(kept, scene, LARGE_VIEWS), overheads(kept, scene, SHARED_STORAGE)
    rows = []
    for rays in RAYS:
        field = scaling.planned(rays, LARGE_VIEWS, JOB_MINUTES)
        for cores in CORES:
            run = scaling.estimate(field, ours, beside, cores, submitted=True)
            more = scaling.estimate(field, ours, beside, cores, submitted=True, retrieved=True)
            over = 1 - field.rays * ours.ray_s / run.core_seconds
            rows.append({
                "rays": f"{rays:.2g}", "cores": cores, "jobs": field.batches,
                "hours": f"{run.seconds / 3600:.3g}",
                "core hours": f"{run.core_seconds / 3600:.3g}",
                "beside rays": f"{over:.1%}", "bound by": run.bound,
                "hours with retrieval": f"{more.seconds / 3600:.3g}",
            })  # fmt: skip
    return pd.DataFrame(rows)


def draw(table: pd.DataFrame, points: pd.DataFrame) -> None:
    """Hours over cores, a line for each number of rays; and points, if any, over the model."""
    figure = plt.figure(figsize=(11 if len(points) else 7, 5))
    left, *beside = figure.subplots(1, 2, width_ratios=(3, 2)) if len(points) else [figure.gca()]
    colours = plt.get_cmap("viridis")
    drawn = table[table.rays != f"{THESIS:.2g}"]
    for place, (rays, rows) in enumerate(drawn.groupby("rays", sort=False)):
        colour, hours = colours(place / 6), rows.hours.astype(float)
        left.plot(rows.cores, hours, "o-", color=colour, ms=4)
        left.plot(rows.cores, rows["hours with retrieval"].astype(float), ":", color=colour)
        core_hours = float(rows["core hours"].iloc[0])
        label = f"$10^{{{str(rays)[-2:]}}}$ rays\n{core_hours:,.2g} core h"
        if core_hours >= 10:
            label = f"$10^{{{str(rays)[-2:]}}}$ rays\n{core_hours:,.0f} core h"
        left.annotate(label, (1, hours.iloc[0]), xytext=(-8, 0), textcoords="offset points",
                      ha="right", va="center", color=colour, fontsize=9)  # fmt: skip
    left.set(xscale="log", yscale="log", xlabel="cores", ylabel="hours", xlim=(0.06, 2e4),
             xticks=CORES[::2], title="One light field, N = 512, jobs of ten minutes")  # fmt: skip
    left.plot([], [], "ko-", ms=4, label="recorded, with its planes")
    left.plot([], [], "k:", label="and planes formed from the video")
    left.legend(loc="upper right", fontsize=9)
    if len(points):
        draw_points(beside[0], points)
    figures.save_figure(FIGURE, figure, dpi=110)


def draw_points(right: plt.Axes, points: pd.DataFrame) -> None:
    """Core seconds of each run over the model's, wall seconds where nobody else was at work, and
    what lies within a fifth."""
    quiet = points.others.astype(float) < QUIET
    for what, mark, shown in (("core s", "o", quiet | True), ("wall s", "x", quiet)):
        if shown.any():
            ratios = points[f"{what} / model's"].astype(float).where(shown)
            right.plot(ratios, range(len(points)), mark, label=what)
    names = [f"{point['scene']}, {point['run']}" for point in points.to_dict("records")]
    right.set_yticks(range(len(points)), names, fontsize=9)
    right.axvspan(0.8, 1.2, alpha=0.12, color="green")
    right.axvline(1, color="gray", lw=1)
    right.invert_yaxis()
    least, most = right.get_xlim()
    right.set_xlim(min(least, 0.6), max(most, 1.5))
    right.set(xlabel="measured / model's", title=r"Runs of $2.7 \times 10^8$ rays, N = 64")
    right.legend(fontsize=9)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--measure", nargs="+", choices=("rates", "points"), default=[])
    parser.add_argument("--runs", nargs="+", choices=RUNS, default=list(RUNS), help="of the points")
    options = parser.parse_args()
    command = f"python -m benchmarks.scaling --measure {' '.join(options.measure)}"
    account = measured.Account()
    # SLURM's sockets want a short name.
    with tempfile.TemporaryDirectory(prefix="lf", dir="/tmp") as name:
        folder = Path(name)
        folder.chmod(0o755)
        if "rates" in options.measure:
            written("rates", measure_rates(account, folder / "rates"), command)
        for run in options.runs if "points" in options.measure else ():
            written("points", measure_points(account, folder / "points", run), command)
    kept = read_result(RESULTS / "scaling_rates.csv")
    table = extrapolated(kept.rows)
    provenance = kept.provenance | {"command": "python -m benchmarks.scaling"}
    Result(provenance, table).write(RESULTS / "scaling.csv")
    points = pd.DataFrame()
    if POINTS.exists():
        held = read_result(POINTS)
        points = beside_model(held.rows, kept.rows)
        Result(held.provenance, points).write(POINTS)
        print(points.to_string(index=False))
    draw(table, points)
    print(table.to_string(index=False))
    return 0


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # and so end SLURM's servers, too
    sys.exit(main())

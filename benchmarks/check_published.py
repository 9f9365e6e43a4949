"""One cell of the published full-size tables, made again: make check-published CELL=bike,64

The cell is traced, stored and read with the settings of docs/results/settings.yaml, in
build/check-published, and held against docs/results: bytes, ratio, PSNR and SSIM must be equal to
the digits that are published.  PSNR and SSIM of table 7.1 are against the largest N, which is not
made again: they are as published where the pictures are, to the last bit.

Seconds are judged on the published processor alone.  They may differ by the share of the time for
which the jobs had no core, then and now, and by what repeated runs of one tile differ in seconds of
a core, which REPEATED says.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.full_size import FOLDER, SETTINGS, core_share, pictures_digest, shown
from benchmarks.publish import ROOT, PublishError, read_result
from lfcore.evaluation.metrics import picture_quality
from lfcore.evaluation.tables import DECIMALS, sizes
from lfcore.files import read_json
from lfcore.optics.plane_pictures import load_stack
from lfcore.scene.reading import read_yaml
from lfcore.timing import duration, machine
from lfcore.workflow.costs import job_cost
from lfcore.workflow.forecast import START_SECONDS
from lfcore.workflow.progress import TOOK
from lfcore.workflow.reports import THESIS

BUILD = ROOT / "build" / "check-published"
REPEATED = 0.15
"""Three standard deviations of the difference of two runs: one run's is 3.6% (bike, a tile of
N = 64 traced and encoded eight times, AMD EPYC with all cores taken; 1.5% at N = 512)."""
LONG_VIEWS = 64
"""Larger N take long."""
FILES = (
    "planes/on_the_fly.npz", "trace.json", "lightfield.mkv", "store.json", "retrieve.json",
    "planes/from_video.npz",
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """One number of a cell: as it is published, as it is now, and whether that will do."""

    what: str
    published: str
    now: str
    good: bool
    words: str = ""

    def __str__(self) -> str:
        verdict = "as published" if self.good else "DIFFERS"
        return f"{self.what:32} {self.published:>12} {self.now:>12}  {self.words or verdict}"


def published_cell(cell: str, folder: Path) -> tuple[dict[str, dict], dict[str, str]]:
    """The rows of a cell ``scene,N`` by table, those of ``cells`` among them, and the run's facts.

    Raises :class:`PublishError` for a cell that is not there.
    """
    if not (folder / "cells.csv").is_file():
        raise PublishError(
            "no run at full size is published", file=folder,
            remedy="Run it, then: python -m benchmarks.publish --take full",
        )  # fmt: skip
    results = {name: read_result(folder / f"{name}.csv") for name in (*THESIS, "cells")}
    scene, _, views = cell.partition(",")
    found = {}
    for name, result in results.items():
        rows = result.rows[(result.rows.scene == scene) & (result.rows.N == views.strip())]
        if rows.empty:
            pairs = zip(result.rows.scene, result.rows.N, strict=True)
            raise PublishError(
                f"has no cell {cell!r}", file=folder / f"{name}.csv", key="CELL",
                remedy=f"It has {' '.join(f'{one},{n}' for one, n in pairs)}",
            )  # fmt: skip
        found[name] = rows.iloc[0].to_dict()
    return found, results["cells"].provenance


def make(scene: str, views: int, pixels: int, cores: int, folder: Path) -> Path:
    """Make a cell anew, and say where.  Raises :class:`PublishError` where the run fails."""
    place = BUILD / "results" / scene / f"M{pixels}" / f"N{views}"
    shutil.rmtree(place, ignore_errors=True)
    targets = [str(place.relative_to(BUILD) / file) for file in FILES]
    words = [
        "--cores", str(cores), "--directory", str(BUILD), "--configfile", str(folder / SETTINGS),
        "--config", f"scenes=[{scene}]", f"angular_resolutions=[{views}]", "--", *targets,
    ]  # fmt: skip
    BUILD.mkdir(parents=True, exist_ok=True)
    (BUILD / TOOK).unlink(missing_ok=True)
    done = subprocess.run(
        [sys.executable, "-m", "lfcore.workflow.run", *words], cwd=ROOT, check=False
    )
    if done.returncode:
        raise PublishError("could not be made again", file=place)
    return place


def compared(rows: dict[str, dict], provenance: dict[str, str], place: Path) -> list[Line]:
    """Every number of the cell in ``place`` beside what is published of it."""
    scene, views, pixels = (rows["cells"][name] for name in ("scene", "N", "M"))
    traced, stored, retrieved = (
        read_json(place / f"{name}.json") for name in ("trace", "store", "retrieve")
    )
    share = core_share(BUILD / TOOK, scene, int(views), int(pixels))
    tolerance = (1 - float(rows["cells"]["core_share"])) + (1 - share) + REPEATED
    same = provenance["processor"].split(",")[0] == str(machine()["processor"])
    seconds = {
        "table_7_1": traced["seconds"],
        "table_7_2": stored["encode_seconds"] + stored["join_seconds"],
        "table_7_3": retrieved["seconds"],
    }
    lines = [_seconds(THESIS[t], rows[t], now, tolerance, same) for t, now in seconds.items()]
    digest = pictures_digest(place / "planes" / "on_the_fly.npz")
    equal = digest == rows["cells"]["pictures"]
    lines.append(Line("pictures traced", rows["cells"]["pictures"], digest, equal))
    for name in ("psnr_db", "ssim"):
        was = rows["table_7_1"][name]
        words = "" if equal else "not known: other pictures than those published"
        lines.append(Line(f"Table 7.1: {name}", was, was if equal else "", equal, words))
    size = sizes(rays=traced["rays"], video_bytes=stored["video_bytes"])
    for name in ("video_bytes", "ratio_float32"):
        lines.append(_exact("Table 7.2", name, rows["table_7_2"], size[name]))
    stacks = [
        load_stack(place / "planes" / f"{name}.npz")[0] for name in ("from_video", "on_the_fly")
    ]
    for name, value in picture_quality(*stacks).items():
        lines.append(_exact("Table 7.3", name, rows["table_7_3"], value))
    return lines


def _exact(title: str, name: str, row: dict, value: float) -> Line:
    now = round(value, DECIMALS[name]) if name in DECIMALS else value
    return Line(f"{title}: {name}", str(row[name]), str(now), float(row[name]) == now)


def _seconds(title: str, row: dict, now: float, tolerance: float, same: bool) -> Line:
    was = float(row["seconds"])
    ratio = now / was if was else float("inf")
    off = abs(ratio - 1) > tolerance
    words = f"{ratio:.2f} times, may differ by {tolerance:.0%}"
    if not same:
        words, off = f"{ratio:.2f} times, on another processor: not judged", False
    what = f"{title.partition(':')[0]}: seconds"
    return Line(what, shown("seconds", was), shown("seconds", now), not off, words)


def warning(scene: str, views: int, pixels: int, cores: int) -> str:
    """How long a cell that takes long will take; empty for others."""
    if views <= LONG_VIEWS:
        return ""
    stages = [job_cost(name, scene, views, pixels) for name in ("trace", "join", "retrieve")]
    wait = sum(one.core_seconds for one in stages) / cores + 10 * START_SECONDS
    return (
        f"N = {views} takes about {duration(wait)} on {cores} cores; to N = {LONG_VIEWS}, minutes."
    )


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        "benchmarks.check_published", description=__doc__.splitlines()[0]
    )
    parser.add_argument("cell", metavar="SCENE,N", help="such as bike,64")
    parser.add_argument("--cores", type=int, default=2)
    options = parser.parse_args(argv)
    try:
        rows, provenance = published_cell(options.cell, FOLDER)
        settings = read_yaml(FOLDER / SETTINGS)
        scene, views = rows["cells"]["scene"], int(rows["cells"]["N"])
        pixels = settings["spatial_resolution"]
        if words := warning(scene, views, pixels, options.cores):
            print(words, flush=True)
        place = make(scene, views, pixels, options.cores, FOLDER)
        lines = compared(rows, provenance, place)
    except (OSError, ValueError, PublishError) as error:
        print(error, file=sys.stderr)
        return 1
    print("Published at commit {commit}, {date}, on {processor}.".format(**provenance))
    print(f"{'':32} {'published':>12} {'now':>12}")
    print("\n".join(map(str, lines)))
    return int(not all(line.good for line in lines))


if __name__ == "__main__":
    sys.exit(main())

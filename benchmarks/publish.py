"""Write the published numbers into the documents, from result files, never by hand.

    python -m benchmarks.publish                          # documents anew
    python -m benchmarks.publish --check                  # say which are stale, status 1
    python -m benchmarks.publish --take tables_m128 --command "make tables" results/tables
    python -m benchmarks.publish --take true_picture --command "make tables" results/tables
    python -m benchmarks.publish --take full --command "snakemake ..." results    # docs/results/
    python -m benchmarks.publish --take peers --command "python benchmarks/tracer.py ..." tracer.csv

A document has a place for a result file,

    <!-- published: NAME -->
    ...
    <!-- end of NAME -->

between whose lines the table is written, with its columns, or those of ``NAME: a; b; c``, and only
the rows of ``NAME where N in 64 512 and method in "by depth"``.
"""

import argparse
import re
import shlex
import sys
from pathlib import Path

import pandas as pd

from benchmarks import full_size
from benchmarks.results import (
    RESULTS,
    ROOT,
    PublishError,
    markdown,
    of_this_run,
    read_result,
    source,
    wrapped,
    write_result,
)
from lfcore.errors import LfcoreError
from lfcore.evaluation.work_precision.points import ON_THE_FLY
from lfcore.evaluation.work_precision.study import BY_DEPTH, NEAREST, TO_QUALITY
from lfcore.files import write_text
from lfcore.reading import read_yaml
from lfcore.workflow.keys import DEFAULT_SCENES
from lfcore.workflow.settings import check_settings

DOCUMENTS = (
    "README.md",
    "docs/measured.md",
    "docs/performance.md",
    "docs/notebook/tracer.md",
    "docs/robustness.md",
)
PLACE = re.compile(
    r"(<!-- published: (\w+)(?:: ([^>\n]*?))?(?: where ([^>\n]*?))? -->\n)"
    r".*?(<!-- end of \2 -->)",
    re.DOTALL,
)
TRACED = {"seconds": "trace s", "psnr_db": "PSNR dB (7.1)",
          "psnr_true_db": "true PSNR dB (7.1)", "ssim": "SSIM"}  # fmt: skip
RETRIEVED = {"seconds": "retrieve s", "psnr_db": "PSNR dB (7.3)",
             "psnr_true_db": "true PSNR dB (7.3)", "ssim": "SSIM (7.3)"}  # fmt: skip
HITS = "hits, Mrays per core-second"


def tables(folder: Path) -> pd.DataFrame:
    """The thesis's three tables of a run side by side, a row per scene and N."""
    parts = []
    for name, columns in (
        ("table_7_1", TRACED),
        ("table_7_2", {"seconds": "encode s", "ratio_float32": "ratio to 12 bytes per ray"}),
        ("table_7_3", RETRIEVED),
    ):
        table = pd.read_csv(folder / f"{name}.csv").set_index(["scene", "N"])[list(columns)]
        parts.append(table.rename(columns=columns))
    both = pd.concat(parts, axis=1).reset_index()
    digits = {"SSIM": 4, "SSIM (7.3)": 4, "ratio to 12 bytes per ray": 0}
    for column in both.columns.drop(["scene", "N"]):
        both[column] = [f"{value:.{digits.get(column, 1)}f}" for value in both[column]]
    return both


def peers(file: Path) -> pd.DataFrame:
    """Of a run of ``benchmarks/tracer.py`` by scene and N: beside Embree's, the better of its
    packets."""
    table = pd.read_csv(file, comment="#").set_index(["scene", "N"])

    def fastest(method: str) -> pd.Series:
        rates = table.mrays_per_core_second[table.method.str.startswith(method)]
        return rates.groupby(level=["scene", "N"], sort=False).max()

    ours, embree = fastest("lfcore"), fastest("embree, ")
    both = pd.DataFrame({HITS: ours, "Embree 3": embree, "times Embree": ours / embree})
    return both.dropna().map("{:.3g}".format).reset_index()


def true_picture(folder: Path) -> pd.DataFrame:
    """The points of a run that are traced on the fly, by depth and at N = 512: the PSNR of the
    worst plane, and the fraction of the seconds that N = 512 takes.  Points that the truth cannot
    judge are left out."""
    table = pd.read_csv(folder / "work_precision.csv")
    table = table[(table.panel == ON_THE_FLY) & table.note.isna()]
    recipe = (table.method == NEAREST) & (table.setting == "512 x 1")
    shown = table[recipe | table.method.isin([BY_DEPTH, TO_QUALITY])]
    whole = shown[shown.setting == "512 x 1"].groupby("scene").seconds.max()
    return pd.DataFrame({
        "scene": shown.scene, "f-number": shown.f_number, "method": shown.method,
        "lattice": shown.setting, "rays per pixel": shown.rays_per_pixel.map("{:.0f}".format),
        "core s": shown.seconds.map("{:.2f}".format),
        "worst dB": shown.psnr_true_db.map("{:.1f}".format),
        "of N = 512": (shown.scene.map(whole) / shown.seconds).map("1/{:.0f}".format),
    })  # fmt: skip


TAKERS = {"peers": peers, "true_picture": true_picture}


def published(text: str) -> str:
    """A document with the table of each of its places."""
    last = {place[2]: place.start() for place in PLACE.finditer(text)}

    def filled(place: re.Match) -> str:
        """The place with its table; a document's last one of a result has its source."""
        is_last = place.start() == last[place[2]]
        return f"{place[1]}\n{_place(place, is_last)}\n\n{place[5]}"

    return PLACE.sub(filled, text)


def _place(place: re.Match, with_source: bool) -> str:
    provenance, rows = read_result(RESULTS / f"{place[2]}.csv")
    for condition in filter(None, (place[4] or "").split(" and ")):
        column, _, values = condition.partition(" in ")
        rows = rows[_known(rows, column, place[2]).isin(shlex.split(values))]
    if place[3]:
        names = [name.strip() for name in place[3].split(";")]
        rows = pd.DataFrame({name: _known(rows, name, place[2]) for name in names})
    below = ["", *wrapped(source(provenance))] if with_source else []
    return "\n".join([*markdown(rows), *below])


def _known(rows: pd.DataFrame, column: str, result: str) -> pd.Series:
    if column not in rows:
        raise PublishError(f"{result} has no column {column!r}")
    return rows[column]


def documents() -> dict[Path, str]:
    """Every document with published numbers, as it should read."""
    paths = [ROOT / name for name in DOCUMENTS]
    return {path: published(path.read_text(encoding="utf-8")) for path in paths}


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser("benchmarks.publish", description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; 1 if one is stale")
    parser.add_argument("--take", metavar="NAME", help="keep the tables of a run as this result")
    parser.add_argument("--command", default="make tables", help="what made them")
    parser.add_argument("--note", default="", help="what else is to be known")
    parser.add_argument("--configfile", type=Path, default=ROOT / "config" / "thesis.yaml",
                        help="of a run at full size (config/thesis.yaml)")  # fmt: skip
    parser.add_argument("folder", nargs="?", type=Path, default=ROOT / "results" / "tables",
                        help="of tables; of peers a file")  # fmt: skip
    options = parser.parse_args(argv)
    try:
        if options.take:
            note = {"note": options.note} if options.note else {}
            provenance = of_this_run(options.command, **note)
        if options.take == "full":
            given = {"scenes": list(DEFAULT_SCENES)} | read_yaml(options.configfile)
            full_size.publish(options.folder, provenance, check_settings(given))
        elif options.take:
            rows = TAKERS.get(options.take, tables)(options.folder)
            write_result(RESULTS / f"{options.take}.csv", provenance, rows)
        stale = [path for path, text in documents().items() if path.read_text("utf-8") != text]
        for path in stale:
            print(f"{path.relative_to(ROOT)} {'is stale' if options.check else 'written'}")
            if not options.check:
                write_text(path, documents()[path])
    except (LfcoreError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    return int(options.check and bool(stale))


if __name__ == "__main__":
    sys.exit(main())

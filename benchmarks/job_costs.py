"""What jobs take, as runs measured it: python -m benchmarks.job_costs TOOK.csv ...

Every run of the workflow writes what each job took into .snakemake/took.csv.  Its rows, summed over
the jobs of a stage, scene, N and M, replace those of lfcore/workflow/job_costs.csv, from which the
time, the disk and the memory of a run are told before it starts.  A stage of which only some tiles
were traced is told from them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import pandas as pd

from benchmarks.publish import Result, of_this_run
from lfcore.workflow.costs import JOB_COSTS

KEYS = ["stage", "scene", "N", "M"]
SUMMED = ["core_seconds", "kept_bytes", "temporary_bytes"]
SHORT_SECONDS = 1.0
"""Stages that take less for every scene and N are left out: they cost what a small job costs."""


def read(file: Path) -> pd.DataFrame:
    return pd.read_csv(file, comment="#", keep_default_na=False)


def costs(took: Iterable[Path]) -> pd.DataFrame:
    """A row a stage, scene, N and M: a job that ran twice counts by its share, so once."""
    rows = pd.concat([read(file) for file in took])
    cells = rows.groupby(KEYS, sort=False)
    found = cells[SUMMED].sum().div(cells["share"].sum(), axis=0)
    found.insert(1, "mib", cells["mib"].max())
    return found.reset_index()


def merged(old: pd.DataFrame, new: pd.DataFrame) -> pd.DataFrame:
    """Rows of both, of ``new`` where both have one; without stages that are always short."""
    both = pd.concat([old, new])[[*KEYS, "core_seconds", "mib", "kept_bytes", "temporary_bytes"]]
    both = both.astype({"core_seconds": float}).drop_duplicates(KEYS, keep="last").sort_values(KEYS)
    long = both.groupby("stage").core_seconds.transform("max") >= SHORT_SECONDS
    heavy = both.groupby("stage").kept_bytes.transform("max") >= 1e6
    both = both[long | heavy].round({"core_seconds": 1})
    return both.astype({"mib": int, "kept_bytes": "int64", "temporary_bytes": "int64"})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("took", nargs="+", type=Path, help=".snakemake/took.csv of runs")
    parser.add_argument("--note", default="", help="what else is to be known of the table")
    options = parser.parse_args()
    table = merged(read(JOB_COSTS), costs(options.took))
    provenance = of_this_run("python -m benchmarks.job_costs")
    provenance |= {"note": options.note} if options.note else {}
    Result(provenance, table).write(JOB_COSTS)
    print(f"{JOB_COSTS}: {len(table)} rows")


if __name__ == "__main__":
    main()

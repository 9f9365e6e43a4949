"""What a dry run of a large light field takes: core seconds and memory of the plan.

python -m benchmarks.planning --publish
"""

from __future__ import annotations

import argparse
import re
import resource
import subprocess
import sys
import tempfile

import pandas as pd

from benchmarks.publish import RESULTS, ROOT, Result, of_this_run

CASES = ((128, 1024), (4096, 1024), (4096, 128))
"""M, and MiB of a tile; N = 512, one scene."""
BEFORE = (
    "Of commit 458a1b6, when each tile was a job (its names of four digits widened by hand): "
    "16,384 tiles took 44 core s and 629 MiB; 102,400 had not been planned after 358 core s, with "
    "3260 MiB."
)


def planned(pixels: int, tile_mib: int) -> dict:
    """The row of one plan, made by a process of its own."""
    from lfcore.workflow import cases
    from lfcore.workflow.settings import check_settings

    keys = {"spatial_resolution": pixels, "tile_mib": tile_mib, "job_minutes": 10}
    settings = check_settings({"scenes": ["bike"], "angular_resolutions": [512], **keys})
    words = [f"{key}={value}" for key, value in keys.items()]
    with tempfile.TemporaryDirectory() as folder:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [
                sys.executable, "-m", "snakemake", "--cores", "1", "--dry-run", "--quiet", "reason",
                "--directory", folder, "--configfile", "config/smoke.yaml", "--config", *words,
                "scenes=[bike]", "angular_resolutions=[512]", "--", "results/tables/",
            ],
            cwd=ROOT, check=True, capture_output=True, text=True,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    jobs = re.search(r"^total +(\d+)$", done.stdout, re.MULTILINE)
    return {
        "M": pixels, "N": 512, "rays": f"{(pixels * 512) ** 2:.1e}",
        "tiles": len(cases.tiles(settings, 512)), "jobs": int(jobs[1]) if jobs else 0,
        "core s": round(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, 1),
        "MiB": round(after.ru_maxrss / 1024),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--publish", action="store_true", help="keep the rows for the documents")
    options = parser.parse_args()
    rows = [planned(*case) for case in CASES]  # ascending: the peak is of all so far
    table = pd.DataFrame(rows)
    print(table.to_string(index=False))
    if options.publish:
        provenance = of_this_run("python -m benchmarks.planning --publish", note=BEFORE)
        Result(provenance, table).write(RESULTS / "planning.csv")


if __name__ == "__main__":
    main()

"""Methods measured in turn, and their rows."""

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.peers.method import Method, Run
from benchmarks.publish import Result, of_this_run


def say(text: str) -> None:
    """Print progress on standard error; tables go to standard output."""
    print(text, file=sys.stderr, flush=True)


def in_turn(methods: Sequence[Method], repeats: int) -> dict[str, list[Run]]:
    """``repeats`` rounds over all methods, after one round that is not counted."""
    runs: dict[str, list[Run]] = {method.name: [] for method in methods}
    for turn in range(repeats + 1):
        for method in methods:
            run = method.run()
            if turn:
                runs[method.name].append(run)
    return runs


def rates(runs: list[Run]) -> dict[str, float]:
    """Median million rays per wall second and per core second, and their spread."""
    wall = np.array([run.rays / run.seconds for run in runs]) / 1e6
    core = np.array([run.rays / max(run.cpu_seconds, 1e-9) for run in runs]) / 1e6
    low, high = np.percentile(wall, (25, 75))
    return {
        "mrays_per_second": float(np.median(wall)),
        "mrays_per_core_second": float(np.median(core)),
        "quartile_1": float(low),
        "quartile_3": float(high),
        "fastest": float(wall.max()),
        "repeats": len(runs),
        "sampled_rays": runs[0].rays,
    }


def report(path: Path, program: str, rows: Sequence[dict]) -> None:
    """Write the rows, below what is known of this run of ``program``, and print them."""
    table = pd.DataFrame(rows)
    Result(of_this_run(f"{program} {shlex.join(sys.argv[1:])}"), table).write(path)
    print(table.to_string(index=False, na_rep="", float_format="{:.4g}".format), flush=True)

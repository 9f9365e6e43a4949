"""Methods measured in turn, and their rows."""

import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.peers.method import Method, Run
from lfcore.files import write_text
from lfcore.timing import machine


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


def write_csv(path: Path, rows: Sequence[dict]) -> None:
    """Write ``rows``, whole or not at all; columns in order of first appearance."""
    text = pd.DataFrame(rows).to_csv(index=False, lineterminator="\n", float_format=_shown)
    write_text(path, text)


def print_table(rows: Sequence[dict], leave_out: Sequence[str] = ()) -> None:
    """``rows`` as aligned columns on standard output."""
    table = pd.DataFrame(rows).drop(columns=list(leave_out), errors="ignore")
    shown = table.astype(object).where(table.notna(), "")
    print(shown.to_string(index=False, float_format=_shown), flush=True)


def report(path: Path, measure: Callable[[], list[dict]]) -> None:
    """Measure, and write and print the rows, each with the machine's processor."""
    here = machine()
    say(", ".join(f"{key} {value}" for key, value in here.items()))
    say(f"load of the machine over the last minute: {os.getloadavg()[0]:.1f}")
    rows = [{**row, "processor": here["processor"], "cores": here["cores"]} for row in measure()]
    write_csv(path, rows)
    beside = ("note", "processor", "cores", "threads", "sampled_rays", "repeats")
    print_table(rows, leave_out=beside)


def _shown(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1000 else f"{value:.0f}"

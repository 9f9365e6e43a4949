"""What all programs take and say, and their rows."""

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from benchmarks.results import of_this_run, write_result


def parser_of(
    doc: str, *, scenes: Sequence[str] = ("bike", "cabin", "bedroom"), pixels: int | list[int]
) -> argparse.ArgumentParser:
    """A parser of what all programs take, with these defaults; a list of ``pixels`` for several."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=list(scenes))
    several = "+" if isinstance(pixels, list) else None
    parser.add_argument("--pixels", nargs=several, type=int, default=pixels, help="M (%(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    return parser


def say(text: str) -> None:
    """Print progress on standard error; tables go to standard output."""
    print(text, file=sys.stderr, flush=True)


def report(path: Path, program: str, rows: Sequence[dict] | pd.DataFrame, note: str = "") -> None:
    """Write the rows, below what is known of this run of ``program``, and print them."""
    table, more = pd.DataFrame(rows), {"note": note} if note else {}
    run = of_this_run(f"{program} {shlex.join(sys.argv[1:])}", **more)
    write_result(path, run, table.fillna(""))
    print(table.to_string(index=False, na_rep="", float_format="{:.4g}".format), flush=True)

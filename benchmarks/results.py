"""Result files: rows as CSV below lines ``# key: value`` on their run, and tables as Markdown.

    python -m benchmarks.results --command "make tables" results/tables docs/results table_7_1 ...

copies tables of a run of the workflow, as CSV and Markdown, with the facts of the run.
"""

import argparse
import datetime
import io
import shlex
import subprocess
import sys
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

from lfcore.errors import LfcoreError
from lfcore.files import write_text
from lfcore.timing import machine

ROOT = Path(__file__).resolve().parents[1]
OF_RUN = ("command", "commit", "processor", "date")
"""The facts of every run."""


class ResultError(LfcoreError):
    """A result file without the facts of its run."""


def parser_of(
    doc: str, *, scenes: Sequence[str] = ("bike", "cabin", "bedroom"), pixels: int | list[int]
) -> argparse.ArgumentParser:
    """Return a parser with the options of all benchmarks; ``pixels`` may be a list."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=list(scenes))
    several = "+" if isinstance(pixels, list) else None
    parser.add_argument("--pixels", nargs=several, type=int, default=pixels, help="M (%(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    return parser


def say(text: str) -> None:
    """Print progress on standard error; tables are printed on standard output."""
    print(text, file=sys.stderr, flush=True)


def said(row: dict) -> dict:
    """Print a row as progress, and return it."""
    say("  ".join(f"{key}: {value}" for key, value in row.items()))
    return row


def report(
    path: Path,
    program: str,
    rows: Sequence[dict] | pd.DataFrame,
    note: str = "",
    shown: Mapping[str, pd.DataFrame] | None = None,
) -> None:
    """Write a run's rows as CSV, its tables as Markdown beside it, and print the rows.

    ``shown`` maps suffixes of the Markdown files' names to tables; default: one with all rows.
    """
    table = pd.DataFrame(rows).fillna("")
    run = of_this_run(f"{program} {shlex.join(sys.argv[1:])}") | ({"note": note} if note else {})
    write_text(path, head(run) + table.to_csv(index=False, lineterminator="\n"))
    write_tables(path, shown or {"": table})
    print(table.to_string(index=False), flush=True)


def write_tables(path: Path, shown: Mapping[str, pd.DataFrame]) -> None:
    """Write tables of the result file ``path`` as Markdown, under its name with suffixes."""
    run, _ = read_result(path)
    for suffix, table in shown.items():
        body = table.to_markdown(index=False, disable_numparse=True)
        write_text(path.with_name(f"{path.stem}{suffix}.md"), f"{body}\n\n{source(run)}\n")


def head(run: Mapping[str, str]) -> str:
    """Return the lines above the rows of a run."""
    return "".join(f"# {key}: {value}\n" for key, value in run.items())


def source(run: Mapping[str, str]) -> str:
    """Return a paragraph with the command, place and date of a run."""
    more = "".join(f" {value}" for key, value in run.items() if key not in OF_RUN)
    where = "commit {commit}, {date}, {processor}".format(**run)
    text = f"Made by `{run['command']}`: {where}.{more}"
    return textwrap.fill(text, 118, break_long_words=False, break_on_hyphens=False)


def read_result(path: Path) -> tuple[dict[str, str], pd.DataFrame]:
    """Read the facts of a result file's run, and its rows, as texts.

    Raises :class:`ResultError` if a fact is missing.
    """
    text = path.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("# ")]
    run = dict(line[2:].split(": ", 1) for line in lines if ": " in line)
    if missing := [key for key in OF_RUN if not run.get(key)]:
        raise ResultError(f"has no {', '.join(missing)}", file=path)
    rows = pd.read_csv(io.StringIO(text), comment="#", dtype=str, keep_default_na=False)
    return run, rows


def of_this_run(command: str) -> dict[str, str]:
    """Return the facts of a run on this machine, at this commit."""

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.strip()

    # Edits of results and documents do not change measurements.
    edited = git("status", "--porcelain", "--", ".", ":!benchmarks/published", ":!docs")
    commit = git("rev-parse", "--short", "HEAD") + ("+" if edited else "")
    here = machine()
    processor = f"{here['processor']}, {here['cores']} cores, {here['memory_gib']} GiB"
    today = datetime.date.today().isoformat()
    return dict(zip(OF_RUN, (command, commit, processor, today), strict=True))


def with_kept(rows: pd.DataFrame, file: Path, *keys: str) -> pd.DataFrame:
    """Add to the rows of a run the other rows of a result file; each has its commit.

    ``keys`` are the columns, of texts, that identify a row.
    """
    rows = rows.assign(commit=of_this_run("")["commit"])
    if file.exists():
        old = read_result(file)[1].set_index(list(keys))
        kept = old[~old.index.isin(rows.set_index(list(keys)).index)]
        rows = pd.concat([rows, kept.reset_index()])
    return rows.fillna("")


def keep(tables: Path, folder: Path, names: Sequence[str], command: str) -> None:
    """Copy the workflow's tables, with the facts of the run."""
    run = of_this_run(command)
    for name in names:
        rows, text = ((tables / f"{name}.{end}").read_text("utf-8") for end in ("csv", "md"))
        write_text(folder / f"{name}.csv", head(run) + rows)
        write_text(folder / f"{name}.md", f"{text}\n{source(run)}\n")


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.results", description=__doc__.splitlines()[0])
    parser.add_argument("--command", required=True, help="the command that made the tables")
    parser.add_argument("tables", type=Path, help="folder results/tables of a run")
    parser.add_argument("folder", type=Path, help="folder for the copies")
    parser.add_argument("names", nargs="+", help="tables, without suffix")
    options = parser.parse_args()
    keep(options.tables, options.folder, options.names, options.command)


if __name__ == "__main__":
    main()

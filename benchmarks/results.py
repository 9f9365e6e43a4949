"""Result files: measured rows as CSV, below lines ``# key: value`` that say what they are of."""

import datetime
import io
import subprocess
import textwrap
from collections.abc import Iterator
from pathlib import Path

import pandas as pd

from lfcore.errors import LfcoreError
from lfcore.files import write_text
from lfcore.timing import machine

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "published"
OF_RUN = ("command", "commit", "processor", "date")
"""What is known of every result."""


class PublishError(LfcoreError):
    """Results that cannot be published."""


def write_result(path: Path, provenance: dict[str, str], rows: pd.DataFrame) -> None:
    write_text(path, head(provenance) + rows.to_csv(index=False, lineterminator="\n"))


def head(provenance: dict[str, str]) -> str:
    """The lines above what a run made."""
    return "".join(f"# {key}: {value}\n" for key, value in provenance.items())


def source(provenance: dict[str, str]) -> str:
    """A line that says what made a result, where and when."""
    more = "".join(f" {value}" for key, value in provenance.items() if key not in OF_RUN)
    where = "commit {commit}, {date}, {processor}".format(**provenance)
    return f"Made by `{provenance['command']}`: {where}.{more}"


def read_result(path: Path) -> tuple[dict[str, str], pd.DataFrame]:
    """Provenance and rows of a result file.

    Raises :class:`PublishError` for one that does not say what it is of.
    """
    text = path.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("# ")]
    provenance = dict(line[2:].split(": ", 1) for line in lines if ": " in line)
    missing = [key for key in OF_RUN if not provenance.get(key)]
    if missing:
        raise PublishError(f"does not say its {', '.join(missing)}", file=path)
    rows = pd.read_csv(io.StringIO(text), comment="#", dtype=str, keep_default_na=False)
    return provenance, rows


def of_this_run(command: str, **more: str) -> dict[str, str]:
    """What is known of a run on this machine, at this commit."""

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout.strip()

    # Edits of results and documents change nothing that is measured.
    edited = git("status", "--porcelain", "--", ".", ":!benchmarks/published", ":!docs")
    commit = git("rev-parse", "--short", "HEAD") + ("+" if edited else "")
    here = machine()
    processor = f"{here['processor']}, {here['cores']} cores, {here['memory_gib']} GiB"
    today = datetime.date.today().isoformat()
    return dict(zip(OF_RUN, (command, commit, processor, today), strict=True)) | more


def with_kept(found: pd.DataFrame, file: Path, *keys: str) -> pd.DataFrame:
    """Rows of a run that made some of a result, and those kept of others; each says its commit.

    ``keys`` are the columns, of texts, that tell what a row is of.
    """
    found = found.assign(commit=of_this_run("")["commit"])
    if file.exists():
        old = read_result(file)[1].set_index(list(keys))
        kept = old[~old.index.isin(found.set_index(list(keys)).index)]
        found = pd.concat([found, kept.reset_index()])
    return found.fillna("")


def update_result(file: Path, command: str, rows: list[dict], *keys: str) -> None:
    """Write the rows of a run to a result file, in which rows of others stay."""
    write_result(file, of_this_run(command), with_kept(pd.DataFrame(rows), file, *keys))


def markdown(rows: pd.DataFrame) -> Iterator[str]:
    yield f"| {' | '.join(rows.columns)} |"
    yield "|" + "---|" * len(rows.columns)
    for row in rows.itertuples(index=False):
        yield f"| {' | '.join(map(str, row))} |"


def wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 118, break_long_words=False, break_on_hyphens=False)

"""Result files: measured rows as CSV, below lines ``# key: value`` that say what they are of."""

import datetime
import io
import subprocess
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field
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


@dataclass(frozen=True)
class Result:
    """Measured rows, and the run that they are of."""

    provenance: dict[str, str]
    rows: pd.DataFrame = field(repr=False)

    def write(self, path: Path) -> None:
        """The rows as CSV, below lines that say what they are of."""
        write_text(path, head(self.provenance) + self.rows.to_csv(index=False, lineterminator="\n"))

    def source(self) -> str:
        """A line that says what made it, where and when."""
        known = self.provenance
        more = "".join(f" {value}" for key, value in known.items() if key not in OF_RUN)
        where = f"commit {known['commit']}, {known['date']}, {known['processor']}"
        return f"Made by `{known['command']}`: {where}.{more}"


def head(provenance: dict[str, str]) -> str:
    """The lines above what a run made."""
    return "".join(f"# {key}: {value}\n" for key, value in provenance.items())


def read_result(path: Path) -> Result:
    """A result file.  Raises :class:`PublishError` for one that does not say what it is of."""
    text = path.read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("# ")]
    provenance = dict(line[2:].split(": ", 1) for line in lines if ": " in line)
    missing = [key for key in OF_RUN if not provenance.get(key)]
    if missing:
        raise PublishError(f"does not say its {', '.join(missing)}", file=path)
    rows = pd.read_csv(io.StringIO(text), comment="#", dtype=str, keep_default_na=False)
    return Result(provenance, rows)


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
        old = read_result(file).rows.set_index(list(keys))
        kept = old[~old.index.isin(found.set_index(list(keys)).index)]
        found = pd.concat([found, kept.reset_index()])
    return found.fillna("")


def markdown(rows: pd.DataFrame) -> Iterator[str]:
    yield f"| {' | '.join(rows.columns)} |"
    yield "|" + "---|" * len(rows.columns)
    for row in rows.itertuples(index=False):
        yield f"| {' | '.join(map(str, row))} |"


def wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 118, break_long_words=False, break_on_hyphens=False)

"""Runs of the workflow through a throw-away SLURM: what they took, and what they made."""

from __future__ import annotations

import hashlib
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

import pandas as pd

from robustness.local_slurm import LocalSlurm
from robustness.outcome import ROOT

PROFILE = (
    "--workflow-profile", str(ROOT / "profiles" / "slurm"), "--jobs", "8",
    "--slurm-keep-successful-logs",
)  # fmt: skip
KEPT = ("results/*/M*/N*/lightfield.mkv", "results/*/M*/N*/planes/*.npz", "results/*/*.npz")
"""Results without seconds, which must be the same to the last bit."""
TABLES = "results/tables/table_7_*.csv"
"""The thesis's tables, which are compared but for their seconds."""
SECONDS = ("second", "mrays", "device", "thesis")


@dataclass
class Run:
    """What one run of the workflow took, and what is wrong with it."""

    name: str
    status: int
    said: str
    seconds: float
    jobs: int
    submissions: list[dict[str, str]]
    digests: dict[str, str]
    same: str = ""
    wrong: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        if self.status:
            self.wrong.append(f"status {self.status}: {self.said[-3000:]}")

    @property
    def inside_s(self) -> float:
        return sum(_seconds(one["begun"], one["ended"]) for one in self.submissions)

    def compare(self, undisturbed: Run) -> None:
        """Results must be those of ``undisturbed``, and no file half-written under any name."""
        same = self.digests == undisturbed.digests and bool(self.digests)
        self.same = f"{len(self.digests)} {'identical' if same else 'DIFFERENT'}"
        if not same:
            names = {
                name for name in {*self.digests, *undisturbed.digests}
                if self.digests.get(name) != undisturbed.digests.get(name)
            }  # fmt: skip
            self.wrong.append(f"other results: {sorted(names)}")

    def row(self) -> dict[str, str]:
        return {
            "run": self.name, "jobs": str(self.jobs), "submissions": str(len(self.submissions)),
            "wall s": f"{self.seconds:.0f}", "results": self.same or str(len(self.digests)),
        }  # fmt: skip

    def summary(self) -> str:
        """One line, and one for each thing that is wrong."""
        line = ", ".join(f"{key} {value}" for key, value in self.row().items() if key != "run")
        return "\n".join([f"{self.name}: {line}", *(f"WRONG {one}" for one in self.wrong)])


def _seconds(start: str, end: str) -> float:
    try:
        return (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()
    except ValueError:  # never begun
        return 0.0


def run(
    slurm: LocalSlurm,
    folder: Path,
    name: str,
    words: tuple[str, ...],
    beside: Callable[[], None] = lambda: None,
) -> Run:
    """A run of the workflow through SLURM; ``beside`` is called now and then meanwhile."""
    folder.mkdir(exist_ok=True)
    before, begun = {one["number"] for one in slurm.jobs()}, time.monotonic()
    command = [sys.executable, "-m", "snakemake", *PROFILE, "--directory", str(folder), *words]
    with (folder / "terminal").open("w+") as terminal:
        process = subprocess.Popen(
            command, cwd=ROOT, env=slurm.environment, stdout=terminal, stderr=subprocess.STDOUT
        )
        try:
            while process.poll() is None:
                time.sleep(0.5)
                beside()
        finally:
            if process.poll() is None:
                process.terminate()
                process.wait()
        terminal.seek(0)
        said = terminal.read()
    seconds = time.monotonic() - begun
    mine = [one for one in slurm.jobs() if one["number"] not in before]
    table = re.search(r"^total +(\d+)$", said, re.MULTILINE)
    jobs = int(table[1]) if table else 0
    return Run(name, process.returncode, said, seconds, jobs, mine, digests(folder))


def digests(folder: Path) -> dict[str, str]:
    """Name and SHA-256 of each result that holds no seconds, and of tables without theirs."""
    files = {file for pattern in KEPT for file in folder.glob(pattern)}
    found = {str(file.relative_to(folder)): file.read_bytes() for file in sorted(files)}
    for file in sorted(folder.glob(TABLES)):
        table = pd.read_csv(file)
        timed = [name for name in table.columns if any(word in name for word in SECONDS)]
        found[str(file.relative_to(folder))] = table.drop(columns=timed).to_csv().encode()
    return {name: hashlib.sha256(data).hexdigest() for name, data in found.items()}

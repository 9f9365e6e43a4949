"""The smoke workflow on a throw-away SLURM, once undisturbed and once with jobs cancelled.

    python -m robustness.cluster           (make cluster)

Says how many jobs went in how many submissions, what scheduling took, and whether the results of
the disturbed run are those of the undisturbed one.  Skipped, aloud, where SLURM is not installed.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from robustness.local_slurm import CannotRun, LocalSlurm, local_slurm, missing

ROOT = Path(__file__).resolve().parents[1]
PROFILE = ("--workflow-profile", str(ROOT / "profiles" / "slurm"), "--jobs", "8")
SMOKE = ("--configfile", str(ROOT / "config" / "smoke.yaml"))
KEPT = ("results/*/M*/N*/lightfield.mkv", "results/*/M*/N*/planes/*.npz", "results/*/*.npz")
"""Results without seconds, which must be the same to the last bit."""


@dataclass
class Run:
    """What one run of the workflow took."""

    name: str
    status: int
    said: str
    seconds: float
    jobs: int
    submissions: list[dict[str, str]]
    killed: int
    digests: dict[str, str]

    def summary(self) -> str:
        inside = sum(_seconds(one["begun"], one["ended"]) for one in self.submissions)
        waited = sum(_seconds(one["submitted"], one["begun"]) for one in self.submissions)
        return (
            f"{self.name}: status {self.status}, {self.jobs} jobs in {len(self.submissions)} "
            f"submissions, {self.killed} cancelled; {self.seconds:.0f} s of wall time, "
            f"{inside:.0f} s within submissions, {waited:.0f} s waited for a place"
        )


def _seconds(start: str, end: str) -> float:
    try:
        return (datetime.fromisoformat(end) - datetime.fromisoformat(start)).total_seconds()
    except ValueError:  # never begun
        return 0.0


def snakemake(
    slurm: LocalSlurm, folder: Path, *words: str, beside: Callable[[], None] = lambda: None
) -> tuple[int, str]:
    """Status and words of a run through SLURM; ``beside`` is called now and then meanwhile."""
    folder.mkdir(exist_ok=True)
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
        return process.returncode, terminal.read()


def run(slurm: LocalSlurm, folder: Path, name: str, kills: int, words: tuple[str, ...]) -> Run:
    """One run of the workflow, of which ``kills`` submissions are cancelled while they run."""
    before = {one["number"] for one in slurm.jobs()}
    done: list[str] = []
    since: dict[str, float] = {}

    def cancel() -> None:
        for number in slurm.running() if len(done) < kills else ():
            # In the middle of its work, and no submission twice.
            begun = since.setdefault(number, time.monotonic())
            if number not in done and time.monotonic() - begun > 15 + 10 * len(done):
                slurm.command("scancel", number)
                done.append(number)
                return

    begun = time.monotonic()
    status, said = snakemake(slurm, folder, *words, beside=cancel)
    seconds = time.monotonic() - begun
    mine = [one for one in slurm.jobs() if one["number"] not in before]
    table = re.search(r"^total +(\d+)$", said, re.MULTILINE)
    jobs = int(table[1]) if table else 0
    return Run(name, status, said, seconds, jobs, mine, len(done), digests(folder))


def digests(folder: Path) -> dict[str, str]:
    """Name and SHA-256 of each result that holds no seconds."""
    files = {file for pattern in KEPT for file in folder.glob(pattern)}
    return {
        str(file.relative_to(folder)): hashlib.sha256(file.read_bytes()).hexdigest()
        for file in sorted(files)
    }


def check(folder: Path, cores: int, memory_mib: int, kills: int, words: tuple[str, ...]) -> int:
    """Both runs; 1 where one failed or results differ."""
    with local_slurm(folder / "slurm", cores=cores, memory_mib=memory_mib) as slurm:
        undisturbed = run(slurm, folder / "undisturbed", "undisturbed", 0, words)
        print(undisturbed.summary(), flush=True)
        if undisturbed.status:
            print(undisturbed.said[-3000:])
            return 1
        disturbed = run(slurm, folder / "disturbed", "disturbed", kills, words)
        print(disturbed.summary(), flush=True)
    same = disturbed.digests == undisturbed.digests
    print(f"{len(undisturbed.digests)} results: {'identical' if same else 'DIFFERENT'}")
    if disturbed.status or not same:
        print(disturbed.said[-3000:])
    return int(bool(disturbed.status) or not same or disturbed.killed < kills)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cores", type=int, default=2, help="of the node")
    parser.add_argument("--memory-mib", type=int, default=16000, help="of the node")
    parser.add_argument("--kills", type=int, default=2, help="submissions that are cancelled")
    parser.add_argument("snakemake", nargs="*", help="after --: instead of the smoke workflow")
    options = parser.parse_args(arguments)
    absent = missing()
    if importlib.util.find_spec("snakemake_executor_plugin_slurm") is None:
        absent.append("snakemake-executor-plugin-slurm")
    if absent:
        print(f"SKIPPED: {', '.join(absent)} not found (apt-get install slurm-wlm munge; make)")
        return 0
    words = tuple(options.snakemake) or (*SMOKE, "--", "results/tables/")
    with tempfile.TemporaryDirectory(prefix="lf", dir="/tmp") as name:
        Path(name).chmod(0o755)
        try:
            return check(Path(name), options.cores, options.memory_mib, options.kills, words)
        except CannotRun as error:
            print(error)
            return 1


if __name__ == "__main__":
    sys.exit(main())

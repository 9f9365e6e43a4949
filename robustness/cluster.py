"""The smoke workflow on a throw-away SLURM, once undisturbed and once with jobs cancelled.

    python -m robustness.cluster                          (make cluster)
    python -m robustness.cluster --faults all             (make cluster FAULTS=all)

Says how many jobs went in how many submissions, and whether the results of a disturbed run are
those of the undisturbed one.  With ``--faults`` a smaller run meets what may happen to a node
(:class:`Fault`).  Skipped, aloud, where SLURM is not installed.
"""

from __future__ import annotations

import argparse
import hashlib
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from robustness import kills
from robustness.disks import PAGE, small_disk
from robustness.kills import started
from robustness.local_slurm import CannotRun, LocalSlurm, local_slurm, missing
from robustness.outcome import ROOT

PROFILE = (
    "--workflow-profile", str(ROOT / "profiles" / "slurm"), "--jobs", "8",
    "--slurm-keep-successful-logs",
)  # fmt: skip
KEPT = ("results/*/M*/N*/lightfield.mkv", "results/*/M*/N*/planes/*.npz", "results/*/*.npz")
"""Results without seconds, which must be the same to the last bit."""
FOUND = "results/tables/table_7_*.csv"
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
        begun, ended = (
            pd.to_datetime([one[end] for one in self.submissions], errors="coerce")
            for end in ("begun", "ended")
        )
        return float((ended - begun).total_seconds().to_series().sum())  # without those never begun

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


def run(
    slurm: LocalSlurm, folder: Path, name: str, words: tuple[str, ...], beside: Callable[[], None]
) -> Run:
    """A run of the workflow through SLURM; ``beside`` is called now and then meanwhile."""
    folder.mkdir(exist_ok=True)
    before, begun = {one["number"] for one in slurm.jobs()}, time.monotonic()
    command = [sys.executable, "-m", "snakemake", *PROFILE, "--directory", str(folder), *words]
    process = started(command, folder / "terminal", slurm.environment)
    try:
        while process.poll() is None:
            time.sleep(0.5)
            beside()
    finally:
        if process.poll() is None:
            process.terminate()
            process.wait()
    said, seconds = (folder / "terminal").read_text(), time.monotonic() - begun
    mine = [one for one in slurm.jobs() if one["number"] not in before]
    table = re.search(r"^total +(\d+)$", said, re.MULTILINE)
    jobs = int(table[1]) if table else 0
    return Run(name, process.returncode, said, seconds, jobs, mine, digests(folder))


def digests(folder: Path) -> dict[str, str]:
    """Name and SHA-256 of each result that holds no seconds, and of tables without theirs."""
    found = kills.digests({file for pattern in KEPT for file in folder.glob(pattern)}, folder)
    for file in sorted(folder.glob(FOUND)):
        table = pd.read_csv(file)
        timed = [name for name in table.columns if any(word in name for word in SECONDS)]
        untimed = table.drop(columns=timed).to_csv().encode()
        found[str(file.relative_to(folder))] = hashlib.sha256(untimed).hexdigest()
    return found


TABLES = tuple(f"results/tables/table_7_{number}.csv" for number in (1, 2, 3))
SMALL = (
    "--configfile", str(ROOT / "config" / "micro.yaml"),
    "--config", "scenes=[bike]", "views=[16,64]", "pixels=64", "reports=[]",
    "tile_mib=8", "job_minutes=0.01", "--", *TABLES,
)  # fmt: skip
"""A scene whose tracing is several submissions of seconds."""
DISK_BYTES = 256 << 20
"""The size of the disk that fills, which holds all that the run makes."""


SMOKE = ("--configfile", str(ROOT / "config" / "smoke.yaml"), "--", "results/tables/")
KILLS = 2
"""The submissions that are cancelled."""


class Fault:
    """Undisturbed; a subclass is what happens, and knows the ``undisturbed`` run."""

    name: str = "a small run"
    words: tuple[str, ...] = SMALL

    def __init__(self, slurm: LocalSlurm, folder: Path, undisturbed: Run | None):
        self.slurm, self.folder, self.happened = slurm, folder, False

    def beside(self) -> None:
        """Called now and then while the workflow runs."""

    def missed(self, done: Run) -> Iterator[str]:
        """What did not happen as it must have."""
        return iter(())

    def traced_now(self) -> bool:
        """Whether a batch is being traced: its segments are half there."""
        return any(self.folder.glob("results/*/M*/N64/tiles/.*.draft*"))


class Node(Fault):
    """A node dies with all that runs on it, and comes back after a while."""

    name = "a node dies"
    died = 0.0

    def beside(self) -> None:
        if not self.happened and self.traced_now() and self.slurm.running():
            self.slurm.kill_node()
            self.happened, self.died = True, time.monotonic()
        elif self.died and time.monotonic() - self.died > 10:
            self.slurm.revive_node()
            self.died = 0.0

    def missed(self, done: Run) -> Iterator[str]:
        if not self.happened:
            yield "no node died"
        failed = [one for one in done.submissions if one["state"] == "NODE_FAIL"]
        if self.happened and not failed:
            yield "no submission failed with its node"
        yield from more_was_asked(done, failed)


class Disk(Fault):
    """The disk of the results fills while a batch is traced, and is emptied when it has failed."""

    name = "a full disk"

    @property
    def _filler(self) -> Path:
        return self.folder / "results" / "filler"

    def beside(self) -> None:
        if not self.happened and self.traced_now():
            self.happened = True
            with suppress(OSError), self._filler.open("wb", buffering=0) as file:
                while file.write(bytes(PAGE)):  # until the disk says that it is full
                    pass
        elif any(one["state"] == "FAILED" for one in self.slurm.jobs()):
            self._filler.unlink(missing_ok=True)

    def missed(self, done: Run) -> Iterator[str]:
        failed = [one for one in done.submissions if one["state"] == "FAILED"]
        if not failed:
            yield "no submission met a full disk"
        logs = [file.read_text(errors="replace") for file in
                (self.folder / ".snakemake" / "slurm_logs").rglob("*.log")]  # fmt: skip
        said = [line for text in logs for line in text.splitlines() if "No space left" in line]
        if not any("cannot be written" in line and "Free space" in line for line in said):
            yield f"no line says which file and what to do: {said[:3]}"
        yield from more_was_asked(done, failed)


class Smoke(Fault):
    """The smoke workflow, undisturbed."""

    name, words = "smoke", SMOKE


class Cancelled(Smoke):
    """Submissions are cancelled in the middle of their work."""

    name = f"smoke, {KILLS} cancelled"

    def __init__(self, slurm: LocalSlurm, folder: Path, undisturbed: Run | None):
        super().__init__(slurm, folder, undisturbed)
        assert undisturbed is not None
        # Half of what one takes: in the middle of its work, however fast the machine is.
        self.after_s = undisturbed.inside_s / max(1, len(undisturbed.submissions)) / 2
        self.since, self.cancelled = dict[str, float](), list[str]()

    def beside(self) -> None:
        for number in self.slurm.running() if len(self.cancelled) < KILLS else ():
            begun = self.since.setdefault(number, time.monotonic())
            if number not in self.cancelled and time.monotonic() - begun > self.after_s:
                self.slurm.command("scancel", number)
                self.cancelled.append(number)
                return

    def missed(self, done: Run) -> Iterator[str]:
        if len(self.cancelled) < KILLS:
            yield f"only {len(self.cancelled)} submissions ran long enough to be cancelled"


FAULTS = {"node": Node, "disk": Disk}


def more_was_asked(done: Run, failed: list[dict[str, str]]) -> Iterator[str]:
    """What failed is asked for again with more time and memory: Snakemake calls it the same."""
    for one in failed:
        again = [
            other for other in done.submissions
            if other["comment"] == one["comment"] and int(other["number"]) > int(one["number"])
        ]  # fmt: skip
        (time_asked, memory_asked), more = asked(one), map(asked, again)
        if not any(time > time_asked and memory > memory_asked for time, memory in more):
            yield f"{one} was not asked for again with more time and memory: {again}"


def asked(submission: dict[str, str]) -> tuple[pd.Timedelta, float]:
    """The time, D-HH:MM:SS or MM:SS in SLURM's words, and the memory in KiB, 3000M or 2.5G."""
    days, _, clock = submission["limit"].rpartition("-")
    memory = submission["memory"]
    time = pd.Timedelta(f"{days or 0} days {clock if clock.count(':') == 2 else '0:' + clock}")
    return time, float(memory[:-1]) * 1024 ** "KMGT".index(memory[-1])


def one_of(fault: type[Fault], folder: Path, undisturbed: Run | None) -> Run:
    """A run that meets ``fault``, on a SLURM of its own."""
    place = folder / fault.__name__.lower()
    place.mkdir()
    with ExitStack() as stack:
        if fault is Disk:  # what is mounted before the servers start is seen by their jobs
            (place / "results").mkdir()
            stack.enter_context(small_disk(place / "results", DISK_BYTES))
        slurm = stack.enter_context(local_slurm(folder / f"s{fault.__name__[0]}"))
        met = fault(slurm, place, undisturbed)
        done = run(slurm, place, fault.name, fault.words, met.beside)
        done.wrong += met.missed(done)
    return done


def all_of(folder: Path, faults: Sequence[type[Fault]]) -> list[Run]:
    """A run that meets each of ``faults``, compared with the first, which is undisturbed; the
    others are not made where that fails."""
    runs: list[Run] = []
    for fault in faults:
        runs.append(one_of(fault, folder, runs[0] if runs else None))
        if len(runs) > 1:
            runs[-1].compare(runs[0])
        print(runs[-1].summary(), flush=True)
        if runs[0].status:
            break
    return runs


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--faults", nargs="*", default=[], choices=["all", *FAULTS],
        help="what happens to a node, in place of the smoke workflow",
    )  # fmt: skip
    parser.add_argument("--publish", action="store_true", help="keep the rows for the documents")
    options = parser.parse_args(arguments)
    if absent := missing():
        print(f"SKIPPED: {', '.join(absent)} not found (apt-get install slurm-wlm munge; make)")
        return 0
    # SLURM's sockets want a short name.
    with tempfile.TemporaryDirectory(prefix="lf", dir="/tmp") as name:
        folder = Path(name)
        folder.chmod(0o755)
        names = FAULTS if "all" in options.faults else options.faults
        faults = [Fault, *(FAULTS[name] for name in names)] if names else [Smoke, Cancelled]
        try:
            runs = all_of(folder, faults)
        except CannotRun as error:
            print(error)
            return 1
    if options.publish:  # rows of runs that were not made stay
        from benchmarks.results import RESULTS, update_result

        of_faults = f'FAULTS="{" ".join(options.faults)}" ' if options.faults else ""
        command = f"make cluster {of_faults}PUBLISH=1"
        update_result(RESULTS / "cluster.csv", command, [one.row() for one in runs], "run")
    return int(any(one.wrong for one in runs))


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # and so end the servers, too
    sys.exit(main())

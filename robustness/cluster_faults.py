"""What may happen to a node of a cluster while the workflow runs on it.

Each fault happens to a run of its own, on a throw-away SLURM; the run must go on by itself, and
its results and tables be those of an undisturbed one.
"""

import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

from robustness.cluster_runs import ROOT, Run, run
from robustness.disks import PAGE, small_disk
from robustness.local_slurm import LocalSlurm, local_slurm

TABLES = tuple(f"results/tables/table_7_{number}.csv" for number in (1, 2, 3))
SMALL = (
    "--configfile", str(ROOT / "config" / "micro.yaml"),
    "--config", "scenes=[bike]", "views=[16,64]", "pixels=64", "reports=[]",
    "tile_mib=8", "job_minutes=0.01", "--", *TABLES,
)  # fmt: skip
"""A scene whose tracing is several submissions of seconds."""
DISK_BYTES = 256 << 20
"""Of the disk that fills, which holds all that the run makes."""


class Fault:
    """Undisturbed; what happens to a node is a subclass."""

    name = "a small run"

    def __init__(self, slurm: LocalSlurm, folder: Path):
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


FAULTS = {"node": Node, "disk": Disk}


def more_was_asked(done: Run, failed: list[dict[str, str]]) -> Iterator[str]:
    """What failed is asked for again with more time and memory: Snakemake calls it the same."""
    for one in failed:
        again = [
            other for other in done.submissions
            if other["comment"] == one["comment"] and int(other["number"]) > int(one["number"])
        ]  # fmt: skip
        if not any(
            minutes(other["limit"]) > minutes(one["limit"])
            and memory_mib(other["memory"]) > memory_mib(one["memory"])
            for other in again
        ):
            yield f"{one} was not asked for again with more time and memory: {again}"


def minutes(limit: str) -> float:
    """Of SLURM's D-HH:MM:SS."""
    days, _, clock = limit.rpartition("-")
    parts = [int(part) for part in clock.split(":")]
    seconds = sum(part * 60**place for place, part in enumerate(reversed(parts)))
    return int(days or 0) * 1440 + seconds / 60


def memory_mib(text: str) -> float:
    """Of SLURM's 3000M or 2.5G."""
    return float(text.rstrip("KMGT")) * {"K": 1 / 1024, "M": 1, "G": 1024, "T": 1 << 20}[text[-1]]


def one_of(fault: type[Fault], folder: Path) -> Run:
    """A run that meets ``fault``, on a SLURM of its own."""
    place = folder / fault.__name__.lower()
    place.mkdir()
    with ExitStack() as stack:
        if fault is Disk:  # what is mounted before the servers start is seen by their jobs
            (place / "results").mkdir()
            stack.enter_context(small_disk(place / "results", DISK_BYTES))
        slurm = stack.enter_context(local_slurm(folder / f"s{fault.__name__[0]}"))
        met = fault(slurm, place)
        done = run(slurm, place, fault.name, SMALL, beside=met.beside)
        done.wrong += met.missed(done)
    return done


def all_of(folder: Path, names: list[str]) -> list[Run]:
    """An undisturbed run, and one for each fault of ``names``, compared with it."""
    runs: list[Run] = []
    for fault in (Fault, *(FAULTS[name] for name in names)):
        runs.append(one_of(fault, folder))
        if len(runs) > 1:
            runs[-1].compare(runs[0])
        print(runs[-1].summary(), flush=True)
        if runs[0].status:
            break
    return runs

"""What a run will take, before it starts: time on the cores it has, disk, memory."""

from __future__ import annotations

import heapq
import shutil
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

from lfcore.errors import SettingsError
from lfcore.timing import duration, memory_bytes
from lfcore.workflow.costs import Cost

START_SECONDS = 0.7
"""Of each job: a start of Python, which reads the library."""
SPARE = 1.2
"""A forecast is to be within a fifth: a disk must hold so much more."""
UNITS = (1e9, "billion "), (1e6, "million "), (1, "")


@dataclass(frozen=True)
class Task:
    """A job of a run that is still to be made.

    Attributes
    ----------
    after : numbers of those that must be done before.
    rays : that it traces for a light field of the tables; 0 for all other jobs.
    """

    cost: Cost
    threads: int = 1
    priority: int = 0
    after: Collection[int] = ()
    rays: int = 0

    def seconds(self, pace: float = 1.0) -> float:
        """By the clock, where it has its cores; ``pace`` is seconds here for a measured one."""
        return pace * (START_SECONDS + self.cost.core_seconds / self.threads)


@dataclass(frozen=True)
class Forecast:
    """Wall seconds, the most memory and disk at any time, rays and jobs of a run."""

    seconds: float
    mib: float
    bytes: float
    rays: int
    jobs: int

    def text(self, cores: int) -> str:
        """One line."""
        traced = f", {rays_of(None, self.rays)}" if self.rays else ""
        needs = f"{size(self.bytes)} of disk, {size(self.mib * 2**20)} of memory"
        return (
            f"To be made: {counted(self.jobs, 'job')}{traced}. About {duration(self.seconds)} on "
            f"{counted(cores, 'core')}, {needs}."
        )


def forecast(tasks: Mapping[int, Task], cores: int, pace: float = 1.0) -> Forecast:
    """Give each core that is free the ready task of the highest priority, longest first.

    ``tasks`` are those that are left, by number; what they wait for beside them is done.  Files
    that are temporary are there until all tasks after theirs are done.
    """
    before = {number: tasks.keys() & set(task.after) for number, task in tasks.items()}
    followers: dict[int, list[int]] = {number: [] for number in tasks}
    for number, others in before.items():
        for other in others:
            followers[other].append(number)
    waits = {number: len(others) for number, others in before.items()}
    readers = {number: len(others) for number, others in followers.items()}
    seconds = {number: task.seconds(pace) for number, task in tasks.items()}

    def order(number: int) -> tuple[float, float, int]:
        return -tasks[number].priority, -seconds[number], number

    ready = [order(number) for number, wait in waits.items() if not wait]
    heapq.heapify(ready)
    running: list[tuple[float, int]] = []
    now, free = 0.0, cores
    memory = disk = most_memory = most_disk = 0.0
    while ready or running:
        later = []
        while ready and free:
            entry = heapq.heappop(ready)
            task, number = tasks[entry[2]], entry[2]
            if min(task.threads, cores) > free:
                later.append(entry)
                continue
            free -= min(task.threads, cores)
            memory += task.cost.mib
            disk += task.cost.kept_bytes + task.cost.temporary_bytes
            heapq.heappush(running, (now + seconds[number], number))
        for entry in later:
            heapq.heappush(ready, entry)
        most_memory, most_disk = max(most_memory, memory), max(most_disk, disk)
        now, number = heapq.heappop(running)
        free += min(tasks[number].threads, cores)
        memory -= tasks[number].cost.mib
        if not followers[number]:
            disk -= tasks[number].cost.temporary_bytes
        for other in before[number]:
            readers[other] -= 1
            if not readers[other]:
                disk -= tasks[other].cost.temporary_bytes
        for follower in followers[number]:
            waits[follower] -= 1
            if not waits[follower]:
                heapq.heappush(ready, order(follower))
    rays = sum(task.rays for task in tasks.values())
    return Forecast(now, most_memory, most_disk, rays, len(tasks))


def check_disk(need: Forecast, folder: str | Path) -> None:
    """Raise :class:`SettingsError` where the disk of ``folder`` is too small for the run."""
    folder = Path(folder).resolve()
    there = next(place for place in (folder, *folder.parents) if place.is_dir())
    free = shutil.disk_usage(there).free
    wanted = need.bytes * SPARE
    if wanted > free:
        raise SettingsError(
            f"the run needs {size(wanted)}, and the disk has {size(free)} left",
            file=folder,
            remedy="Free some, run in a folder of another disk (--directory), or leave out the "
            "largest of angular_resolutions",
        )


def check_memory(need: Forecast) -> str:
    """A warning where the machine has less memory than the run may take; empty otherwise."""
    here = memory_bytes()
    if not here or need.mib * 2**20 <= here:
        return ""
    return f"The machine has {size(here)} of memory: use fewer --cores, or a smaller tile_mib."


def counted(number: int, what: str) -> str:
    """``1 job``, ``2 jobs``."""
    return f"{number} {what}{'s' * (number != 1)}"


def size(number: float) -> str:
    """Bytes, as MiB or GiB."""
    return f"{number / 2**20:.0f} MiB" if number < 2**30 else f"{number / 2**30:.1f} GiB"


def rays_of(done: float | None, total: float) -> str:
    """``68.7 billion rays``; of which so many are ``done``, unless that is None."""
    scale, name = next(unit for unit in UNITS if total >= unit[0])
    digits = 1 if name else 0
    first = "" if done is None else f"{done / scale:.{digits}f} of "
    return f"{first}{total / scale:.{digits}f} {name}rays"

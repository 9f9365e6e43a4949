"""What jobs cost, before they run: how many tiles one takes, and the time and memory it asks for.

How work is cut depends on the configuration alone, so that a second run finds what the first has
made.  What a job asks of a cluster may follow what was measured: of a scene and N that was traced
before, at any M, its own seconds and memory.

What a whole run takes (:mod:`lfcore.workflow.forecast`) is told from :func:`job_cost`: what each
stage of a scene and N was measured to take, in ``job_costs.csv``.
"""

from __future__ import annotations

import csv
import functools
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from lfcore.files import read_json
from lfcore.storage.layout import Tile
from lfcore.workflow import cases

NANOSECONDS = {16: 290.0, 32: 143.0, 64: 78.0, 128: 53.0, 256: 34.0, 512: 55.0}
"""Core time a ray by N, traced and encoded: the most of three scenes at M = 128, whose fixed costs
weigh most, in benchmarks/published/tables_m128.csv."""
SHARED_SECONDS = 15.0
"""From this on a light field is two jobs at least, so that two cores share it: less is soon done
on one of them, and each job costs the start of a process."""
MOST_BATCHES = 4096
"""Of one light field: a plan of as many jobs takes a few seconds."""
SET_UP_SECONDS = 30.0
"""Of a job on a busy node: two starts of Snakemake, the scene, programs that are built anew."""
MARGIN = 3.0
"""Of the time that a job is given over what it should take."""
BASE_MIB = 1500
"""Of a process with its libraries, programs, and frames on their way."""
SCENE_FACTOR = 8
"""Memory of a scene over its compressed file."""
PLANES = 8
"""Sensor planes where the scene says how many."""
JOB_COSTS = Path(__file__).with_name("job_costs.csv")
"""Written by ``python -m benchmarks.job_costs`` from what runs took."""


def nanoseconds_a_ray(views: int) -> float:
    """Core time of one ray of N = ``views``: between measured N by their logarithm."""
    known = sorted(NANOSECONDS.items())
    (least, first), (most, last) = known[0], known[-1]
    if views <= least:  # as many starts for fewer rays
        return first * least / views
    return _between(known, views) if views < most else last


@dataclass(frozen=True)
class Batch:
    """The tiles ``start`` ... ``stop`` - 1, which are one job, and their rays."""

    start: int
    stop: int
    rays: int


def batches(tiles: list[Tile], minutes: float) -> list[Batch]:
    """Runs of tiles that are one job each, of about ``minutes``; two at least of long ones."""
    rays = [tile.rays for tile in tiles]
    seconds = sum(rays) * nanoseconds_a_ray(tiles[0].layout.views) * 1e-9
    count = min(batch_count(seconds, minutes), len(tiles))
    cuts = [place * len(tiles) // count for place in range(count + 1)]
    return [Batch(a, b, sum(rays[a:b])) for a, b in itertools.pairwise(cuts)]


def named_batches(settings: Mapping, views: int) -> dict[str, Batch]:
    """The batches of N = ``views``, by their job's name in files and logs, in order."""
    cut = batches(cases.tiles(settings, views), settings["job_minutes"])
    return {f"{place:04d}": some for place, some in enumerate(cut)}


def batch_count(seconds: float, minutes: float) -> int:
    """In how many jobs so many core seconds are cut, as far as there are tiles."""
    least = 2 if seconds >= SHARED_SECONDS else 1
    return min(max(math.ceil(seconds / (60 * minutes)), least), MOST_BATCHES)


def small(minutes: float, cut: Mapping[int, Mapping[str, Batch]]) -> bool:
    """Whether all batches of all N together are no more than one job of ``minutes``."""
    seconds = sum(
        batch.rays * nanoseconds_a_ray(views) * 1e-9
        for views, some in cut.items()
        for batch in some.values()
    )
    return seconds <= 60 * minutes


def trace_minutes(rays: int, views: int, traced: Mapping | None, attempt: int = 1) -> int:
    """Minutes to ask for, for a job of so many rays; more with every attempt.

    ``traced`` is what :func:`traced_before` gave.
    """
    each = nanoseconds_a_ray(views) * 1e-9
    if traced and traced["rays"]:
        each = (traced["seconds"] + traced["encode_seconds"]) / traced["rays"]
    return math.ceil((SET_UP_SECONDS + rays * each * MARGIN) / 60) * attempt


def trace_mib(scene_mib: float, pixels: int, traced: Mapping | None, attempt: int = 1) -> int:
    """Memory to ask for while tiles of M = ``pixels`` are traced; more with every attempt."""
    need = BASE_MIB + SCENE_FACTOR * scene_mib
    if traced and traced.get("memory_mib"):
        need = max(need / 2, 1.25 * traced["memory_mib"])
    return math.ceil(need + planes_mib(pixels)) * attempt


def sums_mib(pixels: int, attempt: int = 1) -> int:
    """Memory to ask for where whole planes of M = ``pixels`` are summed or formed."""
    return (BASE_MIB + planes_mib(pixels)) * attempt


def planes_mib(pixels: int) -> int:
    """Sums of whole sensor planes: 3 colours of 8 bytes a pixel, and half as much of pictures."""
    return math.ceil(PLANES * pixels**2 * 36 / 2**20)


@functools.cache
def traced_before(results: str | Path, scene: str, views: int) -> dict | None:
    """What a run of this scene and N measured, at the largest M there is; None without one."""
    found = sorted(
        Path(results).glob(f"{scene}/M*/N{views}/trace.json"), key=lambda file: int(_pixels(file))
    )
    for file in reversed(found):
        try:
            return read_json(file)
        except (OSError, ValueError):
            continue
    return None


def _pixels(file: Path) -> str:
    digits = file.parents[1].name[1:]
    return digits if digits.isdigit() else "0"


@dataclass(frozen=True)
class Cost:
    """What a job takes: seconds of a core, MiB of memory at most, and bytes that it writes.

    ``kept_bytes`` stay; ``temporary_bytes`` are deleted when the jobs that read them are done.
    """

    core_seconds: float
    mib: float
    kept_bytes: float = 0.0
    temporary_bytes: float = 0.0

    def of_share(self, share: float) -> Cost:
        """Of one of several jobs that share the work; each needs the memory of all."""
        return Cost(
            self.core_seconds * share,
            self.mib,
            self.kept_bytes * share,
            self.temporary_bytes * share,
        )


SMALL_JOB = Cost(0.5, 250.0)
"""A job that is not in the table of costs: all that take long are."""
Measured = Mapping[tuple[str, int, int], Cost]
"""Costs of a stage by scene (empty where it is of none), N (0 where it has none) and M."""


@functools.cache
def measured_costs(file: Path = JOB_COSTS) -> Mapping[str, Measured]:
    """The table of costs by stage."""
    found: dict[str, dict[tuple[str, int, int], Cost]] = {}
    with file.open(encoding="utf-8", newline="") as text:
        for row in csv.DictReader(line for line in text if not line.startswith("#")):
            place = row["scene"], int(row["N"]), int(row["M"])
            cost = Cost(*(float(row[field.name]) for field in fields(Cost)))
            found.setdefault(row["stage"], {})[place] = cost
    return found


def job_cost(
    stage: str, scene: str = "", views: int = 0, pixels: int = 0, *, file: Path = JOB_COSTS
) -> Cost:
    """What all jobs of a stage take for one scene and N (0 without) at M = ``pixels``.

    Measured costs are joined by a power of N, and linearly in the number of pixels.  A scene that
    was measured at a single M grows with M as the one that was measured at most.  One that was not
    measured costs what the dearest of those does that were measured at as many.
    """
    known = measured_costs(file).get(stage)
    if not known:
        return SMALL_JOB
    names = sorted({name for name, _, _ in known})
    sizes = {name: {m for other, _, m in known if other == name} for name in names}
    widest = max(names, key=lambda name: len(sizes[name]))

    def cost(name: str, size: int) -> Cost:
        return Cost(*(_told(known, name, views, size, field.name) for field in fields(Cost)))

    if scene not in names:
        told = [name for name in names if len(sizes[name]) == len(sizes[widest])]
        return max((cost(name, pixels) for name in told), key=lambda one: one.core_seconds)
    if len(sizes[scene]) > 1 or len(sizes[widest]) == 1 or pixels in sizes[scene]:
        return cost(scene, pixels)
    (size,) = sizes[scene]
    if size not in sizes[widest]:  # too far off to be compared
        return cost(widest, pixels)
    there, here, own = cost(widest, pixels), cost(widest, size), cost(scene, size)
    grown = (
        getattr(own, field.name) * getattr(there, field.name) / (getattr(here, field.name) or 1.0)
        for field in fields(Cost)
    )
    return Cost(*grown)


def _told(known: Measured, scene: str, views: int, pixels: int, what: str) -> float:
    """One number of :class:`Cost` at N and M, from those of one scene."""
    points = []
    for size in sorted({m for name, _, m in known if name == scene}):
        costs = {
            n: getattr(cost, what)
            for (name, n, m), cost in known.items()
            if (name, m) == (scene, size)
        }
        points.append((float(size**2), _power(sorted(costs.items()), views)))
    return _linear(points, float(pixels**2))


def _power(points: Sequence[tuple[int, float]], views: int) -> float:
    """Between N by a power of it; fewer cost what the fewest do, more as their rays."""
    (least, first), (most, last) = points[0], points[-1]
    if views <= least:
        return first
    if views >= most:
        return last * (views / most) ** 2 if most else last
    return _between(points, views)


def _between(points: Sequence[tuple[int, float]], views: int) -> float:
    """By the power of N through the points on both sides; by the line where one is 0."""
    (low, below), (high, above) = next(
        pair for pair in itertools.pairwise(points) if pair[0][0] <= views <= pair[1][0]
    )
    share = math.log(views / low) / math.log(high / low)
    return below * (above / below) ** share if below and above else below + share * (above - below)


def _linear(points: Sequence[tuple[float, float]], place: float) -> float:
    """By the line through the points on both sides, or the nearest two; one alone is constant."""
    if len(points) == 1:
        return points[0][1]
    (x0, y0), (x1, y1) = next(
        (pair for pair in itertools.pairwise(points) if place <= pair[1][0]), points[-2:]
    )
    return max(y0 + (y1 - y0) * (place - x0) / (x1 - x0), 0.0)

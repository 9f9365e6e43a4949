"""What jobs cost, before they run: how many tiles one takes, and the time and memory it asks for.

How work is cut depends on the configuration alone, so that a second run finds what the first has
made.  What a job asks of a cluster may follow what was measured: of a scene and N that was traced
before, at any M, its own seconds and memory.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lfcore.files import read_json
from lfcore.storage.layout import Tile

NANOSECONDS = {16: 290.0, 32: 143.0, 64: 78.0, 128: 53.0, 256: 34.0, 512: 55.0}
"""Core time a ray by N, traced and encoded: the most of three scenes at M = 128, whose fixed costs
weigh most, in benchmarks/published/tables_m128.csv."""
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


def nanoseconds_a_ray(views: int) -> float:
    """Core time of one ray of N = ``views``: between measured N by their logarithm."""
    known = sorted(NANOSECONDS.items())
    if views <= known[0][0]:  # as many starts for fewer rays
        return known[0][1] * known[0][0] / views
    for (low, below), (high, above) in itertools.pairwise(known):
        if views <= high:
            share = math.log(views / low) / math.log(high / low)
            return below * (above / below) ** share
    return known[-1][1]


@dataclass(frozen=True)
class Batch:
    """The tiles ``start`` ... ``stop`` - 1, which are one job, and their rays."""

    start: int
    stop: int
    rays: int


def batches(tiles: list[Tile], minutes: float) -> list[Batch]:
    """Runs of tiles that are one job each: of about ``minutes``, and two at least of two tiles."""
    rays = [tile.rays for tile in tiles]
    seconds = sum(rays) * nanoseconds_a_ray(tiles[0].layout.views) * 1e-9
    count = min(max(math.ceil(seconds / (60 * minutes)), 2), len(tiles), MOST_BATCHES)
    cuts = [place * len(tiles) // count for place in range(count + 1)]
    return [Batch(a, b, sum(rays[a:b])) for a, b in itertools.pairwise(cuts)]


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


def planes_mib(pixels: int, planes: int = PLANES) -> int:
    """Sums of whole sensor planes: 3 colours of 8 bytes a pixel, and half as much of pictures."""
    return math.ceil(planes * pixels**2 * 36 / 2**20)


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

"""What jobs cost, before they run: how many tiles one takes, and the time and memory it asks for.

How work is cut depends on the configuration alone, so that a second run finds what the first has
made.  What a job asks of a cluster may follow what was measured: of a scene and N that was traced
before, at any M, its own seconds and memory.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
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


def batches(tiles: list[Tile], minutes: float) -> list[range]:
    """Runs of tiles that are one job each: of about ``minutes``, and two at least of two tiles."""
    views = tiles[0].layout.views
    seconds = sum(tile.rays for tile in tiles) * nanoseconds_a_ray(views) * 1e-9
    count = math.ceil(seconds / (60 * minutes))
    count = min(max(count, 2), len(tiles), MOST_BATCHES)
    cuts = [place * len(tiles) // count for place in range(count + 1)]
    return [range(a, b) for a, b in itertools.pairwise(cuts)]


def trace_minutes(tiles: list[Tile], traced: Mapping | None, attempt: int = 1) -> int:
    """Minutes to ask for, for a job of these tiles; more with every attempt.

    ``traced`` is what :func:`traced_before` gave.
    """
    views = tiles[0].layout.views
    each = nanoseconds_a_ray(views) * 1e-9
    if traced and traced["rays"]:
        each = (traced["seconds"] + traced["encode_seconds"]) / traced["rays"]
    seconds = SET_UP_SECONDS + sum(tile.rays for tile in tiles) * each * MARGIN
    return math.ceil(seconds / 60) * attempt


def trace_mib(scene_mib: float, pixels: int, traced: Mapping | None, attempt: int = 1) -> int:
    """Memory to ask for while tiles of M = ``pixels`` are traced; more with every attempt."""
    need = BASE_MIB + SCENE_FACTOR * scene_mib
    if traced and traced.get("memory_mib"):
        need = max(need / 2, 1.25 * traced["memory_mib"])
    return math.ceil(need + planes_mib(pixels)) * attempt


def planes_mib(pixels: int, planes: int = PLANES) -> int:
    """Sums of whole sensor planes: 3 colours of 8 bytes a pixel, and half as much of pictures."""
    return math.ceil(planes * pixels**2 * 36 / 2**20)


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

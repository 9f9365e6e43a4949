"""The tiles of each job, and the minutes and memory that a job requests from a cluster."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lfcore.optics.size import Pixels, Size
from lfcore.storage.layout import Tile
from lfcore.workflow import cases

NANOSECONDS = {8: 580.0, 16: 290.0, 32: 143.0, 64: 78.0, math.inf: 55.0}
"""Core time per ray, traced and encoded, up to so many views per side; the slowest of three scenes
at 128 x 128 pixels, where fixed costs weigh most."""
SHARED_SECONDS = 15.0
"""A light field that takes longer is at least two jobs, so that two cores share it."""
MOST_BATCHES = 4096
SET_UP_SECONDS = 30.0
"""The start of a job on a busy node: Snakemake twice, the scene, kernels to build."""
MARGIN = 3.0
"""The requested time over the expected time."""
BASE_MIB = 1500
"""The memory of a process with its libraries, kernels and frames."""
SCENE_FACTOR = 8
"""The memory of a scene over its compressed file."""
PLANES = 8
"""The number of sensor planes where the scene sets it."""


def nanoseconds_per_ray(views: int) -> float:
    """Expected core time of one ray where there are ``views`` per side."""
    return next(cost for most, cost in NANOSECONDS.items() if views <= most)


@dataclass(frozen=True)
class Batch:
    """The tiles ``start`` ... ``stop`` - 1, which are one job, and their rays."""

    start: int
    stop: int
    rays: int


def batches(tiles: Sequence[Tile], minutes: float) -> list[Batch]:
    """Cut tiles into jobs of about ``minutes``; the cut depends on the configuration alone, so
    that a second run finds the files of the first."""
    rays = [tile.rays for tile in tiles]
    seconds = sum(rays) * nanoseconds_per_ray(tiles[0].layout.views) * 1e-9
    least = 2 if seconds >= SHARED_SECONDS else 1
    count = min(max(math.ceil(seconds / (60 * minutes)), least), MOST_BATCHES, len(tiles))
    cuts = [place * len(tiles) // count for place in range(count + 1)]
    return [Batch(a, b, sum(rays[a:b])) for a, b in itertools.pairwise(cuts)]


def named_batches(settings: Mapping, views: int) -> dict[str, Batch]:
    """The batches of a light field by the name of their job in files and logs, in order."""
    cut = batches(cases.tiles(settings, views), settings["job_minutes"])
    return {f"{place:04d}": batch for place, batch in enumerate(cut)}


def trace_minutes(rays: int, views: int) -> int:
    """Minutes to request for the tracing of so many rays."""
    seconds = rays * nanoseconds_per_ray(views) * 1e-9
    return math.ceil((SET_UP_SECONDS + seconds * MARGIN) / 60)


def trace_mib(scene_mib: float, pixels: Pixels) -> int:
    """Memory to request for tracing pictures of ``pixels``."""
    return math.ceil(BASE_MIB + SCENE_FACTOR * scene_mib + planes_mib(pixels))


def sums_mib(pixels: Pixels) -> int:
    """Memory to request where whole planes of ``pixels`` are summed or formed."""
    return BASE_MIB + planes_mib(pixels)


def planes_mib(pixels: Pixels) -> int:
    """Sums of whole sensor planes: 3 colours of 8 bytes per pixel, and half as much of pictures."""
    return math.ceil(PLANES * math.prod(Size.of(pixels)) * 36 / 2**20)

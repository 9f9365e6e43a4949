"""The tiles of each job, and the minutes and memory that a job requests from a cluster."""

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lfcore.optics.size import Pixels, Size
from lfcore.storage.instants import GROUP
from lfcore.storage.layout import Tile
from lfcore.workflow import cases

NANOSECONDS = {8: 580.0, 16: 290.0, 32: 143.0, 64: 78.0, math.inf: 55.0}
"""The core nanoseconds per ray, traced and encoded, by the most views per side; of the slowest of
three scenes at 128 x 128 pixels, where fixed costs are largest."""
SHARED_SECONDS = 15.0
"""The seconds above which a light field is at least two jobs, for two cores."""
MOST_BATCHES = 4096
"""The most jobs of a light field."""
SET_UP_SECONDS = 30.0
"""The start of a job on a busy node: Snakemake twice, the scene, and kernels."""
MARGIN = 3.0
"""The ratio of the requested to the expected time."""
ITEM_MINUTES = 10.0
"""The minutes to request per megapixel of a data set's item: twenty times a focal stack's core
time, since items of other kinds have more pictures and rays."""
BASE_MIB = 1500
"""The memory, MiB, of a process with its libraries, kernels and frames."""
SCENE_FACTOR = 8
"""The ratio of a scene's memory to its compressed file."""
PLANES = 8
"""The assumed number of a scene's sensor planes."""


def nanoseconds_per_ray(views: int) -> float:
    """Return the expected core time of a ray, with ``views`` per side."""
    return next(cost for most, cost in NANOSECONDS.items() if views <= most)


@dataclass(frozen=True)
class Batch:
    """A job: the tiles ``start`` ... ``stop`` - 1, and the number of their rays."""

    start: int
    stop: int
    rays: int


def batches(tiles: Sequence[Tile], minutes: float) -> list[Batch]:
    """Cut tiles into jobs of about ``minutes``; the cut depends only on the configuration, so that
    a second run finds the first run's files."""
    rays = [tile.rays for tile in tiles]
    seconds = sum(rays) * nanoseconds_per_ray(tiles[0].layout.views) * 1e-9
    least = 2 if seconds >= SHARED_SECONDS else 1
    count = min(max(math.ceil(seconds / (60 * minutes)), least), MOST_BATCHES, len(tiles))
    cuts = [place * len(tiles) // count for place in range(count + 1)]
    return [Batch(a, b, sum(rays[a:b])) for a, b in itertools.pairwise(cuts)]


def named_batches(settings: Mapping, views: int) -> dict[str, Batch]:
    """Return a light field's batches by the name of their job in files and logs, in order."""
    cut = batches(cases.tiles(settings, views), settings["job_minutes"])
    return {f"{place:04d}": batch for place, batch in enumerate(cut)}


def trace_minutes(rays: int, views: int) -> int:
    """Return the minutes to request for tracing ``rays``."""
    seconds = rays * nanoseconds_per_ray(views) * 1e-9
    return math.ceil((SET_UP_SECONDS + seconds * MARGIN) / 60)


def film_minutes(pixels: Pixels) -> int:
    """Return the minutes to request for a group of a film's instants."""
    return trace_minutes(GROUP * 64 * math.prod(Size.of(pixels)), 4)


def items_minutes(items: int, pixels: Pixels) -> int:
    """Return the minutes to request for items of a data set."""
    seconds = 60 * ITEM_MINUTES * items * math.prod(Size.of(pixels)) / 1e6
    return math.ceil((SET_UP_SECONDS + seconds) / 60)


def trace_mib(scene_mib: float, pixels: Pixels) -> int:
    """Return the memory to request for tracing pictures of ``pixels``."""
    return math.ceil(BASE_MIB + SCENE_FACTOR * scene_mib + planes_mib(pixels))


def sums_mib(pixels: Pixels) -> int:
    """Return the memory to request for summing or forming whole planes of ``pixels``."""
    return BASE_MIB + planes_mib(pixels)


def planes_mib(pixels: Pixels) -> int:
    """Return the memory of planes: 3 sums of 8 bytes per pixel, and half of it for pictures."""
    return math.ceil(PLANES * math.prod(Size.of(pixels)) * 36 / 2**20)

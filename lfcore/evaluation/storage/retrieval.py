"""What it costs to read a stored light field: one view, macropixel, rectangle, 1 to 100 planes.

Each against decoding alone.  A long light field is measured on its first segment, or the first
frames of it, and the seconds are scaled to the whole; the share that was measured is reported.
"""

from __future__ import annotations

import copy
import functools
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.evaluation.timing import Stopwatch, clocked
from lfcore.opencl.device import Device
from lfcore.optics.planes import SensorPlane
from lfcore.progress import Progress, silent
from lfcore.refocus.slicing import CHUNK_BYTES, PlaneFormer
from lfcore.storage.lightfield import LightFieldFile

COLUMNS = [
    "scene", "N", "M", "layout", "pixel_format", "segments", "file_bytes", "what",
    "measured_share", "decoded_frames_share", "seconds", "ratio_to_decoding",
]  # fmt: skip
RECTANGLE = 8
"""Pixels along a side of the rectangle of (u, v)."""
DECODING = "decoding alone"


@dataclass(frozen=True)
class Cost:
    """CPU ``seconds`` scaled to the whole file, ``share`` of the file's rays that was measured,
    ``frames`` decoded over the frames that were in reach."""

    what: str
    seconds: float
    share: float
    frames: float


def retrieval_rows(
    path: str | Path,
    scene: str,
    focus_m: tuple[float, float],
    device: Device,
    *,
    planes: Sequence[int],
    rays: int,
    repeats: int,
    progress: Progress = silent,
) -> list[dict]:
    """Rows of one file (columns :data:`COLUMNS`).

    Parameters
    ----------
    focus_m : nearest and farthest distance in focus; planes are spread evenly in dioptres.
    planes : how many at a time.
    rays : the most that planes are formed from.
    repeats : rounds, of which medians are taken.
    device : forms the planes; one thread, since seconds are CPU seconds of this process.
    progress : called with (measurements done, of all).

    Raises :class:`StorageError` for a damaged file, :class:`OpticsError` for a distance that was
    not recorded.
    """
    field = LightFieldFile.open(path)
    measurements = [*_planes(field, focus_m, planes, rays, device), *_pieces(field)]
    rounds: list[list[Cost]] = [[] for _ in measurements]
    for round_ in range(repeats):
        for at, measurement in enumerate(measurements):
            rounds[at].append(measurement())
            progress(round_ * len(rounds) + at + 1, repeats * len(rounds))
    alone = statistics.median(cost.seconds for cost in rounds[0])
    layout = field.layout
    facts = {
        "scene": scene,
        "N": layout.views,
        "M": layout.pixels,
        "layout": layout.kind,
        "pixel_format": layout.pixel_format,
        "segments": len(field.segments),
        "file_bytes": Path(path).stat().st_size,
    }
    return [facts | _row(costs, alone) for costs in rounds]


def _row(costs: list[Cost], alone: float) -> dict:
    seconds = statistics.median(cost.seconds for cost in costs)
    return {
        "what": costs[0].what,
        "measured_share": costs[0].share,
        "decoded_frames_share": costs[0].frames,
        "seconds": seconds,
        "ratio_to_decoding": seconds / alone,
    }


def focal_planes(
    field: LightFieldFile, focus_m: tuple[float, float], count: int
) -> list[SensorPlane]:
    """``count`` planes through the whole lens, evenly spaced in dioptres; a single one is in the
    middle."""
    near, far = (1 / distance for distance in focus_m)
    deltas = np.linspace(near, far, count) if count > 1 else [(near + far) / 2]
    widest = field.require_slab().camera.f_number
    return [SensorPlane(float(1 / delta), widest) for delta in deltas]


def _planes(
    field: LightFieldFile,
    focus_m: tuple[float, float],
    counts: Sequence[int],
    rays: int,
    device: Device,
) -> Iterator[Callable[[], Cost]]:
    """Decoding alone, then decoding and forming planes, of the same frames of segment 0."""
    part, layout = field.segments[0], field.layout
    rays_a_frame = part.tile.rays / part.frames
    frames = min(part.frames, max(1, int(rays / rays_a_frame)))
    share = frames * rays_a_frame / layout.rays
    chunk = max(1, CHUNK_BYTES // layout.frame_bytes)
    field.check_segment(0)

    def alone() -> Cost:
        watch = Stopwatch(clock=time.process_time)
        for _ in watch.each("decode", field.frames(0, 0, frames, chunk=chunk)):
            pass
        return Cost(DECODING, watch.seconds["decode"] / share, share, 1.0)

    def formed(planes: list[SensorPlane], frames: int = frames) -> Cost:
        def form() -> None:
            first, former = 0, PlaneFormer(field.require_slab(), part.tile, planes, device)
            for some in field.frames(0, 0, frames, chunk=chunk):
                former.add(some, first)
                first += len(some)
            former.plane_sums()

        _, spent = clocked(form, clock=time.process_time)
        return Cost(f"{len(planes)} plane{'s' * (len(planes) > 1)}", spent / share, share, 1.0)

    yield alone
    for count in counts:
        planes = focal_planes(field, focus_m, count)
        formed(planes, 1)  # the program is built
        yield functools.partial(formed, planes)


def _pieces(field: LightFieldFile) -> Iterator[Callable[[], Cost]]:
    """One view, one macropixel and one rectangle, each by a file opened anew.

    Of the layout's elements (macropixels, or views) those in the middle of segment 0 are read.
    What needs all segments is read from segment 0, and its seconds are scaled.
    """
    layout, tile = field.layout, field.segments[0].tile
    column, row = tile.column + tile.columns // 2, tile.row + tile.rows // 2
    size = min(RECTANGLE, layout.pixels, tile.columns, tile.rows)
    in_all = layout.kind == "macropixels"  # every segment has some of a view
    if in_all:
        corner = (tile.column + (tile.columns - size) // 2, tile.row + (tile.rows - size) // 2)
        middle = layout.views // 2
        view, pixel = (middle, middle), (column, row)
    else:
        corner = ((layout.pixels - size) // 2,) * 2
        view, pixel = (column, row), (layout.pixels // 2,) * 2
    area = (*corner, corner[0] + size, corner[1] + size)
    rectangle = f"a rectangle of {size} x {size} (u, v)"
    yield lambda: _piece(field.path, "a view", lambda f: f.view(*view), in_all)
    yield lambda: _piece(field.path, "a macropixel", lambda f: f.macropixel(*pixel), not in_all)
    yield lambda: _piece(field.path, rectangle, lambda f: f.rectangle(*area), not in_all)


def _piece(path: Path, what: str, read: Callable[[LightFieldFile], object], in_all: bool) -> Cost:
    def read_anew() -> tuple[LightFieldFile, float]:
        field, share = LightFieldFile.open(path), 1.0
        if in_all:
            field, share = first_segment(field)
        read(field)
        return field, share

    (field, share), spent = clocked(read_anew, clock=time.process_time)
    spent /= share
    frames = field.count.frames / sum(part.frames for part in field.segments)
    return Cost(what, spent, share, frames)


def first_segment(field: LightFieldFile) -> tuple[LightFieldFile, float]:
    """The same file with only its first segment in reach, and that segment's share of the rays.

    What lies in other segments reads as black.
    """
    part = copy.copy(field)
    part.metadata = replace(field.metadata, segments=field.metadata.segments[:1])
    return part, part.segments[0].tile.rays / field.layout.rays

"""The cost of reading a stored light field: one view, macropixel, rectangle, 1 to 100 planes.

Each is compared with decoding alone.  Long light fields are measured on the first segment, or its
first frames, and scaled to the whole; the measured share is reported.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfcore.opencl.device import Device, page_aligned
from lfcore.optics.planes import SensorPlane
from lfcore.refocus.plane_former import PlaneFormer
from lfcore.refocus.slicing import CHUNK_BYTES
from lfcore.storage.lightfield import LightFieldFile
from lfcore.timing import clocked

RECTANGLE = 8
"""The side of the rectangle of (u, v), in pixels."""
DECODING = "decoding alone"


class Measurement(NamedTuple):
    """A timed piece of work.

    ``work`` returns the decoded frames over the frames in reach.  It covers a ``share`` of the
    file's rays, and its seconds are scaled to the whole.
    """

    what: str
    share: float
    work: Callable[[], float]


def retrieval_rows(
    path: str | Path,
    scene: str,
    focus_m: tuple[float, float],
    device: Device,
    *,
    planes: Sequence[int],
    rays: int,
    repeats: int,
) -> list[dict]:
    """Rows of one file.

    ``planes`` has numbers of planes, which are spread evenly in dioptres between both of
    ``focus_m``, and formed from at most ``rays``.  ``device`` has one thread: seconds are CPU
    seconds of this process, medians of ``repeats`` rounds.  Raises :class:`StorageError` for a
    damaged file, :class:`OpticsError` for a distance that was not recorded.
    """
    field = LightFieldFile.open(path)
    measurements = [*_planes(field, focus_m, planes, rays, device), *_pieces(field)]
    seconds = np.empty((repeats, len(measurements)))
    decoded = np.empty(len(measurements))
    for round_, at in np.ndindex(seconds.shape):
        _, share, work = measurements[at]
        decoded[at], spent = clocked(work, clock=time.process_time)
        seconds[round_, at] = spent / share
    medians = np.median(seconds, axis=0).tolist()
    layout = field.layout
    facts = {
        "scene": scene,
        "N": layout.views,
        "M": layout.size.as_given,
        "layout": layout.kind,
        "pixel_format": layout.pixel_format,
        "segments": len(field.segments),
        "file_bytes": Path(path).stat().st_size,
    }
    return [
        {
            **facts,
            "what": what,
            "measured_share": share,
            "decoded_frames_share": frames,
            "seconds": median,
            "ratio_to_decoding": median / medians[0],
        }
        for (what, share, _), frames, median in zip(
            measurements, decoded.tolist(), medians, strict=True
        )
    ]


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
) -> Iterator[Measurement]:
    """Decoding alone, then decoding and forming planes, of the same frames of segment 0."""
    part, layout = field.segments[0], field.layout
    rays_a_frame = part.tile.rays / part.frames
    frames = min(part.frames, max(1, int(rays / rays_a_frame)))
    share = frames * rays_a_frame / layout.rays
    chunk = max(1, CHUNK_BYTES // layout.frame_bytes)
    room = page_aligned((min(chunk, frames), layout.frame_bytes), np.uint8)
    field.video.check_segment(0)

    def alone() -> float:
        for _ in field.video.frames(0, 0, frames, chunk=chunk, rooms=repeat(room)):
            pass
        return 1.0

    def formed(planes: list[SensorPlane], frames: int) -> float:
        first, former = 0, PlaneFormer(field.require_slab(), part.tile, planes, device)
        for chunk_frames in field.video.frames(0, 0, frames, chunk=chunk, rooms=repeat(room)):
            former.add(chunk_frames, first)
            first += len(chunk_frames)
        former.plane_sums()
        return 1.0

    yield Measurement(DECODING, share, alone)
    for count in counts:
        planes = focal_planes(field, focus_m, count)
        formed(planes, 1)  # the program is built
        label = f"{count} plane{'s' * (count > 1)}"
        yield Measurement(label, share, partial(formed, planes, frames))


def _pieces(field: LightFieldFile) -> Iterator[Measurement]:
    """Read a view, a macropixel and a rectangle, opening the file anew for each.

    The elements of the layout (macropixels, or views) in the middle of segment 0 are read.  Pieces
    that need all segments are read from segment 0, and their seconds are scaled.
    """
    layout, tile = field.layout, field.segments[0].tile
    size = min(RECTANGLE, layout.pixels, tile.columns, tile.rows)
    outer = tile.column + tile.columns // 2, tile.row + tile.rows // 2
    inner = layout.inner.width // 2, layout.inner.height // 2
    in_all = layout.kind == "macropixels"  # every segment has some of a view
    if in_all:
        view, pixel = inner, outer
        left, top = tile.column + (tile.columns - size) // 2, tile.row + (tile.rows - size) // 2
    else:
        view, pixel = outer, inner
        left, top = ((side - size) // 2 for side in layout.inner)
    area = left, top, left + size, top + size
    rectangle = f"a rectangle of {size} x {size} (u, v)"
    yield _piece(field, "a view", lambda f: f.view(*view, codes=True), in_all)
    yield _piece(field, "a macropixel", lambda f: f.macropixel(*pixel, codes=True), not in_all)
    yield _piece(field, rectangle, lambda f: f.rectangle(*area, codes=True), not in_all)


def _piece(
    field: LightFieldFile, what: str, read_piece: Callable[[LightFieldFile], object], in_all: bool
) -> Measurement:
    def read_anew() -> float:
        reach = LightFieldFile.open(field.path)
        if in_all:  # only the first is in reach; the others read as black
            video = reach.video
            video.metadata = replace(video.metadata, segments=video.metadata.segments[:1])
        read_piece(reach)
        return reach.video.decoded_frames / sum(part.frames for part in reach.video.segments)

    share = field.segments[0].tile.rays / field.layout.rays if in_all else 1.0
    return Measurement(what, share, read_anew)

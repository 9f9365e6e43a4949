"""Encodes views into a light field file, one per frame."""

import hashlib
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfcore.files import draft_folder
from lfcore.optics.array import CameraArray
from lfcore.optics.slab import Extent, Slab
from lfcore.progress import Progress
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb

SEGMENT_RAYS = 1 << 27
"""The most rays of a segment of several rows of views."""


def store_views(
    path: Path,
    geometry: Slab | CameraArray,
    view: Callable[[int, int], np.ndarray],
    encoding: Encoding,
    *,
    name: str,
    digest: str | None = None,
    white: float = 1.0,
    peak: float | None = None,
    content: dict | None = None,
    progress: Progress | None = None,
) -> Metadata:
    """Encode all views into the light field file ``path``; each is read once.

    ``view(column, row)`` returns (height, width, 3): sRGB codes, uint8 or uint16, or floats in
    [0, 1], encoded as sRGB or, with ``peak``, as PQ. A camera array is a square grid of square
    pictures, and ``white`` is the light of its brightest code. The default digest is that of the
    views. After an error no file is left.
    """
    recorded: Slab | dict = (
        geometry if isinstance(geometry, Slab) else {**geometry.to_json(), "white": white}
    )
    held, (views, pixels) = _held(geometry)
    layout = FrameLayout(
        "views", views, pixels, pixel_format=encoding.stored_format, picture=held.pixels[2:],
        peak=peak,
    )  # fmt: skip
    column, row, columns, rows = held.views
    step = max(1, SEGMENT_RAYS // (columns * math.prod(layout.size)))
    tiles = [
        layout.tile(column, row + start, columns, min(step, rows - start), index)
        for index, start in enumerate(range(0, rows, step))
    ]
    hashed, done = hashlib.sha256(), 0
    with draft_folder(path) as folder:
        segments = [folder / f"{tile.index:04d}.mp4" for tile in tiles]
        for tile, segment in zip(tiles, segments, strict=True):
            frame_size = layout.frame_width, layout.frame_height
            with SegmentWriter(segment, encoding, *frame_size) as writer:
                for position in tile.elements() - np.array(held.views[:2], np.int32):
                    picture = view(*position.tolist())
                    hashed.update(np.ascontiguousarray(picture).data)
                    if picture.dtype == np.uint16:
                        picture = picture / np.float32(65535)
                    writer.write(frames_from_rgb(picture[None], layout.pixel_format, *frame_size))
                    done += 1
                    if progress:
                        progress(done, columns * rows)
        return join_segments(
            path, segments, tiles, layout, geometry=recorded, spec=encoding, content=content,
            scene={"name": name, "digest": digest or hashed.hexdigest()},
        )  # fmt: skip


def _held(geometry: Slab | CameraArray) -> tuple[Extent, tuple[int, int]]:
    """Return the stored views and pixels, and N and M."""
    if isinstance(geometry, Slab):
        return geometry.held, (geometry.views, geometry.pixels)
    n, m = geometry.cameras[0], geometry.tile[0]
    return Extent((0, 0, n, n), (0, 0, m, m)), (n, m)

"""Small light field files of known content, encoded and joined as the workflow does it."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from lfcore import Encoding, Slab
from lfcore.storage.container import join_segments
from lfcore.storage.decoding import decoded_planes, packed, ticks_per_frame
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.pixels import pixel_format
from lfcore.storage.segment import SegmentWriter, open_video, read_segment
from lfcore.storage.ycbcr import frames_from_rgb

LOSSLESS = Encoding("ffv1", "gbrp", preset=None, tune=None)


def tile_frames(views: np.ndarray, tile: Tile) -> np.ndarray:
    """(F, frame_bytes) uint8: a tile's frames of views [j, i, v, u], element by element."""
    layout = tile.layout
    size = (tile.frame_count, layout.frame_height, layout.frame_width, 3)
    frames = np.zeros(size, views.dtype)
    elements = tile.elements()
    wide, high = layout.slot
    edge = np.subtract(layout.slot, layout.inner)[::-1]
    for (column, row), (frame, x, y) in zip(elements, tile.placement(elements), strict=True):
        picture = views[:, :, row, column] if layout.kind == "macropixels" else views[row, column]
        padded = np.pad(picture, (*[(0, beyond) for beyond in edge], (0, 0)), mode="edge")
        frames[frame, y : y + high, x : x + wide] = padded
    return frames_from_rgb(frames, layout.pixel_format)


def write_field(
    path: Path,
    slab: Slab,
    layout: FrameLayout,
    frames_of: Callable[[Tile], np.ndarray],
    *,
    spec: Encoding = LOSSLESS,
    tiles: Sequence[Tile] | None = None,
    scene: str = "noise",
    **more,
) -> tuple[list[Tile], list[Path]]:
    """Encode the frames of each tile (default: three or more) and join; the tiles and segments."""
    tiles = list(tiles or layout.tiles(layout.rays, least=3, small_rays=0))
    segments = [path.with_name(f"{path.stem}{tile.index}.mp4") for tile in tiles]
    for tile, segment in zip(tiles, segments, strict=True):
        with SegmentWriter(segment, spec, layout.frame_width, layout.frame_height) as writer:
            writer.write(frames_of(tile))
    scene_of = {"name": scene, "digest": "0123"}
    join_segments(path, segments, tiles, layout, geometry=slab, scene=scene_of, spec=spec, **more)
    return tiles, segments


def segment_frames(path: Path, *, grey: bool = False) -> np.ndarray:
    """(F, frame_bytes) uint8: all frames of a segment."""
    about, _ = read_segment(path, grey=grey)
    with open_video(path) as file:
        video, form = file.streams.video[0], pixel_format(about.pixel_format)
        size, ticks = (about.width, about.height), ticks_per_frame(video.time_base)
        packets = (packet for packet in file.demux(video) if packet.size)
        decoded = decoded_planes(path, video.codec_context, packets, ticks, form, size)
        return next(packed((planes for _, planes in decoded), about.frames, form, size, 1 << 20))

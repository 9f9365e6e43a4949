"""A light field of waves in any layout."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from stored_fields import tile_frames, write_field

from lfcore import Camera, Encoding, Slab
from lfcore.storage.layout import FrameLayout, Tile


def waves(views: int, pixels: int) -> np.ndarray:
    """(N, N, M, M, 3) float32 in [0, 1], indexed [j, i, v, u]: smooth, with parallax."""
    j, i, v, u = np.mgrid[0:views, 0:views, 0:pixels, 0:pixels].astype(np.float32)
    x, y = (u + 0.3 * i) / pixels, (v + 0.3 * j) / pixels
    channels = [0.5 + 0.4 * np.sin(3 * x + c) * np.cos(4 * y + 2 * c) for c in range(3)]
    return np.stack(channels, -1).astype(np.float32)


@dataclass
class Stored:
    """A light field file with what it was made of."""

    path: Path
    field: np.ndarray
    layout: FrameLayout
    slab: Slab
    tiles: list[Tile]
    segments: list[Path]
    frames: list[np.ndarray]


def store(folder: Path, layout: FrameLayout, spec: Encoding, tiles: int = 3) -> Stored:
    """Encode and join the waves in that layout, in at least ``tiles`` tiles if it has them."""
    field = waves(layout.views, layout.pixels)
    slab = Slab(Camera(0.05, 0.036, 2.0, 3.0), layout.views, layout.pixels)
    cut = layout.tiles(layout.rays, least=tiles, small_rays=0)
    frames = [tile_frames(field, tile) for tile in cut]
    path = folder / "lightfield.mkv"
    by_tile = dict(zip(cut, frames, strict=True))
    _, paths = write_field(
        path, slab, layout, by_tile.__getitem__, spec=spec, tiles=cut, scene="waves"
    )
    return Stored(path, field, layout, slab, cut, paths, frames)


@pytest.fixture(scope="session")
def make_store():
    """The function :func:`store`."""
    return store


@pytest.fixture(scope="session")
def stored(tmp_path_factory) -> Stored:
    """Four segments of macropixels, H.264 with a key frame every 6 frames; not to be changed."""
    spec = Encoding("libx264", "yuv444p", crf=6, preset="veryfast", gop=6)
    layout = FrameLayout("macropixels", 6, 12, pixel_format="yuv444p")
    return store(tmp_path_factory.mktemp("stored"), layout, spec, tiles=4)

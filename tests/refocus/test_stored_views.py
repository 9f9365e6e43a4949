"""Frames of stored macropixels come tile by tile, in memory that is used again."""

import numpy as np
import pytest
from stored_fields import write_field

from lfcore.opencl.device import PAGE
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.refocus.stored_views import ahead, frame_chunks
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile

VIEWS, PIXELS = 16, 10
LAYOUT = FrameLayout("macropixels", VIEWS, PIXELS, pixel_format="gbrp")


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """The frames of each of several tiles, and the file."""
    file, draw = tmp_path_factory.mktemp("stored") / "lf.mkv", np.random.default_rng(8)
    tiles = LAYOUT.tiles(3 * PIXELS * VIEWS**2)
    frames = {
        tile: draw.integers(0, 256, (tile.frame_count, LAYOUT.frame_bytes), dtype=np.uint8)
        for tile in tiles
    }
    slab = Slab(Camera(0.05, 0.036, 2.0, 3.0), VIEWS, PIXELS)
    write_field(file, slab, LAYOUT, frames.__getitem__, tiles=tiles)
    return list(frames.values()), file


def test_tiles_take_turns_in_two_pieces_of_memory(stored):
    frames, file = stored
    assert len(frames) >= 3
    places = []
    with LightFieldFile.open(file) as field:
        for (tile, first, found), expected in zip(ahead(frame_chunks(field)), frames, strict=True):
            assert first == 0 and tile.frame_count == len(found)
            # The tile after it is being read meanwhile.
            assert np.array_equal(found, expected)
            places.append(found.ctypes.data)
    assert len(set(places)) == 2 and not any(place % PAGE for place in places)

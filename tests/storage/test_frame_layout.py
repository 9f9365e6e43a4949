"""Layouts: every ray has one place, whatever the size, order and packing."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.errors import StorageError
from lfcore.storage.curves import ORDERS, hilbert, serpentine
from lfcore.storage.defaults import frame_layout
from lfcore.storage.layout import KINDS, FrameLayout
from lfcore.storage.pixels import PIXEL_FORMATS

layouts = st.builds(
    frame_layout,
    kind=st.sampled_from(KINDS),
    views=st.integers(1, 9),
    pixels=st.integers(1, 17) | st.tuples(st.integers(1, 17), st.integers(1, 17)),
    order=st.sampled_from(sorted(ORDERS)),
    pack=st.integers(1, 5),
    pixel_format=st.sampled_from(sorted(PIXEL_FORMATS)),
)


@given(layouts, st.integers(1, 20_000))
@settings(max_examples=150)
def test_every_ray_has_one_place(layout, max_rays):
    tiles = layout.tiles(max_rays, small_rays=1000)
    seen, (columns, rows) = np.zeros(layout.outer[::-1], int), layout.inner
    for index, tile in enumerate(tiles):
        elements = tile.elements()
        places = tile.placement(elements)
        assert tile.index == index and len(elements) == tile.element_count
        seen[elements[:, 1], elements[:, 0]] += 1
        assert (np.diff(places[:, 0]) >= 0).all()  # scan order
        assert set(places[:, 0]) == set(range(tile.frame_count))
        taken = np.zeros((tile.frame_count, layout.frame_height, layout.frame_width), int)
        for frame, x, y in places:
            taken[frame, y : y + rows, x : x + columns] += 1
        assert taken.max() == 1 and taken.sum() == tile.rays
        blocks = layout.elements_per_frame * math.prod(layout.inner)
        assert tile.rays <= max(max_rays, blocks)
    assert (seen == 1).all()


@given(layouts)
@settings(max_examples=50)
def test_json_round_trip_and_frame_size(layout):
    assert FrameLayout.from_json(json.loads(json.dumps(layout.to_json()))) == layout
    step = layout.format.subsampling
    assert layout.frame_width % step == 0 and layout.frame_width >= layout.inner.width
    samples = layout.frame_width * layout.frame_height * (1.5 if step == 2 else 3)
    assert layout.frame_bytes == samples * (1 if layout.format.bits == 8 else 2)


@given(st.integers(1, 40), st.integers(1, 40), st.sampled_from(sorted(ORDERS)))
@settings(max_examples=100)
def test_orders_visit_each_cell_once(columns, rows, order):
    cells = ORDERS[order](columns, rows)
    assert cells.dtype == np.int32
    assert len({(c, r) for c, r in cells.tolist()}) == columns * rows == len(cells)
    assert cells.min() == 0 and cells.max(0).tolist() == [columns - 1, rows - 1]


@pytest.mark.parametrize("curve, columns, rows", [
    (serpentine, 7, 5), (serpentine, 1, 4), (hilbert, 16, 16), (hilbert, 32, 8), (hilbert, 4, 12),
])  # fmt: skip
def test_steps_are_short(curve, columns, rows):
    assert (np.abs(np.diff(curve(columns, rows), axis=0)).sum(1) == 1).all()


def test_much_work_is_shared_by_two_cores():
    layout = FrameLayout("macropixels", 64, 64)
    tiles = layout.tiles(layout.rays)
    assert len(tiles) == 2 and tiles[0].rays == tiles[1].rays
    assert len(FrameLayout("views", 2, 2).tiles(1 << 20)) == 1


def test_tiles_are_even():
    rays = [tile.rays for tile in FrameLayout("macropixels", 4, 100, pack=3).tiles(20_000)]
    assert max(rays) <= 20_000 and min(rays) > max(rays) // 2


def test_macropixels_by_hand():
    layout = FrameLayout("macropixels", views=5, pixels=4, order="serpentine", pack=2)
    assert (layout.slot, layout.frame_width, layout.frame_bytes) == ((6, 6), 16, 384)
    (tile,) = layout.tiles(1 << 20)
    blocks = [[0, 0], [2, 0], [2, 2], [0, 2]]
    expected = [[c + dc, r + dr] for c, r in blocks for dr in (0, 1) for dc in (0, 1)]
    assert tile.elements().tolist() == expected
    assert tile.placement([[3, 2]]).tolist() == [[2, 6, 0]]


@pytest.mark.parametrize("change", [
    {"kind": "rays"}, {"order": "spiral"}, {"pack": 0}, {"views": 0}, {"pixels": 2.5},
    {"pixel_format": "rgb24"}, {"kind": ["views"]}, {"unknown": 1},
])  # fmt: skip
def test_impossible_layouts_are_refused(change):
    good = FrameLayout("views", 4, 8).to_json()
    with pytest.raises(StorageError):
        FrameLayout.from_json(good | change)


def test_elements_outside_a_tile_are_refused():
    tile = FrameLayout("views", 4, 8).tile(0, 2, 4, 2)
    with pytest.raises(StorageError, match="outside"):
        tile.placement([[0, 1]])
    with pytest.raises(StorageError, match="does not fit"):
        tile.layout.tile(1, 1, 4, 1)

"""Frames: every ray has one place in any layout, and what of its colour survives."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_scenes import refused

from lfcore import StorageError
from lfcore.colour import srgb_decode, srgb_encode, to_uint8
from lfcore.evaluation.metrics import psnr
from lfcore.oracle import colour as truth
from lfcore.storage.defaults import frame_layout
from lfcore.storage.layout import KINDS, ORDERS, FrameLayout, hilbert, serpentine
from lfcore.storage.pixels import PIXEL_FORMATS, pixel_format
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames, rgb_to_ycbcr, ycbcr_to_rgb

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


def test_much_work_is_shared_evenly():
    layout = FrameLayout("macropixels", 64, 64)
    tiles = layout.tiles(layout.rays)
    assert len(tiles) == 2 and tiles[0].rays == tiles[1].rays
    assert len(FrameLayout("views", 2, 2).tiles(1 << 20)) == 1
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


def pictures(seed: int, shape=(2, 24, 32, 3)) -> np.ndarray:
    return np.random.default_rng(seed).random(shape).astype(np.float32)


@given(*[st.floats(0, 1) for _ in "rgb"], st.sampled_from([8, 10]))
def test_ycbcr_against_the_formula(red, green, blue, bits):
    expected = truth.ycbcr((red, green, blue), bits)
    for dtype, tolerance in ((np.float64, 1e-9), (np.float32, 1e-3)):
        rgb = np.array([red, green, blue], dtype)
        codes = rgb_to_ycbcr(rgb, bits)
        assert codes.dtype == dtype
        np.testing.assert_allclose(codes, expected, atol=tolerance)
        back = ycbcr_to_rgb(*np.moveaxis(codes, -1, 0), bits, dtype)
        np.testing.assert_allclose(back, rgb, atol=1e-5)


@given(st.floats(0, 1))
def test_srgb_curve(value):
    expected = truth.srgb_encode(value)
    for dtype, tolerance in ((np.float64, 1e-12), (np.float32, 1e-6)):
        encoded = srgb_encode(np.array([value], dtype))
        assert encoded.dtype == dtype and abs(encoded[0] - expected) <= tolerance
        assert abs(srgb_decode(encoded)[0] - value) <= 20 * tolerance


def test_srgb_codes_survive():
    codes = np.arange(256, dtype=np.uint8)
    assert (to_uint8(srgb_encode(srgb_decode(codes))) == codes).all()


@pytest.mark.parametrize("name, least", [("yuv444p", 52), ("yuv444p10le", 63), ("gbrp", 58)])
def test_round_trip_without_a_codec(name, least):
    rgb = pictures(1, (2, 33, 17, 3))
    back = rgb_from_frames(frames_from_rgb(rgb, name), name, 17, 33)
    assert psnr(back, rgb, peak=1) >= least
    codes = to_uint8(rgb)
    survive = to_uint8(rgb_from_frames(frames_from_rgb(codes, name), name, 17, 33)) == codes
    assert survive.all() or name == "yuv444p"


@pytest.mark.parametrize("name", ["yuv420p", "yuv420p10le"])
def test_chroma_is_the_mean_of_four(name):
    rgb, form = pictures(3), pixel_format(name)
    planes = form.views(frames_from_rgb(rgb, name), 32, 24)
    for f, y, x in ((0, 0, 0), (1, 5, 9), (1, 11, 15)):
        block = rgb[f, 2 * y : 2 * y + 2, 2 * x : 2 * x + 2].reshape(4, 3)
        mean = truth.ycbcr(block, form.bits).mean(0)
        assert abs(float(planes[1][f, y, x]) - mean[1]) <= 0.51
        assert abs(float(planes[2][f, y, x]) - mean[2]) <= 0.51


def test_linear_chroma_is_sited_in_the_centre():
    """A ramp of colour comes back straight, without a shift, away from the border."""
    ramp = np.linspace(0.2, 0.8, 32, dtype=np.float32)
    rgb = np.full((1, 8, 32, 3), 0.5, np.float32)
    rgb[..., 0] = ramp
    back = rgb_from_frames(frames_from_rgb(rgb, "yuv420p10le"), "yuv420p10le", 32, 8)
    np.testing.assert_allclose(back[0, :, 2:-2, 0], rgb[0, :, 2:-2, 0], atol=2e-3)


def test_padding_repeats_the_border():
    rgb = pictures(4, (1, 5, 5, 3))
    back = rgb_from_frames(frames_from_rgb(rgb, "gbrp", 16, 16), "gbrp", 16, 16)
    np.testing.assert_allclose(back[0, 4:, 4:], np.broadcast_to(back[0, 4, 4], (12, 12, 3)))


def test_misfits_are_refused():
    refused("even", frames_from_rgb, pictures(0, (1, 5, 5, 3)), "yuv420p")
    refused("unknown pixel format", frames_from_rgb, pictures(0), "nv12")
    refused("frames must be", rgb_from_frames, np.zeros((2, 100), np.uint8), "yuv444p", 8, 8)
    tile = FrameLayout("views", 4, 8).tile(0, 2, 4, 2)
    refused("outside", tile.placement, [[0, 1]])
    refused("does not fit", tile.layout.tile, 1, 1, 4, 1)

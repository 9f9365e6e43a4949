"""Camera arrays: the assignment's conventions, spacing, tiles, JSON."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfcore import Camera, CameraArray, OpticsError, Slab


def test_the_assignments_grid():
    """minX maxX minY maxY with y up; top left of the picture is the top-left camera."""
    array = CameraArray.on_grid((4, 3), (-0.6, 0.3, -0.2, 0.8), 50.0, (16, 8))
    np.testing.assert_allclose(array.columns_m, [-0.6, -0.3, 0.0, 0.3])
    # Our y points down: the top row stands at y = -maxY.
    np.testing.assert_allclose(array.rows_m, [-0.8, -0.3, 0.2])
    assert array.image_size == (64, 24) and array.rays == 64 * 24
    np.testing.assert_allclose(array.origins()[0, 0], [-0.6, -0.8, 0])


def test_the_two_readings_of_equally_spaced():
    ends = CameraArray.on_grid((4, 4), (-1, 1, -1, 1), 50.0, (8, 8), "ends")
    cells = CameraArray.on_grid((4, 4), (-1, 1, -1, 1), 50.0, (8, 8), "cells")
    np.testing.assert_allclose(np.diff(ends.columns_m), 2 / 3)
    np.testing.assert_allclose(np.diff(cells.columns_m), 2 / 4)
    assert ends.columns_m[0] == -1 and cells.columns_m[0] == -0.75
    assert ends.bounds() == cells.bounds() == (-1, 1, -1, 1)


def test_field_of_view_spans_the_shorter_side():
    for tile in ((40, 20), (20, 40), (20, 20)):
        array = CameraArray.single(60.0, tile)
        x, y = array.pixel_tangents()
        extent = [axis[-1] - axis[0] + array.pixel_pitch for axis in (x, y)]
        assert min(extent) == pytest.approx(2 * math.tan(math.radians(30)))
        assert extent == pytest.approx([side * array.pixel_pitch for side in tile])
        assert (np.diff(x) > 0).all() and (np.diff(y) > 0).all()


def test_tiles_and_mosaic_are_inverse():
    array = CameraArray.on_grid((3, 2), (-1, 1, -1, 1), 50.0, (5, 4))
    image = np.arange(15 * 8 * 3).reshape(8, 15, 3)
    tiles = array.tiles(image)
    assert tiles.shape == (2, 3, 4, 5, 3)
    np.testing.assert_array_equal(tiles[1, 2], image[4:, 10:])
    np.testing.assert_array_equal(array.mosaic(tiles), image)
    with pytest.raises(OpticsError, match="number of cameras"):
        array.tiles(image[:-1])


def test_a_slabs_views_are_an_array():
    """Rays of the array equal the slab's O + z D, whatever its focus."""
    for focus in (math.inf, 1.7):
        slab = Slab(Camera(0.05, 0.036, 2.0, focus), 4, 6)
        array = CameraArray.from_slab(slab)
        s, x = slab.lens_positions(), slab.pixel_tangents()
        for i, j in ((0, 0), (3, 1)):
            direction = array.directions(i, j)
            np.testing.assert_allclose(array.origins()[j, i], [s[i], s[j], 0])
            np.testing.assert_allclose(direction[2, :, 0], x - s[i] * slab.camera.delta, atol=1e-15)
            np.testing.assert_allclose(direction[:, 2, 1], x - s[j] * slab.camera.delta, atol=1e-15)


@given(
    st.tuples(st.integers(1, 40), st.integers(1, 40)),
    st.floats(-5, 5),
    st.floats(1e-3, 9),
    st.floats(1, 170),
    st.sampled_from(["ends", "cells"]),
)
def test_json_round_trip(cameras, low, extent, fov, spacing):
    array = CameraArray.on_grid(
        cameras, (low, low + extent, low, low + extent), fov, (7, 5), spacing
    )
    assert CameraArray.from_json(array.to_json()) == array
    low_x, high_x, _, _ = array.bounds()
    assert low_x == pytest.approx(low) and high_x == pytest.approx(low + extent)


@pytest.mark.parametrize(
    "make",
    [
        lambda: CameraArray.on_grid((0, 1), (0, 1, 0, 1), 50, (8, 8)),
        lambda: CameraArray.on_grid((2, 2), (0, 0, 0, 0), 50, (8, 8)),
        lambda: CameraArray.on_grid((2, 2), (1, 0, 0, 1), 50, (8, 8)),
        lambda: CameraArray.on_grid((2, 2), (0, 1, 0, 1), 180, (8, 8)),
        lambda: CameraArray.on_grid((2, 2), (0, 1, 0, 1), 50, (0, 8)),
        lambda: CameraArray.on_grid((2, 2), (0, 1, 0, 1), 50, (8, 8), "middle"),
        lambda: CameraArray((0.0, 0.0), (0.0,), 50, (8, 8)),
        lambda: CameraArray((math.nan,), (0.0,), 50, (8, 8)),
        lambda: CameraArray.from_json({"columns_m": [0.0]}),
    ],
)
def test_impossible_arrays_are_refused(make):
    with pytest.raises(OpticsError):
        make()

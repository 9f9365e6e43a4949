"""Cells of rays: what lens samples stand for, and displaced views."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from lfcore import Aperture, Camera, Slab
from lfcore.optics.planes import SHAPES
from lfcore.optics.ray_cells import crossed_views, lens_cells, plain_views

CAMERA = Camera(0.4, 0.3, 1.0, 4.0)


@pytest.mark.parametrize("views", [1, 2, 3, 5, 8, 17])
def test_displacements_are_every_multiple_once_along_each_axis(views):
    moved = crossed_views(Slab(CAMERA, views, 8)).displacement
    expected = (np.arange(views**2) + 0.5) / views**2 - 0.5
    for axis in range(2):
        np.testing.assert_allclose(np.sort(moved[:, axis]), expected, atol=1e-12)


@pytest.mark.parametrize("views", [4, 8])
def test_a_row_of_views_has_all_places_to_within_its_number(views):
    along_u = crossed_views(Slab(CAMERA, views, 8)).displacement[:, 0].reshape(views, views)
    for line in along_u.T:  # the views of one lens column, row by row
        assert sorted(np.floor((line + 0.5) * views).astype(int)) == list(range(views))


def test_bundles_of_the_slab_itself_are_its_views():
    from lfcore.optics import bundles

    slab = Slab(CAMERA, 3, 5)
    samples = np.array([[i, j] for j in range(3) for i in range(3)])
    mine, theirs = plain_views(slab).bundles(), bundles.views(slab, samples)
    np.testing.assert_allclose(mine.elements, theirs.elements, atol=1e-9)
    np.testing.assert_array_equal(mine.step, theirs.step)


def test_displaced_rays_lie_where_the_displacement_says():
    views = crossed_views(Slab(CAMERA, 3, 5))
    plain = plain_views(views.slab).bundles(slice(2, 7)).rays()[1]
    moved = views.bundles(slice(2, 7)).rays()[1]
    found = (moved - plain)[..., :2] / views.slab.pixel_pitch
    expected = views.displacement[2:7, None, None]
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), atol=1e-4)


def test_the_whole_lens_opens_whole_cells():
    slab = Slab(CAMERA, 5, 4)
    cells = lens_cells(slab, Aperture("square", CAMERA.lens_radius_m))
    np.testing.assert_allclose(cells.share, 1)
    np.testing.assert_allclose(cells.middle, plain_views(slab).positions, atol=1e-12)
    np.testing.assert_allclose(cells.extent, slab.lens_pitch_m)


@pytest.mark.parametrize("f_number", [1.0, 2.3, 16.0, 4000.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_open_cells_add_up_to_the_aperture(shape, f_number):
    slab = Slab(CAMERA, 6, 4)
    radius = CAMERA.focal_length_m / (2 * f_number)
    cells = lens_cells(slab, Aperture(shape, radius))
    area = {"circle": math.pi, "square": 4, "diamond": 2, "polygon": 3 * math.sin(math.pi / 3)}
    total = cells.share.sum() * slab.lens_pitch_m**2
    assert total == pytest.approx(area[shape] * radius**2, rel=0.01)
    assert (cells.share <= 1 + 1e-9).all()
    middle = (cells.share[:, None] * cells.middle).sum(0) / cells.share.sum()
    np.testing.assert_allclose(middle, 0, atol=0.01 * radius)


@given(st.floats(0.02, 0.2), st.sampled_from(SHAPES), st.integers(1, 9))
@example(0.19459579372252403, "polygon", 9)  # whose points stand for parts of two cells
@settings(max_examples=30)
def test_an_open_part_lies_in_its_cell(radius, shape, views):
    slab = Slab(CAMERA, views, 4)
    cells = lens_cells(slab, Aperture(shape, radius))
    is_open = cells.share > 0
    off = np.abs(cells.middle - plain_views(slab).positions)[is_open]
    assert is_open.any()
    assert (off <= slab.lens_pitch_m / 2 * (1 + 1e-9)).all()
    # The box of equal spread is at most the cell's, for two clumps at its ends sqrt(3) times it.
    assert (cells.extent[is_open] <= math.sqrt(3) * slab.lens_pitch_m * (1 + 1e-9)).all()

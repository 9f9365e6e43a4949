"""Light fields of more columns than rows, and of wide pictures: a part of square grids."""

import numpy as np
import pytest
from stored_fields import tile_frames, write_field

from lfcore import CameraArray, Extent, FrameLayout, LightField, OpticsError, Slab, StorageError
from lfcore.colour import srgb_decode
from lfcore.optics.array import thin_lens
from lfcore.refocus.array.stored import read_stored
from lfcore.refocus.focal_stack import focal_stack
from lfcore.refocus.shift_sum import shift_sum
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.views import read_views

COLUMNS, ROWS, WIDTH, HEIGHT = 5, 3, 22, 16
EXTENT = Extent.centred(COLUMNS, ROWS, WIDTH, HEIGHT)
SLAB = Slab(thin_lens(1.0, 2.5, 1.0), 5, 22, EXTENT)  # lens pitch 1 m, focus 1 m


@pytest.fixture(scope="module")
def pictures():
    """(ROWS, COLUMNS, HEIGHT, WIDTH, 3) uint8."""
    return np.random.default_rng(3).integers(
        0, 256, (ROWS, COLUMNS, HEIGHT, WIDTH, 3), dtype=np.uint8
    )


@pytest.fixture(scope="module")
def path(pictures, tmp_path_factory):
    file = tmp_path_factory.mktemp("partial") / "lf.mkv"
    layout = FrameLayout("views", 5, 22, pixel_format="gbrp")
    column, row, *_ = EXTENT.views
    left, top, *_ = EXTENT.pixels
    square = np.zeros((5, 5, 22, 22, 3), np.uint8)
    square[row:, column:, top:, left:][:ROWS, :COLUMNS, :HEIGHT, :WIDTH] = pictures
    write_field(
        file, SLAB, layout, lambda tile: tile_frames(square, tile),
        tiles=[layout.tile(column, row, COLUMNS, ROWS)], content={"metric": False},
    )  # fmt: skip
    return file


def naive(pictures, disparity, views=None):
    """Every view shifted by whole pixels and averaged where it has a pixel, one at a time."""
    total = np.zeros((HEIGHT, WIDTH, 3))
    count = np.zeros((HEIGHT, WIDTH, 1))
    for j in range(ROWS):
        for i in range(COLUMNS):
            s, t = i + EXTENT.views[0] - 2, j + EXTENT.views[1] - 2
            if views is not None and np.hypot(s, t) > views / 2:
                continue
            for y in range(HEIGHT):
                for x in range(WIDTH):
                    u = x - int(np.floor(s * disparity + 0.5))
                    v = y - int(np.floor(t * disparity + 0.5))
                    if 0 <= u < WIDTH and 0 <= v < HEIGHT:
                        total[y, x] += srgb_decode(pictures[j, i])[v, u]
                        count[y, x] += 1
    return total / np.maximum(count, 1)


def test_views_and_pixels_count_from_the_first_there_is(path, pictures, device):
    field = LightField.open(path)
    assert (field.grid, field.picture_size) == ((COLUMNS, ROWS), (WIDTH, HEIGHT))
    for j, i in ((0, 0), (2, 4), (1, 3)):
        np.testing.assert_array_equal(field.view(i, j, codes=True), pictures[j, i])
    np.testing.assert_array_equal(field.macropixel(21, 15, codes=True), pictures[:, :, 15, 21])
    np.testing.assert_array_equal(field.views(1, 0, 3, 3, codes=True), pictures[0:3, 1:3])
    with pytest.raises(StorageError, match="5 x 3 recorded"):
        field.view(0, 3, codes=True)
    light = read_views(field, np.array([[4, 2], [0, 0]]), device=device)
    np.testing.assert_allclose(light[0], srgb_decode(pictures[2, 4]), atol=4e-6)
    with pytest.raises(OpticsError, match=r"\(4, 2\)"):
        read_views(field, np.array([[0, 3]]), device=device)


@pytest.mark.parametrize("disparity", [0.0, 2.0, -1.4])
def test_refocused_as_by_hand(path, pictures, disparity):
    field = LightField.open(path)
    picture = field.refocus(disparity_px=disparity, aperture="square")
    np.testing.assert_allclose(picture, naive(pictures, disparity), atol=4e-6)


def test_stopped_down_by_views_and_stacked_fast(path, pictures):
    field = LightField.open(path)
    planes = [field.plane(disparity_px=d, aperture_views=3) for d in (0.0, 1.0)]
    for picture, disparity in zip(field.refocus_many(planes), (0.0, 1.0), strict=True):
        np.testing.assert_allclose(picture, naive(pictures, disparity, 3), atol=4e-6)
    stack = focal_stack(path, planes, tolerance_px=1e-6)
    np.testing.assert_allclose(stack[0], naive(pictures, 0.0, 3), atol=4e-6)
    dim = field.refocus(disparity_px=0.0, aperture="square", normalise=False)
    np.testing.assert_allclose(dim, naive(pictures, 0.0), atol=4e-6)


def test_what_needs_a_geometry_is_refused(path):
    field = LightField.open(path)
    with pytest.raises(OpticsError, match="does not hold its geometry"):
        field.refocus(focus_m=2.0)
    with pytest.raises(OpticsError, match="does not hold its geometry"):
        field.refocus(f_number=2.0)
    with pytest.raises(OpticsError, match="infinity has -22"):
        field.refocus(disparity_px=-23)
    assert field.disparity_of(field.distance_of(0.25)) == pytest.approx(0.25)
    same = shift_sum(path, [field.plane()])
    np.testing.assert_array_equal(form_planes(path, [field.plane()]).sums.pictures(), same)


def test_as_a_camera_array(path, pictures):
    field = LightField.open(path)
    with pytest.raises(OpticsError, match="camera array needs"):
        read_stored(field)
    field.metadata.content.clear()  # as if its metres were the cameras'
    image, array = read_stored(field)
    assert array.cameras == (COLUMNS, ROWS)
    assert array.tile == (WIDTH, HEIGHT)
    assert array.pixel_pitch == pytest.approx(SLAB.pixel_pitch)
    light = array.tiles(image)
    np.testing.assert_allclose(light[1, 3], srgb_decode(pictures[1, 3]), atol=4e-6)
    assert CameraArray.from_slab(Slab(SLAB.camera, 5, 22)).cameras == (5, 5)


def test_extents_outside_the_grids_are_refused():
    with pytest.raises(OpticsError, match=r"extent\.views"):
        Slab(SLAB.camera, 5, 22, Extent((0, 3, 5, 3), (0, 0, 22, 22)))
    assert Slab.from_json(SLAB.to_json()) == SLAB
    assert Extent.centred(1, 1, 3, 3) == Extent((0, 0, 1, 1), (0, 0, 3, 3))

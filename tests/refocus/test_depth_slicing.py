"""Slicing by depth against its float64 reference, and on scenes whose picture is known."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from plain_scenes import refused
from slicing_reference import slice_by_depth

from lfcore import Camera, SensorPlane, Slab, open_device
from lfcore.evaluation.metrics import psnr
from lfcore.optics.ray_cells import displaced_views, plain_views
from lfcore.refocus.depth_program import LEAST_UNITS
from lfcore.refocus.depth_slicing import COARSE_PX, DepthSlicer
from lfcore.refocus.free_views import _PointSlicer
from lfcore.rendering.direct import focused_camera
from lfcore.storage.depth_stream import DepthCodes

CAMERA = Camera(0.4, 0.3, 1.0, 4.0)


def sliced(views, planes, pixels, light, depth, parts=None, device=None, **more):
    slicer = DepthSlicer(views, planes, pixels, device, **more)
    for part in parts or [slice(0, len(light))]:
        slicer.add(part, light[part], depth[part])
    return slicer.pictures()


def noise(views, seed=1):
    """Rays of any colour and depth, some of which miss."""
    rng, (width, height) = np.random.default_rng(seed), views.slab.size
    light = rng.random((views.slab.views**2, height, width, 3), np.float32) * 1.2
    depth = rng.uniform(1.1, 20, light.shape[:3]).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = np.inf
    return light, depth


def seen(views, surfaces):
    """Light and depth of planes (depth, colour of X and Y in metres, where they are).

    ``surfaces`` are from near to far.
    """
    origin, direction = views.bundles().rays()
    light = np.zeros((*origin.shape[:3], 3), np.float32)
    depth = np.full(origin.shape[:3], np.inf, np.float32)
    for z, colour, where in reversed(surfaces):
        at = origin + z * direction
        inside = where(at[..., 0], at[..., 1])
        light[inside] = colour(at[..., 0], at[..., 1])[inside]
        depth[inside] = z
    return light, depth


def grey(value):
    return lambda x, y: np.broadcast_to(value(x, y)[..., None], (*x.shape, 3))


def everywhere(x, y):
    return np.ones(x.shape, bool)


PLANES = [
    SensorPlane(2.5, 1.0, "square"),
    SensorPlane(4.0, 1.4),
    SensorPlane(9.0, 2.0, "polygon", keep_magnification=True),
    SensorPlane(1.3, 11.0, normalise="aperture"),
]
focused = st.builds(SensorPlane, st.floats(1.05, 50), st.sampled_from([1.0, 1.7, 5.6]))


@pytest.mark.parametrize(
    ("pixels", "size"), [(7, 16), (16, 21), (24, 16), (7, (16, 9)), (9, (6, 18))]
)
@given(seed=st.integers(0, 99), plane=focused)
@example(seed=22, plane=SensorPlane(4.0, 1.4))  # a layer of 2e-6 in a pixel
@settings(max_examples=3)
def test_equal_to_the_reference(pixels, size, seed, plane):
    views = displaced_views(Slab.of(CAMERA, 3, size))
    (light, depth), size = noise(views, seed), views.slab.pixels
    planes = [plane, *PLANES]
    placed = DepthSlicer(views, planes, pixels)._placed
    made = sliced(views, planes, pixels, light, depth)
    for plane, at, picture in zip(planes, placed, made, strict=True):
        least = 0.5 * pixels / size
        expected = slice_by_depth(
            views, plane, light, depth, pixels,
            edge_steps=256, least_px=least, bounds_px=at.bounds_px, coarse_px=COARSE_PX,
            least_weight=LEAST_UNITS / at.unit_weight,
        )  # fmt: skip
        # An edge within float32's rounding of the middle between two steps may go either way.
        open_views = max(1, 9 * (CAMERA.f_number / plane.f_number) ** 2)
        one_edge = 1 / (256 * least) / (open_views * (size / pixels) ** 2)
        assert np.abs(picture - expected).max() < 2 * one_edge
        assert np.median(np.abs(picture - expected)) < 1e-6


def test_the_same_bits_in_any_parts_and_on_any_number_of_threads():
    views = displaced_views(Slab(CAMERA, 4, 16))
    light, depth = noise(views)
    whole = sliced(views, PLANES, 9, light, depth, device=open_device(threads=1))
    parts = [slice(9, 16), slice(0, 2), slice(2, 9)]
    np.testing.assert_array_equal(whole, sliced(views, PLANES, 9, light, depth, parts))


@pytest.mark.parametrize("stops", [0, 3])
def test_dim_light_far_from_focus_is_not_rounded_away(stops):
    """Boxes of which a ray adds a fraction of a unit to each pixel."""
    views, light = displaced_views(Slab(CAMERA, 4, 64)), 3e-7
    rays = seen(views, [(20.0, grey(lambda x, y: 0 * x + light), everywhere)])
    picture = sliced(views, [SensorPlane(1.1, 1.0, "square")], 16, *rays, stops=stops)[0]
    np.testing.assert_allclose(picture[4:-4, 4:-4], light, rtol=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("large_from", "bound"), [(2048, 2e-3), (1, 6e-3)])
def test_rays_that_share_a_wide_box_give_those_of_rays_of_their_own(large_from, bound, monkeypatch):
    """A slanted wall before another: 2 x 2 or 4 x 4 rays share each of this plane's boxes, which in
    large pictures are added to pixels of 2 x 2; in strips of any height."""
    monkeypatch.setattr("lfcore.refocus.depth_slicing.LARGE_FROM", large_from)
    views, plane = displaced_views(Slab(CAMERA, 2, 193)), SensorPlane(1.0, 1.0, "square")
    light, depth = noise(views)
    depth[...] = np.linspace(6, 9, 193, dtype=np.float32)
    depth[:, 60:101, 70:130] = 4.0
    boxes = abs(1 / plane.focus_m - 1 / 9) * views.slab.lens_pitch_m * 96 / CAMERA.field_width
    assert boxes > 16  # 32 distances of rays
    made = sliced(views, [plane], 96, light, depth)[0]
    monkeypatch.setattr("lfcore.refocus.depth_slicing.STRIP_ROWS", 9)
    slicer = DepthSlicer(views, [plane], 96, open_device(threads=1))
    how = {"bounds_px": slicer.bounds_px[0], "edge_steps": 256}
    right = slice_by_depth(views, plane, light, depth, 96, least_px=0.25, **how)
    assert bound / 3 < np.abs(made - right).max() < bound
    for first in range(0, 193, 64):
        rows = slice(first, first + 64)
        slicer.add(slice(0, 4), light[:, rows], depth[:, rows], first)
    np.testing.assert_array_equal(slicer.pictures()[0], made)


def test_rows_that_begin_inside_a_patch_are_refused():
    views = displaced_views(Slab(CAMERA, 2, 16))
    slicer, (light, depth) = DepthSlicer(views, [SensorPlane(1.0, 1.0)], 8), noise(views)
    with pytest.raises(ValueError, match="row 6"):
        slicer.add(slice(0, 4), light[:, 6:], depth[:, 6:], 6)


@pytest.mark.parametrize("focus", [1.8, 4.0, 7.0])
def test_a_ramp_at_one_depth_is_exact(focus):
    """What is linear along the surface is its own average over any pixel and lens."""
    views, z = displaced_views(Slab(CAMERA, 4, 32)), 3.0
    ramp = [(z, grey(lambda x, y: 0.5 + 0.1 * x - 0.2 * y), everywhere)]
    picture = sliced(views, [SensorPlane(focus, 1.0, "square")], 16, *seen(views, ramp))[0]
    tangent = (np.arange(16) - 7.5) * CAMERA.field_width / 16
    expected = 0.5 + z * (0.1 * tangent[None, :] - 0.2 * tangent[:, None])
    inner = slice(6, -6)
    # A pixel's rays are not all alike in place: what its weights are off shows in the slope.
    assert np.abs(picture[..., 0] - expected)[inner, inner].max() < 2e-3


@pytest.mark.parametrize("pixels", [64, 90])
def test_a_blurred_edge_has_no_weave_in_a_larger_picture(pixels):
    """A bright card far before the focus: the picture changes across its edge and not along."""
    views = displaced_views(Slab(CAMERA, 4, 32))
    card = (1.7, grey(lambda x, y: 0 * x + 1), lambda x, y: x < 0)
    wall = (9.0, grey(lambda x, y: 0 * x), everywhere)
    planes = [SensorPlane(9.0, 1, "square"), SensorPlane(9.0, 1.3, "circle")]
    for picture in sliced(views, planes, pixels, *seen(views, [card, wall]))[..., 0]:
        rows = picture[pixels // 4 : -pixels // 4]
        assert np.ptp(rows, axis=0).max() < 0.01 and np.ptp(rows) > 0.9


def test_what_lies_behind_does_not_shine_through():
    views = displaced_views(Slab(CAMERA, 2, 64))
    card = (4.0, grey(lambda x, y: 0 * x), lambda x, y: x < 0)
    wall = (12.0, grey(lambda x, y: 0 * x + 1), everywhere)
    plane = SensorPlane(4.0, 1.0, "square")
    rays = seen(views, [card, wall])
    picture = sliced(views, [plane], 16, *rays)[0, ..., 0]
    # The card is in focus and ends between two pixels; rays beside its edge have half their box
    # on either side.
    assert picture[:, :7].max() == 0
    assert picture[:, 7].max() < 0.05
    np.testing.assert_allclose(picture[:, 9:], 1, atol=1e-6)
    mixed = sliced(views, [plane], 16, *rays, bounds_px=())[0, ..., 0]
    assert mixed[:, 7].min() > 2 * picture[:, 7].max()


def _true_db(surfaces, plane, pixels, of_views, rays=None):
    """PSNR against many rays, each in its own pixel of a camera focused there, without a border."""
    views = displaced_views(Slab(CAMERA, 4, of_views))
    picture = sliced(views, [plane], pixels, *rays or seen(views, surfaces))[0]
    views = displaced_views(Slab(focused_camera(CAMERA, plane), 12, 4 * pixels))
    light = seen(views, surfaces)[0].mean(0)
    truth = light.reshape(pixels, 4, pixels, 4, 3).mean((1, 3))
    inner = slice(pixels // 4, -pixels // 4)
    return psnr(picture[inner, inner], truth[inner, inner], peak=1)


@pytest.mark.parametrize(("focus", "least_db"), [(4.0, 40), (12.0, 34)])
def test_a_thin_rod_before_a_wall(focus, least_db):
    """In focus or not, sixteen lens samples give what many do."""
    plane = SensorPlane(focus, 1.0, "square")
    stripes = grey(lambda x, y: 0.5 + 0.4 * np.sin(6 * x) * np.sin(5 * y))
    rod = (4.0, grey(lambda x, y: 0 * x + 0.05), lambda x, y: np.abs(x - 0.03) < 0.08)
    surfaces = [rod, (12.0, stripes, everywhere)]
    light, depth = seen(displaced_views(Slab(CAMERA, 4, 48)), surfaces)
    found = _true_db(surfaces, plane, 24, 48)
    assert found > least_db
    assert found > 1 + _true_db(surfaces, plane, 24, 48, (light, np.full_like(depth, focus)))


def test_light_of_a_wall_does_not_shine_through_a_blurred_card():
    card = (4.0, grey(lambda x, y: 0 * x + 0.05), lambda x, y: np.hypot(x, y) < 0.7)
    surfaces = [card, (12.0, grey(lambda x, y: 0 * x + 0.9), everywhere)]
    assert _true_db(surfaces, SensorPlane(1.3, 1.0, "square"), 48, 48) > 48


def test_a_highlight_is_averaged_over_the_lens_samples_that_see_it():
    """Colour that changes with direction is what few samples of the lens get wrong: a highlight
    seen by one in sixteen is a sixteenth as bright, wherever in its cell it begins."""
    views = plain_views(Slab(CAMERA, 4, 16))
    light, depth = seen(views, [(4.0, grey(lambda x, y: 0 * x), everywhere)])
    light[5] = 1
    picture = sliced(views, [SensorPlane(4.0, 1.0, "square")], 8, light, depth)[0]
    np.testing.assert_allclose(picture, 1 / 16, atol=1e-6)


@pytest.mark.parametrize("f_number", [1.0, 3.0, 4.0])
def test_a_stopped_down_picture_is_that_of_the_smaller_lens(f_number):
    """Few cells are open, some in part: boxes shrink with the open part."""
    edge = [(12.0, grey(lambda x, y: (x + 0.3 * y > 0) * 1.0), everywhere)]
    assert _true_db(edge, SensorPlane(3.0, f_number, "square"), 24, 48) > 33


def test_no_light_is_lost_as_the_lens_stops_down_and_none_beyond_it_is_made():
    views = displaced_views(Slab(CAMERA, 4, 16))
    rays = seen(views, [(5.0, grey(lambda x, y: 0 * x + 0.8), everywhere)])
    planes = [SensorPlane(4.0, 2.0, "square", normalise=how) for how in ("aperture", "lens")]
    whole, dimmed = sliced(views, planes, 8, *rays)
    np.testing.assert_allclose(whole, 0.8, atol=1e-5)
    np.testing.assert_allclose(dimmed, 0.2, rtol=1e-2)
    refused("wider than the lens", DepthSlicer, views, [SensorPlane(4.0, 0.5)], 8)


@given(
    seed=st.integers(0, 999), brightest=st.sampled_from([0.02, 1.0, 3.5]),
    shape=st.sampled_from(["even", "edge-on", "any"]),
    at=st.tuples(*[st.floats(-1.5, 1.5)] * 2), plane=focused,
)  # fmt: skip
@settings(max_examples=15)
def test_no_picture_is_brighter_than_the_brightest_ray(seed, brightest, shape, at, plane):
    """On planes and from points of the lens: saturated colours, most of the rays black, surfaces
    that a point sees edge-on, so that all rays of a row fall there on one pixel."""
    rng, slab = np.random.default_rng(seed), Slab(CAMERA, 4, 32)
    views, pixels, stops = displaced_views(slab), 16, int(brightest > 1) * 2
    light, depth = noise(views, seed)
    light = np.float32(brightest) * (light > 0.8) * (rng.random(depth.shape) < 0.3)[..., None]
    codes = DepthCodes.of_range(slab, 0.0, 1 / 1.1)
    if shape != "any":
        steps = np.arange(32) / rng.uniform(5, 60) if shape == "edge-on" else np.zeros(32)
        depth[:] = codes.depth(codes.of_depth(1 / (1e-3 + steps % 1 * codes.near)))
    point, share = np.array(at) * slab.lens_pitch_m, rng.random(16) ** rng.integers(1, 20)
    seen = _PointSlicer(views, point, share, pixels, codes, stops, open_device())
    for slicer in (seen, DepthSlicer(views, [plane], pixels, stops=stops)):
        slicer.add(slice(0, 16), light, depth)
        # Sums of which a pixel has few units are rounded to them.
        assert slicer.pictures().max() <= 1.02 * brightest

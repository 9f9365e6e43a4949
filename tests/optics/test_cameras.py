"""Camera arrays, the plenoptic camera and realistic lenses: geometry by hand, and photographs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_scenes import CHART, refused

from lfcore import Camera, CameraArray, SensorPlane, Slab
from lfcore.optics import bundles
from lfcore.optics.lens_system import LensSampler, LensSystem
from lfcore.optics.plenoptic import PlenopticCamera, sub_aperture, sub_apertures
from lfcore.readers.load import load_scene
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.plenoptic import photograph, refocus_photograph
from lfcore.rendering.prepared import open_tracer


def test_the_assignments_grid():
    """minX maxX minY maxY with y up; top left of the picture is the top-left camera."""
    array = CameraArray.on_grid((4, 3), (-0.6, 0.3, -0.2, 0.8), 50.0, (16, 8))
    np.testing.assert_allclose(array.columns_m, [-0.6, -0.3, 0.0, 0.3])
    # Our y points down: the top row stands at y = -maxY.
    np.testing.assert_allclose(array.rows_m, [-0.8, -0.3, 0.2])
    assert array.image_size == (64, 24) and array.rays == 64 * 24
    np.testing.assert_allclose(array.origins()[0, 0], [-0.6, -0.8, 0])
    # The two readings of equally spaced.
    ends, cells = (
        CameraArray.on_grid((4, 4), (-1, 1, -1, 1), 50.0, (8, 8), each)
        for each in ("ends", "cells")
    )
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
    refused("number of cameras", array.tiles, image[:-1])


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
    bounds = (low, low + extent, low, low + extent)
    array = CameraArray.on_grid(cameras, bounds, fov, (7, 5), spacing)
    assert CameraArray.from_json(array.to_json()) == array
    assert array.bounds()[:2] == pytest.approx(bounds[:2])


GRID = (-1, 1, -1, 1)
IMPOSSIBLE = [
    (lambda: CameraArray.on_grid((0, 1), GRID, 50, (8, 8)), "cameras"),
    (lambda: CameraArray.on_grid((2, 2), (0, 0, 0, 0), 50, (8, 8)), "bounds"),
    (lambda: CameraArray.on_grid((2, 2), (1, 0, 0, 1), 50, (8, 8)), "bounds"),
    (lambda: CameraArray.on_grid((2, 2), GRID, 180, (8, 8)), "fov"),
    (lambda: CameraArray.on_grid((2, 2), GRID, 50, (0, 8)), "tile"),
    (lambda: CameraArray.on_grid((2, 2), GRID, 50, (8, 8), "middle"), "spacing"),
    (lambda: CameraArray((0.0, 0.0), (0.0,), 50, (8, 8)), "columns_m"),
    (lambda: CameraArray((math.nan,), (0.0,), 50, (8, 8)), "columns_m"),
    (lambda: CameraArray.from_json({"columns_m": [0.0]}), "array"),
    # Lens samples of 7.5 mm against microlenses of 9 mm.
    (lambda: PlenopticCamera(CAMERA, 12, 16), "hyperfocal"),
    (lambda: PlenopticCamera(replace(CAMERA, f_number=1.2), 1, 1), "wider than the main lens"),
    (lambda: PlenopticCamera(CAMERA, 0, 4), "pixels"),
]


@pytest.mark.parametrize(("make", "words"), IMPOSSIBLE)
def test_impossible_cameras_are_refused(make, words):
    refused(words, make)


CAMERA = Camera(0.12, 0.109, 1.0, 1.33)


def test_geometry_by_hand():
    camera = PlenopticCamera(CAMERA, 512, 16)
    pitch, image = 0.109 / 512, 0.12 * 1.33 / (1.33 - 0.12)
    focal = pitch * image / (0.12 - pitch)
    assert camera.microlens_focal_length_m == pytest.approx(focal)
    # The main lens, seen through a microlens, fills its share of the photosensor: D f / v.
    assert camera.image_pitch_m == pytest.approx(0.12 * focal / image)
    assert camera.hyperfocal_distance_m == pytest.approx(
        focal**2 / (focal / pitch * camera.pixel_pitch_m) + focal
    )
    assert camera.photograph_side == 8192


def test_rays_through_microlenses_are_the_slab():
    """Section 3.3: the two representations have the same rays."""
    camera = PlenopticCamera(CAMERA, 12, 4)
    distance, focal = CAMERA.image_distance_m, camera.microlens_focal_length_m
    centre = (5.5 - np.arange(12))[:, None] * camera.pitch_m
    # Pixels about the image of the main lens's middle, from which lines go through the microlens.
    pixel = centre * (1 + focal / distance) + (1.5 - np.arange(4)) * camera.pixel_pitch_m
    points, slab = centre + (centre - pixel) / focal * distance, camera.slab()
    np.testing.assert_allclose(points, np.tile(slab.lens_positions(), (12, 1)), atol=1e-12)
    pixels = np.array([(0, 0), (11, 3), (5, 7)])
    origins, directions = bundles.macropixels(slab, pixels).rays()
    # The main lens refracts a ray to the point that is conjugate to its microlens.
    towards = (pixels - 5.5) * camera.pitch_m / CAMERA.image_distance_m
    for e, (u, v) in enumerate(pixels):
        start = np.stack(np.meshgrid(points[u], points[v]), -1)
        np.testing.assert_allclose(origins[e, ..., :2], start, atol=1e-7)
        expected = towards[e] - start * CAMERA.delta
        np.testing.assert_allclose(directions[e, ..., :2], expected, atol=1e-7)


def test_sub_apertures_by_hand():
    picture = np.arange(6 * 6 * 3).reshape(6, 6, 3)
    assert sub_aperture(picture, 2, 1, 0)[2, 1].tolist() == picture[4, 3].tolist()
    assert sub_apertures(picture, 3).shape == (3, 3, 2, 2, 3)
    refused("no mosaic", sub_apertures, picture, 4)
    refused("from 0 to 1", sub_aperture, picture, 2, 2, 0)


def test_photograph_and_what_is_made_of_it():
    """Odd sizes, so that frames do not fill the picture; against planes formed on the fly."""
    tracer = open_tracer(load_scene(CHART, bare=True))
    camera = PlenopticCamera(CAMERA, 45, 4)
    seen = []
    picture = photograph(tracer, camera, progress=lambda *at: seen.append(at))
    assert picture.shape == (180, 180, 3)
    assert seen[-1] == (45**2, 45**2)
    planes = [SensorPlane(1.33, 1.0), SensorPlane(2.0, 1.0, "square"), SensorPlane(1.0, 2.0)]
    direct = trace_planes(tracer, camera.slab(), planes)
    made = refocus_photograph(camera, picture, planes, filter="nearest")
    # 8-bit YCbCr and 8-bit RGB between: one code of red is up to 0.01 of linear light.
    assert np.abs(made - direct).max() < 0.02
    assert np.abs(made - direct).mean() < 0.002


# A symmetric biconvex singlet of index 1.5 with a stop behind it.
SINGLET = """# radius thickness index diameter
50   4   1.5  20
-50  2   1    20
0    45  0    {stop}
"""


@pytest.fixture
def make(tmp_path):
    def build(text=None, stop=4):
        path = tmp_path / "lens.dat"
        path.write_text(text if text is not None else SINGLET.format(stop=stop))
        return LensSystem.read(path)

    return build


def test_focal_length_is_the_lens_makers(make):
    thick = 0.5 * (2 / 0.05 - 0.5 * 4e-3 / (1.5 * 0.05**2))
    assert make().focal_length_m == pytest.approx(1 / thick, rel=1e-12)


@pytest.mark.parametrize("distance", [0.3, 1.0, 6.8, 1e4, np.inf])
def test_narrow_rays_meet_at_the_focus(make, distance):
    """With a small stop, rays from the film's middle cross the axis where it is focused."""
    lens = make(stop=0.2).focused(distance)
    reach = np.linspace(-9e-5, 9e-5, 5)[[0, 1, 3, 4]]
    rear = np.stack([reach, 0 * reach, np.full(4, lens.film_distance_m)], 1)
    origins, directions, alive = lens.trace(np.zeros((4, 3)), rear)
    assert alive.all()
    if np.isinf(distance):
        np.testing.assert_allclose(directions[:, 0] / directions[:, 2], 0, atol=1e-7)
    else:
        cross = origins[:, 2] - origins[:, 0] * directions[:, 2] / directions[:, 0]
        np.testing.assert_allclose(cross, distance, rtol=2e-3 * max(1, distance))


def test_the_stop_blocks(make):
    wide, narrow = (make(stop=stop).axial_pupil_area() for stop in (8, 4))
    assert wide / narrow == pytest.approx(4, rel=0.05)
    assert make(stop=8).stopped_down(4e-3).axial_pupil_area() == pytest.approx(narrow, rel=1e-9)


def test_pupil_sampling_misses_nothing(make):
    """Sampling the bounds and sampling the whole rear plane estimate the same light."""
    lens = make(stop=6).focused(3.0)
    sampler = LensSampler(lens, 0.0175)
    rng = np.random.default_rng(1)
    for r in (0.0, 0.006, 0.014):
        film = np.repeat([[r * 0.6, r * 0.8]], 20000, 0)
        weights = sampler.rays(film, rng.random((20000, 2)))[2]
        rear = np.full((40000, 3), lens.film_distance_m)
        rear[:, :2] = rng.uniform(-0.015, 0.015, (40000, 2))
        start = np.tile([*film[0], 0.0], (40000, 1))
        towards = rear - start
        slope = towards[:, 2] / np.linalg.norm(towards, axis=1)
        passed = lens.trace(start, towards)[2]
        expected = np.mean(passed * slope**4) * 0.03**2 / lens.axial_pupil_area()
        assert weights.mean() == pytest.approx(expected, rel=0.05)
        if r == 0:
            assert weights.mean() == pytest.approx(1, rel=0.03)


def test_lenses_that_cannot_be(make):
    for text, words in (
        ("1 2 3\n", "four"), ("# nothing\n", "no surface"), ("50 4 1.5 -3\n", "not positive"),
        ("50 4 x 20\n", "'x' to float.* row 0"),
    ):  # fmt: skip
        refused(rf"lens\.dat.*{words}", make, text)
    refused("focus", make().focused, 0.06)
    refused("wider", make(stop=4).stopped_down, 1.0)
    for none in (0.0, -1e-3, math.nan):
        refused("not positive", make(stop=4).stopped_down, none)

"""Synthesis from camera arrays: kernels against float64 references, and what must hold."""

import array_reference as reference
import numpy as np
import pytest
from plain_scenes import refused

from lfcore import CameraArray
from lfcore.optics.lens_system import LensSampler, LensSystem
from lfcore.refocus.array import focal_surface as surfaces
from lfcore.refocus.array import sampling
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.synthesis import (
    film_rays,
    isaksen,
    monte_carlo,
    quadrature,
    realistic,
    thin_lens,
)
from lfcore.refocus.array.virtual_camera import VirtualCamera

DEPTH = 3.0


def radiance(x, y):
    """A smooth, asymmetric pattern, metres to RGB."""
    return np.stack(
        [
            0.5 + 0.4 * np.sin(2.1 * x + 0.3),
            0.5 + 0.3 * np.cos(1.7 * y - 0.4 * x),
            0.5 + 0.2 * np.sin(1.3 * x) * np.cos(2.3 * y + 1),
        ],
        -1,
    )


def textured_plane(array, depth=DEPTH, pattern=radiance):
    """The light field of a plane at ``depth``, exact at every pixel centre."""
    ny, nx = array.cameras[::-1]
    directions = [[array.directions(i, j) for i in range(nx)] for j in range(ny)]
    points = array.origins()[:, :, None, None] + depth * np.array(directions)
    return array.mosaic(pattern(points[..., 0], points[..., 1])).astype(np.float32)


@pytest.fixture(scope="module")
def array():
    return CameraArray.on_grid((5, 4), (-0.5, 0.7, -0.4, 0.3), 60.0, (32, 24))


@pytest.fixture(scope="module")
def image(array):
    return textured_plane(array)


@pytest.fixture(scope="module")
def field(device, array, image):
    return DeviceField(device, image, array)


def tilted_camera(size=(20, 15), lens_radius=0.1):
    return VirtualCamera.from_pbrt((0.1, -0.05, -0.2), (3, -4, 5), 35.0, size, lens_radius)


def all_surfaces(camera):
    rng = np.random.default_rng(1)
    return {
        "parallel": surfaces.parallel(2.5),
        "distance": surfaces.at_distance(camera, 2.5),
        "tilted": surfaces.PlaneSurface([0, 0, 3], [0.5, 0.2, 1]),
        "horizon": surfaces.PlaneSurface([0, 1, 0], [0, 1, 0.0]),
        "sphere": surfaces.SphereSurface([0, 0, 3], 0.7),
        "map": surfaces.DepthMapSurface(rng.uniform(2, 4, (7, 9))),
    }


def close(fast, slow, tolerance=2e-5):
    np.testing.assert_allclose(fast.coverage, slow.coverage, atol=1e-6)
    np.testing.assert_allclose(fast.image, slow.image, atol=tolerance)


@pytest.mark.parametrize("kind", list(all_surfaces(tilted_camera())))
def test_every_surface_equals_its_reference(field, image, array, kind):
    camera = tilted_camera()
    surface = all_surfaces(camera)[kind]
    lens = (camera, surface, sampling.QUADRATURE, sampling.midpoint_table(1, 3), 9)
    for fast, slow in (
        (isaksen(field, camera, surface, 0.35),
         reference.isaksen(image, array, camera, surface, 0.35)),
        (thin_lens(field, *lens), reference.thin_lens(image, array, *lens)),
    ):  # fmt: skip
        assert slow.coverage.any()
        close(fast, slow)


@pytest.mark.kernels
@pytest.mark.parametrize("name", list(sampling.SAMPLERS))
def test_samplers_equal_their_reference(field, image, array, name):
    camera, surface = tilted_camera((7, 5)), surfaces.parallel(2.5)
    code = sampling.SAMPLERS[name]
    table = sampling.halton_table(6) if code == sampling.HALTON else None
    fast = monte_carlo(field, camera, surface, 6, sampler=name, seed=9)
    slow = reference.thin_lens(image, array, camera, surface, code, table, 6, 9)
    close(fast, slow, 1e-4)


@pytest.mark.parametrize("corner", [(0, 0), (4, 0), (2, 3)])
def test_a_narrow_filter_gives_the_data_camera_back(device, corner):
    """At a data camera's position the picture is that camera's own, even of pure noise."""
    array = CameraArray.on_grid((5, 4), (-0.5, 0.7, -0.4, 0.3), 50.0, (64, 64))
    noise = np.random.default_rng(3).random((4 * 64, 5 * 64, 3), np.float32)
    i, j = corner
    position = [array.columns_m[i], array.rows_m[j], 0.0]
    camera = VirtualCamera(position, np.eye(3), 50.0, (64, 64))
    expected = array.tiles(noise)[j, i]
    field = DeviceField(device, noise, array)
    for surface in (surfaces.parallel(6.8), surfaces.SphereSurface([0, 0, 5], 2)):
        found = isaksen(field, camera, surface, 0.01)
        assert found.skipped_share == 0
        np.testing.assert_allclose(found.image, expected, atol=1e-4)
    one = quadrature(field, camera, surfaces.parallel(6.8), 1, 1)
    np.testing.assert_allclose(one.image, expected, atol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("focus", [DEPTH, 1.8])
def test_a_picture_is_the_integral_over_the_lens(device, focus):
    """The blurred plane, computed from its texture; in focus, the texture itself."""
    array = CameraArray.on_grid((21, 21), (-0.5, 0.5, -0.5, 0.5), 60.0, (112, 112))
    field = DeviceField(device, textured_plane(array), array)
    camera = VirtualCamera([0.05, -0.1, 0.0], np.eye(3), 20.0, (6, 6), 0.4)
    surface = surfaces.parallel(focus)
    found = quadrature(field, camera, surface, 32, 1)
    x, y = sampling.concentric_disk(*(np.mgrid[:64, :64].reshape(2, -1) + 0.5) / 64)
    tx, ty = camera.film_tangents(*np.meshgrid(np.arange(6) + 0.5, np.arange(6) + 0.5))
    keep = 0.4 * (1 - DEPTH / focus)
    expected = radiance(
        0.05 + DEPTH * tx[..., None] + keep * x, -0.1 + DEPTH * ty[..., None] + keep * y
    ).mean(2)
    # What is left is the bilinear interpolation between data cameras, aimed at another depth.
    np.testing.assert_allclose(found.image, expected, atol=2e-3)
    if focus == DEPTH:
        np.testing.assert_allclose(isaksen(field, camera, surface, 0.3).image, expected, atol=1e-3)


def test_samplers_that_spread_their_samples_err_less(field):
    """By how many samples the error falls is the report's: tests/evaluation."""
    camera, surface = tilted_camera((12, 12), 0.08), surfaces.parallel(1.6)
    exact = quadrature(field, camera, surface, 48, 4).image
    error = {
        name: np.linalg.norm(monte_carlo(field, camera, surface, 128, sampler=name).image - exact)
        for name in ("halton", "stratified", "independent")
    }
    assert max(error["halton"], error["stratified"]) < 0.6 * error["independent"]


def test_rays_outside_the_grid_are_skipped_and_counted(device):
    array = CameraArray.on_grid((3, 3), (-0.1, 0.1, -0.1, 0.1), 90.0, (16, 16))
    bright = np.ones((48, 48, 3), np.float32)
    field = DeviceField(device, bright, array)
    camera = VirtualCamera([0.1, 0.0, 0.0], np.eye(3), 40.0, (8, 8), 0.05)
    found = monte_carlo(field, camera, surfaces.parallel(5), 256)
    # Half of the lens hangs over the edge: those rays are gone, the others not darkened.
    assert found.skipped_share == pytest.approx(0.5, abs=0.02)
    np.testing.assert_allclose(found.image, 1.0, atol=1e-5)
    away = VirtualCamera([5.0, 0.0, 0.0], np.eye(3), 40.0, (8, 8), 0.05)
    lost = monte_carlo(field, away, surfaces.parallel(5), 4)
    assert lost.skipped_share == 1 and not lost.image.any()


def test_sixteen_bit_fields_read_as_their_numbers(device, array, image):
    half = image.astype(np.float16)
    camera, surface = tilted_camera(), surfaces.parallel(2.5)
    from_half = isaksen(DeviceField(device, half, array), camera, surface, 0.3)
    from_float = isaksen(DeviceField(device, half.astype(np.float32), array), camera, surface, 0.3)
    np.testing.assert_array_equal(from_half.image, from_float.image)


def test_a_sheared_array_synthesises_the_same_picture(device):
    """The views of a slab focused at 2 m hold the same rays as a parallel array's."""
    parallel = CameraArray.on_grid((5, 5), (-0.2, 0.2, -0.2, 0.2), 60.0, (96, 96))
    sheared = CameraArray(
        parallel.columns_m, parallel.rows_m, 60.0, (96, 96), parallel.margin_m, delta=0.5
    )
    camera, surface = tilted_camera(lens_radius=0.05), surfaces.parallel(2.2)
    pictures = [
        quadrature(DeviceField(device, textured_plane(a), a), camera, surface, 6, 1).image
        for a in (parallel, sheared)
    ]
    np.testing.assert_allclose(*pictures, atol=2e-3)


@pytest.fixture
def lens(tmp_path):
    path = tmp_path / "lens.dat"
    path.write_text("50 4 1.5 20\n-50 2 1 20\n0 45 0 16\n")
    return LensSystem.read(path)


def test_a_realistic_lens_equals_its_reference(field, image, array, lens):
    lens = lens.focused(2.5)
    camera = tilted_camera((9, 6))
    surface = surfaces.at_distance(camera, 2.5)
    fast = realistic(field, camera, lens, surface, 16, seed=4)
    shooter, code = LensSampler(lens, 0.035 / 2), sampling.HALTON
    rays = film_rays(camera, shooter, np.arange(9 * 6), 16, code, 4)
    slow = reference.rays(image, array, camera, surface, *rays)
    assert slow.coverage.any()
    close(fast, slow, 1e-4)


def test_a_narrow_realistic_lens_is_a_pinhole_the_right_way_up(device, lens):
    lens = lens.stopped_down(5e-4).focused(DEPTH)
    array = CameraArray.on_grid((5, 5), (-0.3, 0.3, -0.3, 0.3), 60.0, (128, 128))
    field = DeviceField(device, textured_plane(array), array)
    camera = VirtualCamera([0.05, -0.1, 0.0], np.eye(3), 30.0, (16, 12))
    surface = surfaces.parallel(DEPTH)
    found = realistic(field, camera, lens, surface, 64, film_diagonal_m=0.02)
    # The same picture by the paraxial lens, its centre a focal length before the film.
    focal = lens.focal_length_m
    pitch = 0.02 / np.hypot(16, 12)
    u, v = np.meshgrid(np.arange(16) + 0.5 - 8, np.arange(12) + 0.5 - 6)
    scale = (DEPTH - lens.positions_m[0] - focal) / focal * pitch
    expected = radiance(0.05 + scale * u, -0.1 + scale * v)
    ratio = found.image / expected
    centre = ratio[4:8, 6:10].mean()
    # 64 samples of a square around a round pupil: pi / 4 of them pass, weighted to one.
    assert centre == pytest.approx(1, abs=0.08)
    np.testing.assert_allclose(found.image / centre, expected, atol=0.12)
    assert np.corrcoef(found.image.ravel(), expected.ravel())[0, 1] > 0.97


def test_refusals(field):
    camera = tilted_camera()
    refused("filter_width_m", isaksen, field, camera, surfaces.parallel(2), 0.0)
    refused("samples_per_pixel", monte_carlo, field, camera, surfaces.parallel(2), 0)
    refused("sampler", monte_carlo, field, camera, surfaces.parallel(2), 4, sampler="sobol")
    refused("behind", surfaces.parallel, -1)
    refused("3 x 3", DeviceField, field.device, np.zeros((3, 3, 3), np.float32), field.array)

"""Pictures of a wanted quality: what rounds of rays say of their error, and what comes of it."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import lfcore
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.optics.planes import SensorPlane
from lfcore.rendering import quality
from lfcore.rendering.quality import (
    BORDER,
    PILOT,
    SHARED_DB,
    one_lattice,
    pictures_of_quality,
    planes_between,
    unlike_lattices,
)


def noisy(rng, count, error, planes=2):
    """Pictures of 0.5 sRGB whose mean squared error falls as their rays rise; twice the error in
    each plane than in that before it."""
    noise = rng.normal(0, error / np.sqrt(count.rays_a_pixel), (planes, 96, 96, 3))
    return srgb_decode(0.5 + noise * 2 ** np.arange(planes)[:, None, None, None])


def test_independent_errors_are_expected_as_they_are():
    rng = np.random.default_rng(3)
    rounds = quality._Rounds([(count, noisy(rng, count, 0.02)) for count in PILOT])
    found = rounds.rendering()
    assert found.rays_a_pixel == sum(count.rays_a_pixel for count in PILOT)
    off = 0.02 / np.sqrt(found.rays_a_pixel) * np.array([1, 2])
    np.testing.assert_allclose(found.expected_db + SHARED_DB, -20 * np.log10(off), atol=0.2)
    # The map's root mean square is the same error, and the mean errs by just that.
    np.testing.assert_allclose(np.sqrt(np.square(found.error).mean((1, 2))), off, rtol=0.03)
    made = np.sqrt(np.square(srgb_encode(found.pictures) - 0.5).mean((1, 2, 3)))
    np.testing.assert_allclose(made, off, rtol=0.05)


@pytest.mark.parametrize("target", [35, 45, 55])
def test_rounds_end_where_the_quality_is_reached(monkeypatch, target):
    """Every ray is in the mean, and no more are traced than a tenth beyond what is needed."""
    rng, traced = np.random.default_rng(5), []

    def pictures(tracer, camera, planes, pixels, count, **_):
        traced.append(count)
        return noisy(rng, count, 0.05)

    monkeypatch.setattr(quality, "pictures_by_depth", pictures)
    found = pictures_of_quality(None, None, [None, None], 96, target - SHARED_DB, most_rays=1e5)
    assert list(found.counts) == traced and traced[:2] == list(PILOT)
    needed = 0.05**2 * 4 * 10 ** (target / 10)
    assert found.rays_a_pixel == pytest.approx(max(needed, 9.06), rel=0.1)
    made = -10 * np.log10(np.square(srgb_encode(found.pictures) - 0.5).mean((1, 2, 3)))
    np.testing.assert_allclose(made.min(), target, atol=0.5)


def test_lattices_have_the_rays_they_are_asked_for():
    for rays in (1, 3.5, 16, 100, 3000):
        few, many = unlike_lattices(rays)
        for count in (one_lattice(rays), few, many):
            assert count.rays_a_pixel == pytest.approx(rays)
        assert many.views > few.views and few.subpixels >= 1.19 * many.subpixels


@pytest.fixture(scope="module")
def scene():
    """A ball. It shadows nothing, so its lights need cast none: such kernels are built sooner."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    whole = lfcore.Scene.from_triangles(ball.vertices[ball.faces])
    lights = [replace(light, casts_shadows=False) for light in whole.lights]
    return replace(whole, lights=lights)


@pytest.mark.kernels
def test_the_quality_that_was_asked_for_is_reached(scene):
    camera = scene.camera
    planes = [
        SensorPlane(camera.focus_distance_m * by, camera.f_number, "square") for by in (0.8, 1.2)
    ]
    made = lfcore.render_to_quality(scene, 38, planes=planes, pixels=32)
    assert made.pictures.shape == (2, 32, 32, 3) and made.expected_db.min() >= 38
    assert made.error.shape == (2, 32, 32)
    many = lfcore.render(scene, planes=planes, pixels=32, views=16, subpixels=4)
    border = int(BORDER * 32)
    inner = np.s_[border:-border, border:-border]
    for picture, truth in zip(made.pictures, many, strict=True):
        assert psnr(srgb_encode(picture[inner]), srgb_encode(truth[inner]), peak=1) > 37


@pytest.mark.kernels
def test_a_quality_beyond_the_budget_is_refused_with_what_it_takes(scene):
    with pytest.raises(lfcore.OpticsError, match=r"quality: 45 dB takes about [\d,]+ rays a pixel"):
        lfcore.render_to_quality(scene, 45, pixels=32, most_rays=10)
    with pytest.raises(lfcore.OpticsError, match="quality: must be a positive number"):
        lfcore.render_to_quality(scene, float("nan"), pixels=32)
    with pytest.raises(lfcore.OpticsError, match="most_rays: must be positive"):
        lfcore.render_to_quality(scene, 40, pixels=32, most_rays=0)


@pytest.mark.kernels
def test_a_stored_light_field_has_the_quality_that_it_says(scene, tmp_path):
    """Nearly lossless, so that what is missing would be the rays'."""
    focus = scene.camera.focus_distance_m
    field = lfcore.record(
        scene, tmp_path / "ball.mkv", pixels=32, quality_db=38, focus_range_m=(0.8 * focus, focus),
        crf=1,
    )  # fmt: skip
    expected = field.content["expected"]
    assert expected["db"] >= 38 and expected["focus_m"] == pytest.approx([0.8 * focus, focus])
    planes = [SensorPlane(at * focus, scene.camera.f_number) for at in (0.8, 0.9, 1)]
    many = lfcore.render(scene, planes=planes, pixels=32, views=16, subpixels=4)
    border = int(BORDER * 32)
    inner = np.s_[border:-border, border:-border]
    for plane, truth in zip(planes, many, strict=True):
        picture = field.refocus(plane.focus_distance_m)
        assert psnr(srgb_encode(picture[inner]), srgb_encode(truth[inner]), peak=1) > 37
    with pytest.raises(lfcore.OpticsError, match="quality: chooses the rays itself"):
        lfcore.record(scene, tmp_path / "no.mkv", quality_db=38, views=4)
    with pytest.raises(lfcore.OpticsError, match="focus_range_m: must be two distances"):
        lfcore.record(scene, tmp_path / "no.mkv", quality_db=38, focus_range_m=(2, 1))
    assert not (tmp_path / "no.mkv").exists()


def test_a_range_of_focus_is_even_in_dioptres(scene):
    planes = planes_between(scene.camera, 2.0, np.inf)
    assert [plane.delta for plane in planes] == pytest.approx([0.5, 0.375, 0.25, 0.125, 0])

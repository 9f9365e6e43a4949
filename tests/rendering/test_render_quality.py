"""Pictures of a wanted quality: what rounds of rays say of their error, and what comes of it."""

import re
from dataclasses import replace
from pathlib import Path

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
    WEIGHT,
    Quality,
    QualitySearch,
    one_lattice,
    planes_between,
    unlike_lattices,
)


def noisy(rng, count, error, planes=2, power=1.0):
    """Pictures of 0.5 sRGB whose mean squared error falls by ``power`` of their rays; twice the
    error in each plane than in that before it."""
    noise = rng.normal(0, error / count.rays_per_pixel ** (power / 2), (planes, 96, 96, 3))
    return srgb_decode(0.5 + noise * 2 ** np.arange(planes)[:, None, None, None])


def found_db(pictures):
    """PSNR of the worst plane."""
    return -10 * np.log10(np.square(srgb_encode(pictures) - 0.5).mean((1, 2, 3)).max())


def worst_db(pictures, truths):
    """PSNR of the worst picture without its border, on sRGB codes."""
    border = int(BORDER * len(truths[0]))
    inner = np.s_[border:-border, border:-border]
    pairs = zip(pictures, truths, strict=True)
    return min(psnr(srgb_encode(a[inner]), srgb_encode(b[inner]), peak=1) for a, b in pairs)


def test_independent_errors_are_expected_as_they_are():
    rng = np.random.default_rng(3)
    rounds = quality._Rounds([(count, noisy(rng, count, 0.02)) for count in PILOT])
    found = rounds.rendering()
    rays = np.array([count.rays_per_pixel for count in PILOT])
    assert found.rays_per_pixel == rays.sum()
    share = rays**WEIGHT / (rays**WEIGHT).sum()
    off = 0.02 * np.sqrt((share**2 / rays).sum()) * np.array([1, 2])
    np.testing.assert_allclose(found.expected_db + SHARED_DB, -20 * np.log10(off), atol=0.2)
    # The map's root mean square is the same error, and the mean errs by just that.
    np.testing.assert_allclose(np.sqrt(np.square(found.error).mean((1, 2))), off, rtol=0.03)
    made = np.sqrt(np.square(srgb_encode(found.pictures) - 0.5).mean((1, 2, 3)))
    np.testing.assert_allclose(made, off, rtol=0.05)


@pytest.fixture
def simulated(monkeypatch):
    """What makes a request of errors 0.05 a ray, that fall by a power; and what it traced."""

    def make(target_db, power=1.0):
        rng, traced = np.random.default_rng(5), []

        def pictures(tracer, camera, planes, pixels, count, **_):
            traced.append((count, noisy(rng, count, 0.05, power=power)))
            return traced[-1][1]

        monkeypatch.setattr(quality, "pictures_by_depth", pictures)
        return QualitySearch(
            None, None, [None, None], 96, Quality(target_db - SHARED_DB, 1e5)
        ), traced

    return make


@pytest.mark.parametrize("target", [35, 45, 55])
def test_rounds_end_where_the_quality_is_reached(simulated, target):
    """Every round is in the mean, and few more rays are traced than one lattice would need."""
    wanted, traced = simulated(target)
    found = wanted.pictures()
    assert list(found.lattices) == [count for count, _ in traced]
    assert found.lattices[:2] == PILOT
    needed = 0.05**2 * 4 * 10 ** (target / 10)
    assert 0.97 < found.rays_per_pixel / max(needed, 9.06) < 1.2
    np.testing.assert_allclose(found_db(found.pictures), target, atol=0.5)


def test_a_pilot_that_errs_more_than_by_its_rays_does_not_spoil_the_mean(simulated):
    wanted, traced = simulated(60, power=2)
    found = wanted.pictures()
    assert found_db(found.pictures) > wanted.quality.quality_db
    by_rays = sum(count.rays_per_pixel * pictures for count, pictures in traced)
    assert found_db(by_rays / found.rays_per_pixel) < found_db(found.pictures) - 1


def test_rays_are_planned_by_a_pilot_of_a_tenth(simulated):
    wanted, traced = simulated(50)
    planned, needed = wanted.plan(), 0.05**2 * 4 * 1e5
    assert 0.95 < planned.lattice.rays_per_pixel / needed < 1.1
    assert planned.lattice.side(96) % 8 == 0 and planned.expected_db >= wanted.quality.quality_db
    assert planned.pilot_rays == sum(count.rays_per_pixel for count, _ in traced) < 0.12 * needed
    with pytest.raises(lfcore.OpticsError, match=r"takes about .* and the budget is 300"):
        replace(wanted, quality=Quality(50, 300)).plan()


@pytest.mark.parametrize("target", [38, 50])
def test_a_budget_is_enough_for_what_its_refusal_says(simulated, target):
    """Asking for what can be reached is not refused, and for the budget that it takes neither."""
    wanted, _ = simulated(target)
    asked = wanted.quality.quality_db
    with pytest.raises(lfcore.OpticsError) as refusal:
        replace(wanted, quality=Quality(asked, 40)).pictures()
    said = re.search(r"takes about ([\d,]+) rays.*Ask for at most ([\d.]+) dB", str(refusal.value))
    needed = 0.05**2 * 4 * 10 ** (target / 10)
    assert float(said[1].replace(",", "")) == pytest.approx(needed, rel=0.25)
    reachable = float(said[2])
    less = replace(wanted, quality=Quality(reachable - 0.5, 40))
    assert less.pictures().rays_per_pixel <= 40


def test_lattices_have_the_rays_they_are_asked_for():
    for rays in (1, 3.5, 16, 100, 3000):
        few, many = unlike_lattices(rays)
        for count in (one_lattice(rays), few, many):
            assert count.rays_per_pixel == pytest.approx(rays)
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
    planes = [SensorPlane(camera.focus_m * by, camera.f_number, "square") for by in (0.8, 1.2)]
    made = lfcore.render_to_quality(scene, Quality(38), planes=planes, pixels=32)
    assert made.pictures.shape == (2, 32, 32, 3) and made.expected_db.min() >= 38
    assert made.error.shape == (2, 32, 32)
    many = lfcore.render(scene, planes=planes, pixels=32, views=lfcore.Lattice(16, 4))
    assert worst_db(made.pictures, many) > 37


@pytest.mark.kernels
def test_a_sharp_edge_along_the_pixel_grid_is_not_wrong_alike():
    """Boxes wider than the rays of all views are apart blur it alike in every lattice, which no
    disagreement tells: pictures of the chart's background came out at 39.6 dB of these 46."""
    chart = lfcore.load_scene(Path(__file__).parents[2] / "scenes" / "chart")
    planes = [SensorPlane(2.0, 4.0, "square")]
    made = lfcore.render_to_quality(chart, Quality(46), planes=planes, pixels=48)
    truth = lfcore.render(chart, planes=planes, pixels=48, views=lfcore.Lattice(12, 4))
    assert worst_db(made.pictures, truth) > 45


@pytest.mark.kernels
def test_a_quality_beyond_the_budget_is_refused_with_what_it_takes(scene):
    with pytest.raises(lfcore.OpticsError, match=r"quality_db: 45 dB takes about [\d,]+ rays"):
        lfcore.render_to_quality(scene, Quality(45, 10), pixels=32)
    with pytest.raises(lfcore.OpticsError, match="quality_db: must be a positive number"):
        Quality(float("nan"))
    with pytest.raises(lfcore.OpticsError, match="most_rays: must be positive"):
        Quality(40, most_rays=0)


@pytest.mark.kernels
@pytest.mark.parametrize("crf", [None, 1, 40])
def test_a_stored_light_field_has_the_quality_that_it_says(scene, tmp_path, crf):
    """By the rays alone where the codec loses next to nothing, else by both; a given rate factor is
    kept, and its loss is said."""
    focus = scene.camera.focus_m
    field = lfcore.record(
        scene, tmp_path / "ball.mkv", pixels=32, encoding=lfcore.Encoding(crf=crf),
        quality=Quality(38, focus_range_m=(0.8 * focus, focus)),
    )  # fmt: skip
    expected = field.content["expected"]
    assert (expected["db"] < 36) == (crf == 40)
    assert crf == field.metadata.settings["crf"] or crf is None
    assert expected["focus_m"] == pytest.approx([0.8 * focus, focus])
    planes = [SensorPlane(at * focus, scene.camera.f_number) for at in (0.8, 0.9, 1)]
    many = lfcore.render(scene, planes=planes, pixels=32, views=lfcore.Lattice(16, 4))
    found = worst_db([field.refocus(plane.focus_m) for plane in planes], many)
    assert found > expected["db"] - 1.5 and (found > 37) == (crf != 40)
    with pytest.raises(lfcore.OpticsError, match="quality: chooses the rays itself"):
        lfcore.record(scene, tmp_path / "no.mkv", quality=Quality(38), views=4)
    with pytest.raises(lfcore.OpticsError, match="focus_range_m: must be two distances"):
        Quality(38, focus_range_m=(2, 1))
    assert not (tmp_path / "no.mkv").exists()


def test_a_range_of_focus_is_even_in_dioptres(scene):
    planes = planes_between(scene.camera, 2.0, np.inf)
    assert [plane.delta for plane in planes] == pytest.approx([0.5, 0.375, 0.25, 0.125, 0])

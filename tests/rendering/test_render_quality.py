"""Pictures of a wanted quality: what one view predicts of their error, and what comes of it."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from plain_scenes import CHART, refused

import lfcore
from lfcore import Lattice, Quality, SensorPlane
from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.rendering.first_look import BANDS_PX, BORDER, FirstLook
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.quality import VIEW_COST, QualitySearch, planes_between


def worst_db(pictures, truths):
    """PSNR of the worst picture without its border, on sRGB codes."""
    border = int(BORDER * len(truths[0]))
    inner = np.s_[border:-border, border:-border]
    pairs = zip(pictures, truths, strict=True)
    return min(psnr(srgb_encode(a[inner]), srgb_encode(b[inner]), peak=1) for a, b in pairs)


def look(straight=0.5, blur_px=2 * BANDS_PX[-1]):
    """Of a picture with even contrast: the first plane in focus, the second in wide blur."""
    blur = np.stack([np.full((50, 50), each) for each in (0, blur_px)])
    return FirstLook(np.full((50, 50), 0.01), np.full((50, 50), 0.01 * straight), blur, np.ones(2))


def search(quality):
    vars(made := QualitySearch(None, None, [None, None], 50, quality))["look"] = look()
    return made


def test_straight_edges_and_wide_blur_err_more():
    expected = look().expected_db(4, 1.5)
    of = [look(straight=share).expected_db(4, 1.5) for share in (0, 1)]
    assert of[0][0] > expected[0] > of[1][0] + 2 and of[0][1] == expected[1] == of[1][1]
    wider = look(blur_px=8 * BANDS_PX[-1]).expected_db(4, 1.5)
    assert expected[1] - wider[1] == pytest.approx(10 * np.log10(4)) and wider[0] == expected[0]


@pytest.mark.kernels
def test_a_lamp_brighter_than_white_errs_more(scene):
    def expected_db(glow):
        lit = [replace(each, emission=(glow,) * 3) for each in scene.materials]
        of = open_tracer(replace(scene, materials=lit)), scene.camera
        return FirstLook.at(*of, [SensorPlane(scene.camera.focus_m, 4)], 32).expected_db(4, 2)

    assert expected_db(9.0) < expected_db(0.9) - 2


@pytest.mark.parametrize("target", [32, 40, 48])
def test_the_cheapest_lattice_that_reaches_the_quality_is_chosen(target):
    of = look()
    lattice = search(Quality(target)).lattice()

    views, subpixels = np.meshgrid(np.arange(1, 30), np.arange(8, 64) / 8)
    reached = (of.expected_db(views, subpixels).min(axis=0) >= target) & (subpixels <= views)
    cost = views**2 * (subpixels**2 + VIEW_COST)
    assert of.expected_db(lattice.views, lattice.subpixels).min() >= target
    assert lattice.views**2 * (lattice.subpixels**2 + VIEW_COST) <= cost[reached].min() + 1e-9
    planned = search(Quality(target)).plan(spare_db=1)
    assert planned.side(50) % 8 == 0
    assert of.expected_db(planned.views, planned.subpixels).min() >= target + 1


def test_a_budget_is_enough_for_what_its_refusal_says():
    """Asking for what can be reached is not refused, and for the budget that it takes neither."""
    refusal = refused(None, search(Quality(45, 40)).lattice)
    words = str(refusal).replace(",", "").split()
    rays, reachable = float(words[words.index("rays") - 1]), float(words[words.index("most") + 1])
    assert search(Quality(45, rays + 1)).lattice().rays_per_pixel > 40
    assert search(Quality(reachable - 0.1, 40)).lattice().rays_per_pixel <= 40
    refused("over 262,144 rays", search(Quality(200)).lattice)


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
    many = lfcore.render(scene, planes=planes, pixels=32, views=Lattice(16, 4))
    assert 38 < worst_db(made.pictures, many) < 46


@pytest.mark.kernels
def test_planes_of_a_stopped_down_lens_need_the_rays_of_that_lens(scene):
    """Rays are traced through the widest aperture of the planes, not through the camera's."""
    tracer, camera = open_tracer(scene), scene.camera
    planes = [SensorPlane(camera.focus_m * by, 8 * camera.f_number) for by in (0.8, 1.2)]
    stopped = replace(camera, f_number=8 * camera.f_number)
    lattices = [
        QualitySearch(tracer, lens, planes, 32, Quality(40)).lattice() for lens in (camera, stopped)
    ]
    assert lattices[0] == lattices[1]


@pytest.mark.kernels
@pytest.mark.parametrize(("focus", "target"), [(2.0, 40), (2.0, 46), (1.3, 40)])
def test_the_chart_is_at_least_as_good_as_expected(focus, target):
    """Its edges are along the pixel grid: single lattices blur them alike."""
    chart = lfcore.load_scene(CHART)
    planes = [SensorPlane(focus, 4.0, "square")]
    made = lfcore.render_to_quality(chart, Quality(target), planes=planes, pixels=48)
    truth = lfcore.render(chart, planes=planes, pixels=48, views=Lattice(12, 4))
    assert worst_db(made.pictures, truth) > target - 1


@pytest.mark.kernels
def test_a_quality_beyond_the_budget_is_refused_with_what_it_takes(scene):
    with pytest.raises(lfcore.OpticsError, match=r"45 dB .* [\d,]+ rays") as refusal:
        lfcore.render_to_quality(scene, Quality(45, 10), pixels=32)
    assert refusal.value.key == "quality_db"
    refused("quality_db: must be a positive number", Quality, float("nan"))
    refused("most_rays: must be positive", Quality, 40, most_rays=0)


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
    refused("focus_range_m: must be two distances", Quality, 38, focus_range_m=(2, 1))
    assert not (tmp_path / "no.mkv").exists()


def test_a_range_of_focus_is_even_in_dioptres(scene):
    planes = planes_between(scene.camera, 2.0, np.inf)
    assert [plane.delta for plane in planes] == pytest.approx([0.5, 0.375, 0.25, 0.125, 0])

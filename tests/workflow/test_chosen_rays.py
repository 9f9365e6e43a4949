"""Light fields whose rays a pilot chooses: stored and judged."""

import numpy as np
import pytest

from lfcore.errors import SettingsError
from lfcore.evaluation.true_picture.reference import true_pictures
from lfcore.lightfield import LightField
from lfcore.opencl.device import open_device
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.scene.build import build_scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer
from lfcore.workflow.chosen_rays import COLUMNS, choose_rays
from lfcore.workflow.settings import check_settings

pytestmark = pytest.mark.kernels

PIXELS = 24


@pytest.fixture(scope="module")
def tracer():
    scene = build_scene("scenes/chart")
    return Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))


def test_a_pilot_chooses_what_the_worst_plane_takes(tracer, tmp_path):
    camera, settings = tracer.scene.camera, check_settings({})
    planes = [SensorPlane(focus, 2 * camera.f_number) for focus in (1.0, 1.6)]
    chosen = choose_rays(tracer, planes, PIXELS, 32.0)
    more = choose_rays(tracer, planes, PIXELS, 38.0)
    count = chosen.planned.lattice
    assert more.planned.lattice.rays_per_pixel > 2 * count.rays_per_pixel
    assert chosen.planned.expected_db >= 32 - 0.5
    # The pilot has 9 rays a pixel at least, and no more than it must once a tenth is more.
    assert more.planned.pilot_rays <= max(9.5, 0.2 * more.planned.lattice.rays_per_pixel)
    assert chosen.lens.f_number == 2 * camera.f_number, "nothing is traced that no plane asks for"

    pictures = chosen.pictures(tracer)
    file = tmp_path / "auto.mkv"
    size = chosen.record(file, tracer, settings["encoding"], settings["layout"])
    stored = chosen.stored_pictures(file, tracer)
    truth = true_pictures(tracer, planes, PIXELS, (Lattice(10, 3), Lattice(8, 4)))
    row = chosen.row(truth, pictures, stored, scene="chart", quality_db=32.0, bytes=size)
    assert set(row) == set(COLUMNS) and row["bytes"] == file.stat().st_size
    by_plane = truth.psnr(pictures)
    assert row["psnr_true_db"] == min(by_plane) > 30
    assert row["worst_plane_m"] == planes[int(np.argmin(by_plane))].focus_m
    assert 25 < row["psnr_stored_db"] < row["psnr_true_db"] + 1
    assert row["rays"] == count.rays(PIXELS) and row["lattice"] == str(count)
    with LightField.open(file) as field:
        said = field.metadata.content["expected"]
        assert said["db"] == pytest.approx(row["expected_db"], abs=0.01)
        assert said["focus_m"] == [1.0, 1.6]
        assert field.metadata.slab.views == count.views
        np.testing.assert_array_equal(field.refocus_many(planes), stored)


def test_one_plane_is_of_a_recording_like_several(tracer):
    plane = SensorPlane(1.0, tracer.scene.camera.f_number)
    chosen = choose_rays(tracer, [plane], PIXELS, 25.0)
    pictures = chosen.pictures(tracer)
    assert pictures.shape == (1, PIXELS, PIXELS, 3)
    both = choose_rays(tracer, [plane, plane], PIXELS, 25.0)
    assert both.planned == chosen.planned
    np.testing.assert_array_equal(both.pictures(tracer)[:1], pictures)


def test_what_is_dimmed_on_the_fly_is_dimmed_from_the_file(tracer, tmp_path):
    settings, f_number = check_settings({}), 2 * tracer.scene.camera.f_number
    planes = [SensorPlane(1.0, f_number, normalise=how) for how in ("lens", "aperture")]
    chosen = choose_rays(tracer, planes, PIXELS, 25.0)
    chosen.record(tmp_path / "a.mkv", tracer, settings["encoding"], settings["layout"])
    for dim, whole in (chosen.pictures(tracer), chosen.stored_pictures(tmp_path / "a.mkv", tracer)):
        # The disk of half the diameter, of the square that all lens samples fill.
        assert dim.mean() == pytest.approx(whole.mean() * np.pi / 16, rel=0.02)


def test_a_quality_beyond_the_budget_names_its_key(tracer):
    plane = SensorPlane(1.0, tracer.scene.camera.f_number)
    with pytest.raises(SettingsError, match=r"quality_db: chart: 75 dB takes about .* Ask for"):
        choose_rays(tracer, [plane], PIXELS, 75.0)

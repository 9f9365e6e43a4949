"""Which rays to choose: rows of the thesis's recipe and of a quality, and their table."""

import numpy as np
import pytest

from lfcore import Lattice, OpticsError, Slab
from lfcore.errors import SettingsError
from lfcore.evaluation import chosen_rays
from lfcore.evaluation.chosen_rays import COLUMNS, chosen_rays_table, chosen_row, thesis_row
from lfcore.evaluation.true_picture import inner_psnr, true_pictures
from lfcore.lightfield import LightField
from lfcore.optics.ray_cells import crossed_views
from lfcore.rendering.direct import focused_camera


def test_two_lattices_agree_on_the_truth(reference):
    side = reference.size.width
    assert reference.pictures.shape == (2, side, side, 3)
    assert (reference.known_db > 45).all()


def test_the_truth_does_not_depend_on_how_it_is_traced(chart, reference):
    """Rays that each count in their own pixel, none spread, give the same picture."""
    plane, side = reference.planes[0], reference.size.width
    slab = Slab(focused_camera(chart.scene.camera, plane), 24, 3 * side)
    inside = plane.mask(slab).ravel()
    light = chart.bundle_radiance(crossed_views(slab).bundles())[inside].clip(0, 1).mean(0)
    plain = light.reshape(side, 3, side, 3, 3).mean((1, 3))
    assert inner_psnr(plain, reference.pictures[0]) > 40


def test_alike_lattices_are_no_reference(chart, reference):
    with pytest.raises(OpticsError, match="too alike"):
        true_pictures(chart, reference.planes, 24, (Lattice(8, 3), Lattice(8, 4)))


pytestmark = pytest.mark.kernels


def test_a_quality_is_recorded_and_compared_with_the_recipe(tmp_path, chart, reference):
    file, side = tmp_path / "30.mkv", reference.size.width
    ours = chosen_row(file, chart.scene, chart.device, reference, 30.0)
    assert ours["bytes"] == file.stat().st_size and ours["expected_db"] > 29.5
    assert ours["seconds"] > 0 and ours["read_seconds"] > 0
    with LightField.open(file) as field:
        slab = field.metadata.slab
        pictures = field.refocus_many(reference.planes, device=chart.device)
    assert ours["rays"] == slab.rays == pytest.approx(ours["rays_per_pixel"] * side**2)
    assert ours["psnr_true_db"] == min(reference.psnr(pictures))
    assert ours["psnr_traced_db"] > 28 and ours["psnr_true_db"] > 25
    more = chosen_row(tmp_path / "42.mkv", chart.scene, chart.device, reference, 42.0)
    assert more["rays"] > 2 * ours["rays"]

    jobs = (
        {"seconds": 3.0},
        {"encode_seconds": 2.0, "join_seconds": 1.0, "video_bytes": 4 * ours["bytes"]},
        {"seconds": 7.0, "threads": 2},
    )
    dark = np.zeros_like(reference.pictures)
    theirs = thesis_row("chart", reference, 64, jobs, dark, dark)
    assert theirs["lattice"] == "64 x 1" and theirs["rays"] == (64 * side) ** 2
    assert (theirs["seconds"], theirs["read_seconds"]) == (6.0, 14.0)
    table = chosen_rays_table([theirs, ours, more])
    assert list(table.columns) == list(COLUMNS)
    assert table.size_share.tolist()[:2] == [1.0, 0.25] and table.rays_share[0] == 1
    assert table.seconds_share[1] == pytest.approx(ours["seconds"] / 6, rel=0.01)


def test_a_quality_beyond_the_budget_names_its_key(tmp_path, chart, reference):
    with pytest.raises(SettingsError, match=r"qualities_db: chart: 75 dB takes over .* Ask for"):
        chosen_row(tmp_path / "75.mkv", chart.scene, chart.device, reference, 75.0)
    assert not list(tmp_path.iterdir())


def test_shares_are_of_each_scenes_first_row():
    row = dict.fromkeys(COLUMNS) | {"rays": 10, "seconds": 2.0, "bytes": 100}
    rows = [row | {"scene": name, "rays": rays} for name in "ab" for rays in (10, 5)]
    assert chosen_rays.chosen_rays_table(rows).rays_share.tolist() == [1, 0.5, 1, 0.5]

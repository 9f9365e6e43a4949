"""Which rays to choose: rows of the thesis's recipe and of a quality, and their table."""

import numpy as np
import pytest

from lfcore.errors import SettingsError
from lfcore.evaluation import chosen_rays
from lfcore.evaluation.chosen_rays import COLUMNS, chosen_rays_table, chosen_row, thesis_row
from lfcore.lightfield import LightField

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

"""The ways to one picture agree as far as their filters do."""

import numpy as np
import pandas as pd
import pytest

from lfcore import OpticsError, SensorPlane
from lfcore.evaluation.equivalence import equivalence

PLANES = [SensorPlane(1.33, 1.0), SensorPlane(1.2, 1.4, "square"), SensorPlane(1.6, 1.0)]


@pytest.fixture(scope="module")
def result(chart):
    return equivalence(chart, PLANES, views=16, pixels=64, reference_views=32)


def of(result, method, filter):
    found = [m for m in result.made if m.method.startswith(method) and m.filter == filter]
    assert len(found) == 1
    return found[0].pictures


@pytest.mark.kernels
def test_one_filter_one_picture(result):
    """Slicing, views and photograph see the same rays: only 8-bit frames lie between."""
    slicing = of(result, "slicing", "nearest")
    for method in ("shift-sum on views", "shift-sum on the plenoptic"):
        difference = np.abs(of(result, method, "nearest") - slicing)
        assert difference.max() < 0.015
        assert difference.mean() < 0.002
    bilinear = [of(result, f"shift-sum on {what}", "bilinear") for what in ("views", "the p")]
    assert np.abs(bilinear[0] - bilinear[1]).max() < 0.015


@pytest.mark.kernels
def test_table_is_whole_and_plausible(result):
    table = pd.DataFrame(result.rows)
    assert len(table) == 3 * 6
    ours = table[table.method != "traced directly"]
    assert (ours.psnr_db > 20).all() and (ours.psnr_inside_db > 26).all()
    assert ours.ssim.between(0.5, 1).all()
    # Errors of resampling gather at edges; at the recorded focus nothing is resampled.
    assert (ours[ours.focus_m != 1.33].error_at_edges > 0.1).all()
    assert (table.seconds > 0).all()
    own = table[table.method == "traced directly"]
    assert np.isinf(own.psnr_db).all() and (own.rays_per_pixel == 1024).all()
    # At the recorded focus nothing has to be resampled: only the number of rays differs.
    assert (ours[ours.focus_m == 1.33].psnr_db > 30).all()
    assert all(errors.max() > 0 for _, errors in result.errors())


def test_what_was_not_recorded_is_refused(chart):
    with pytest.raises(OpticsError, match="wider"):
        equivalence(chart, [SensorPlane(2.0, 0.5)], views=4, pixels=32)

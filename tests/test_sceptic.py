"""The benchmark beside path tracers: our part runs, and missing or unfit peers are one line."""

import numpy as np
import pytest

from benchmarks import sceptic
from benchmarks.peers.method import SkippedError
from benchmarks.peers.mitsuba_lens import check_plain
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.prepared import open_tracer
from tests.plain_scenes import scene, wall


def test_a_scene_that_a_peer_cannot_shade_is_left_out_by_name():
    cut = scene(wall(3.0), colours=np.ones((len(wall(3.0)), 3, 3), np.float32))
    with pytest.raises(SkippedError, match="colours at corners"):
        check_plain(cut)


@pytest.mark.kernels
def test_rows_have_what_each_setting_made(tmp_path):
    """Seconds are of the best of the runs, dB of each plane; a figure and crops are made of it."""
    shown = scene(wall(3.0))
    tracer = open_tracer(shown)
    planes = [SensorPlane(focus, shown.camera.f_number) for focus in (2.0, 3.0, 5.0)]
    points = list(sceptic.ours(tracer, planes, 64, 4))
    assert {point.rays for point in points if np.isfinite(point.rays)} == {1, 4}
    fixed = [point for point in points if np.isfinite(point.rays)]
    truths, kept = fixed[-1].make()[0], {}
    rows = list(sceptic.rows_of(shown, fixed, truths, 64, 1, kept))
    assert [row["setting"] for row in rows] == [point.setting for point in fixed]
    assert all(float(row["core s"]) > 0 for row in rows)
    assert float(rows[-1]["middle dB"]) > 60
    kept[shown.name, 64, "true", ""] = truths[1]
    table = sceptic.pd.DataFrame(rows)
    sceptic.figure(table, tmp_path / "figure.png")
    sceptic.crops(table, kept, tmp_path)
    assert len(list(tmp_path.glob("*.png"))) == 2

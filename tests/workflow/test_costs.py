"""How work is cut into jobs, and what these ask for."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.storage.layout import FrameLayout
from lfcore.workflow import costs


def tiles(views, pixels, most_rays):
    return FrameLayout("macropixels", views, pixels).tiles(most_rays)


@given(st.integers(2, 64), st.integers(16, 96), st.integers(1, 1 << 18), st.floats(1e-4, 60))
def test_batches_are_all_tiles_in_order(views, pixels, most_rays, minutes):
    cut = tiles(views, pixels, most_rays)
    batches = costs.batches(cut, minutes)
    assert [k for one in batches for k in range(one.start, one.stop)] == list(range(len(cut)))
    assert [one.rays for one in batches] == [
        sum(tile.rays for tile in cut[one.start : one.stop]) for one in batches
    ]
    seconds = sum(tile.rays for tile in cut) * costs.nanoseconds_a_ray(views) * 1e-9
    least = 2 if seconds >= costs.SHARED_SECONDS else 1
    assert len(batches) >= min(least, len(cut)) and len(batches) <= costs.MOST_BATCHES
    sizes = [one.stop - one.start for one in batches]
    assert max(sizes) - min(sizes) <= 1


def test_a_hundred_thousand_tiles_are_a_plan_of_hundreds_of_jobs():
    cut = tiles(512, 4096, (128 << 20) // 3)
    assert len(cut) > 100_000
    batches = costs.batches(cut, 10)
    assert 200 < len(batches) < 1000
    minutes = costs.trace_minutes(batches[0].rays, 512, None)
    assert 10 * costs.MARGIN <= minutes <= 10 * costs.MARGIN + 2


def test_a_ray_costs_what_was_measured():
    for views, cost in costs.NANOSECONDS.items():
        assert costs.nanoseconds_a_ray(views) == pytest.approx(cost)
    between = costs.nanoseconds_a_ray(90)
    assert costs.NANOSECONDS[128] < between < costs.NANOSECONDS[64]
    assert costs.nanoseconds_a_ray(8) == 2 * costs.nanoseconds_a_ray(16)
    assert costs.nanoseconds_a_ray(1024) == costs.nanoseconds_a_ray(512)


def test_requests_follow_what_was_measured_and_grow_with_attempts(tmp_path):
    rays = 64**2 * 512**2
    assert costs.traced_before(tmp_path, "bike", 64) is None
    costs.traced_before.cache_clear()
    for pixels, seconds in ((64, 1.0), (128, 2000.0)):
        file = tmp_path / "bike" / f"M{pixels}" / "N64" / "trace.json"
        file.parent.mkdir(parents=True)
        record = {
            "rays": pixels**2 * 64**2,
            "seconds": seconds,
            "encode_seconds": 0.0,
            "memory_mib": 9000,
        }
        file.write_text(json.dumps(record))
    traced = costs.traced_before(tmp_path, "bike", 64)
    assert traced["seconds"] == 2000.0  # of the largest
    minutes = costs.trace_minutes(rays, 64, traced)
    assert minutes > costs.trace_minutes(rays, 64, None)
    assert costs.trace_minutes(rays, 64, traced, 3) == 3 * minutes
    need = costs.trace_mib(10, 512, traced)
    assert need > 9000 and costs.trace_mib(10, 512, traced, 2) == 2 * need
    costs.traced_before.cache_clear()
    (tmp_path / "bike" / "M256" / "N64").mkdir(parents=True)
    costs.traced_before.cache_clear()
    (tmp_path / "bike" / "M256" / "N64" / "trace.json").write_text("{")
    assert costs.traced_before(tmp_path, "bike", 64) == traced


def test_parts_of_planes_add_up_in_any_grouping():
    slab, planes = Slab(Camera(0.05, 0.036, 2.0, 3.0), 4, 16), [SensorPlane(3.0, 2.0)]
    draw = np.random.default_rng(5)
    parts = []
    for _ in range(6):
        left, top = draw.integers(0, 12, 2).tolist()
        columns, rows = (draw.integers(1, 5, 2)).tolist()
        sums = draw.integers(0, 1 << 40, (1, 3, rows, columns)).astype(np.uint64)
        parts.append(PlaneSums(slab, planes, sums, left, top))
    left = parts[0].with_part(parts[1]).with_part(parts[2])
    right = parts[3].with_part(parts[4].with_part(parts[5]))
    whole = total(slab, planes, parts)
    assert np.array_equal(total(slab, planes, [left, right]).sums, whole.sums)
    assert whole.sums.any()

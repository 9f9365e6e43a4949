"""How work is cut into jobs, and what these ask for."""

import numpy as np
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
    seconds = sum(tile.rays for tile in cut) * costs.nanoseconds_per_ray(views) * 1e-9
    least = 2 if seconds >= costs.SHARED_SECONDS else 1
    assert len(batches) >= min(least, len(cut)) and len(batches) <= costs.MOST_BATCHES
    sizes = [one.stop - one.start for one in batches]
    assert max(sizes) - min(sizes) <= 1


def test_a_hundred_thousand_tiles_are_a_plan_of_hundreds_of_jobs():
    cut = tiles(512, 4096, (128 << 20) // 3)
    assert len(cut) > 100_000
    batches = costs.batches(cut, 10)
    assert 200 < len(batches) < 1000
    minutes = costs.trace_minutes(batches[0].rays, 512)
    assert 10 * costs.MARGIN <= minutes <= 10 * costs.MARGIN + 2


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

"""How work is cut into jobs, and what these ask for."""

from hypothesis import given
from hypothesis import strategies as st

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

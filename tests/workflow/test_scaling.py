"""The model of a run's time, against cases whose answer is known."""

import heapq
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfcore.storage.layout import FrameLayout
from lfcore.workflow import costs, scaling
from lfcore.workflow.scaling import Overheads, Rates, Recording, estimate, finished, planned, seen

NONE = Overheads(
    plan_s=0, plan_job_s=0, start_s=0, scene_s=0, close_s=0, submission_s=0, submit_s=0, queue_s=0,
    poll_s=1e-9, join_bytes_s=math.inf, picture_ns=0, sum_bytes_s=math.inf,
    storage_bytes_s=math.inf,
)  # fmt: skip
RATES = Rates(trace_ns=6, encode_ns=30, bytes_a_ray=0.003, blur=0.1, planes=5, retrieve_ns=4)
REAL = Overheads(
    plan_s=2, plan_job_s=0.004, start_s=1.2, scene_s=4, close_s=2, submission_s=6, submit_s=0.3,
    queue_s=1, poll_s=5, join_bytes_s=1.2e9, picture_ns=300, sum_bytes_s=1e9, storage_bytes_s=1e9,
)  # fmt: skip


@pytest.mark.parametrize("cores", [1, 2, 4])
def test_without_overheads_time_is_work_by_cores(cores):
    field = Recording(1e10, 512, 8)
    run = estimate(field, RATES, NONE, cores, submitted=False)
    assert run.core_seconds == pytest.approx(360)
    assert run.seconds == pytest.approx(360 / cores)
    assert run.bound == "cores"


def test_more_cores_than_jobs_wait_for_one_job():
    field = Recording(1e10, 512, 8)
    runs = [estimate(field, RATES, NONE, cores, submitted=False) for cores in (8, 9, 1000)]
    assert [run.seconds for run in runs] == pytest.approx([45] * 3)
    assert {run.bound for run in runs} == {"length of a job"}


@given(st.floats(1e9, 1e15), st.integers(1, 10_000), st.booleans())
def test_no_run_beats_its_cores_and_more_cores_are_no_slower(rays, cores, submitted):
    field = planned(rays, 512, 10)
    assert field.batches <= costs.MOST_BATCHES
    few, many = (
        estimate(field, RATES, REAL, count, submitted=submitted) for count in (cores, 2 * cores)
    )
    assert few.seconds * cores >= field.rays * RATES.ray_s
    # Polls come in steps: what ends a little sooner may be seen a little later.
    slack = 3 * scaling.LONGEST_POLL if submitted else 1e-6
    assert many.seconds <= few.seconds + slack
    assert few.core_seconds == many.core_seconds >= field.rays * RATES.ray_s


@given(
    st.integers(1, 40), st.floats(0.1, 50), st.integers(1, 12), st.floats(0, 20),
)  # fmt: skip
def test_ends_are_those_of_a_queue(count, seconds, cores, gap):
    """Beside a slow reference: time in steps from event to event."""
    waiting = [(place + 1) * gap for place in range(count)]
    running: list[float] = []
    now, ends = 0.0, []
    while waiting or running:
        while waiting and waiting[0] <= now and len(running) < cores:
            heapq.heappush(running, now + seconds)
            waiting.pop(0)
        moments = [*running[:1]]
        if waiting and len(running) < cores:
            moments.append(waiting[0])
        now = max(now, min(moments))
        while running and running[0] <= now:
            ends.append(heapq.heappop(running))
    assert finished(count, seconds, cores, gap) == pytest.approx(ends)


def test_polls_back_off_and_begin_again():
    # Asked at 5, 20, 45, 80, ...: intervals grow by ten.
    assert seen([4.0], 5) == 5
    assert seen([6.0], 5) == 20
    assert seen([21.0], 5) == 45
    # Something had ended at 20: asked again five seconds later, then after fifteen.
    assert seen([6.0, 21.0], 5) == 25
    assert seen([6.0, 26.0], 5) == 40
    # Three minutes at most.
    assert seen([1e5], 5) - 1e5 <= scaling.LONGEST_POLL


def test_what_binds_is_named():
    slow_submits = Overheads(**{**vars(REAL), "submit_s": 5.0})
    small = Recording(1e11, 512, 4096)
    assert estimate(small, RATES, slow_submits, 10_000, submitted=True).bound == "submitting"
    poor = Overheads(**{**vars(REAL), "storage_bytes_s": 1e5})
    assert estimate(planned(1e12, 512, 10), RATES, poor, 1000, submitted=True).bound == "storage"
    wide = Rates(**{**vars(RATES), "blur": 1.0})
    assert estimate(planned(1e14, 512, 10), wide, REAL, 10_000, submitted=True).bound == "one sum"
    decoded = estimate(planned(1e13, 512, 10), RATES, REAL, 1000, submitted=True, retrieved=True)
    assert decoded.bound == "one decoder"


def test_the_cut_is_the_workflows():
    cut = FrameLayout("macropixels", 512, 4096).tiles((128 << 20) // 3)
    assert planned((512 * 4096) ** 2, 512, 10).batches == len(costs.batches(cut, 10))

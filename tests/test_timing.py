"""The protocol of published seconds, on a clock that the test turns by hand."""

import functools
import json

import pytest

from lfcore.timing import Stopwatch, clocked, clocked_warm, machine, measure_in_turn, measure_within


class Clock:
    """Seconds that pass only when somebody works."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def work(self, seconds):
        self.now += seconds


def test_work_takes_turns():
    clock, order = Clock(), []

    def worker(name, *costs):
        left = iter(costs)
        return lambda: (order.append(name), clock.work(next(left)))

    workers = worker("a", 1.0, 3.0, 2.0), worker("b", 1.0, 1.0, 1.0)
    full, lean = measure_in_turn(workers, repeats=3, clock=clock)
    assert order == ["a", "b"] * 3
    assert full.seconds == (1.0, 3.0, 2.0) and lean.seconds == (1.0,) * 3
    assert full.median == 2.0 and full.quartiles == (1.5, 2.5)


def test_stopwatch_adds_up_parts_and_items():
    clock = Clock()
    watch = Stopwatch(clock=clock)

    def items():
        for cost in (1.0, 2.0):
            clock.work(cost)
            yield cost

    for _ in watch.each("trace", items()):
        with watch.part("encode"):
            clock.work(10.0)
    assert watch.seconds == {"trace": 3.0, "encode": 20.0}


def test_what_is_reported_is_json():
    described = json.loads(json.dumps(machine()))
    assert described["cores"] >= 1 and described["processor"]


class Programs:
    """Counts what the first run builds."""

    def __init__(self, first=1):
        self.count, self.left = 0, [first]

    def __call__(self):
        return self.count

    def needed(self):
        self.count += self.left.pop() if self.left else 0


@pytest.mark.parametrize(
    ("built", "costs", "counted"),
    [
        (1, [100.0, 3.0], 3.0),  # the first run built a program
        (0, [3.0], 3.0),
        (0, [0.1, 0.05], 0.05),  # short: what is new to a process weighs
    ],
)
def test_a_run_counts_when_its_programs_are_made(built, costs, counted):
    clock, programs, left = Clock(), Programs(built), iter(costs)

    def work():
        programs.needed()
        clock.work(next(left))
        return "made"

    made, seconds = clocked_warm(work, programs, clock=clock)
    assert made == "made" and seconds == pytest.approx(counted) and not list(left)
    assert clocked(lambda: clock.work(2.0), clock=clock) == (None, 2.0)


def test_repeats_keep_to_a_budget():
    clock, seen = Clock(), []

    def work(cost=0.2):
        seen.append(cost)
        clock.work(cost)
        return "made"

    result, timing = measure_within(work, 0.5, iter([0, 1]).__next__, repeats=9, clock=clock)
    assert result == "made" and len(seen) == 3 and len(timing.seconds) == 2
    seen.clear()
    result, timing = measure_within(work, 0.5, Programs(0), repeats=9, clock=clock)
    assert result == "made" and len(seen) == 2 and len(timing.seconds) == 2
    seen.clear()
    short = functools.partial(work, cost=0.01)
    _, timing = measure_within(short, 0.5, Programs(0), repeats=9, clock=clock)
    assert len(timing.seconds) == 9 and len(seen) == 10
    seen.clear()
    _, timing = measure_within(work, 0.1, Programs(0), repeats=9, clock=clock)
    assert len(seen) == 1 and timing.seconds == pytest.approx((0.2,))

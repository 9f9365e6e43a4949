"""The protocol of published seconds, on a clock that the test turns by hand."""

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
    for _ in watch.each("trace", map(clock.work, (1.0, 2.0))):
        with watch.part("encode"):
            clock.work(10.0)
    assert watch.seconds == {"trace": 3.0, "encode": 20.0}
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


@pytest.mark.parametrize(
    ("cost", "budget", "built", "runs", "counted"),
    [
        (0.2, 0.5, 1, 3, 2),  # the first run built a program
        (0.2, 0.5, 0, 2, 2),
        (0.01, 0.5, 0, 10, 9),  # short: what is new to a process weighs
        (0.2, 0.1, 0, 1, 1),
    ],
)
def test_repeats_keep_to_a_budget(cost, budget, built, runs, counted):
    clock, programs, seen = Clock(), Programs(built), []

    def work():
        programs.needed()
        seen.append(clock.work(cost))
        return "made"

    result, timing = measure_within(work, budget, programs, repeats=9, clock=clock)
    assert result == "made" and len(seen) == runs
    assert timing.seconds == pytest.approx((cost,) * counted)

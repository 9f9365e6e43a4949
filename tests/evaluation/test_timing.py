"""The protocol of published seconds, on a clock that the test turns by hand."""

import json

import pytest

from lfcore.evaluation.timing import Stopwatch, Timing, machine, measure


class Clock:
    """Seconds that pass only when somebody works."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now

    def work(self, seconds):
        self.now += seconds


def test_warm_up_is_not_counted():
    clock, costs = Clock(), iter([100.0, 1.0, 3.0, 2.0])
    timing = measure(lambda: clock.work(next(costs)), repeats=3, warm_up=1, clock=clock)
    assert timing.seconds == (1.0, 3.0, 2.0)
    assert timing.median == 2.0
    assert timing.quartiles == (1.5, 2.5)


def test_the_device_queue_is_finished_inside_the_time():
    clock, pending = Clock(), []

    def finish():
        while pending:
            clock.work(pending.pop())

    timing = measure(lambda: pending.append(2.0), repeats=2, finish=finish, clock=clock)
    assert timing.seconds == (2.0, 2.0)


def test_no_repeats_is_no_measurement():
    with pytest.raises(ValueError, match="at least 1"):
        measure(lambda: None, repeats=0)


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


def test_stopwatch_counts_a_part_that_fails():
    clock = Clock()
    watch = Stopwatch(clock=clock)
    with pytest.raises(RuntimeError), watch.part("encode"):
        clock.work(4.0)
        raise RuntimeError
    assert watch.seconds == {"encode": 4.0}


def test_what_is_reported_is_json():
    assert json.loads(json.dumps(Timing((1.0, 2.0)).to_json()))["median_seconds"] == 1.5
    described = json.loads(json.dumps(machine()))
    assert described["cores"] >= 1 and described["processor"]

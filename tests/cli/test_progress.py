"""The line of progress: what it says while programs are built, and afterwards."""

import io

import pytest

from lfcore.cli import progress as lines
from lfcore.opencl import program_cache


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    now = 0.0

    def perf_counter(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr(lines, "time", found)
    return found


def build(clock, seconds):
    with program_cache._telling():
        clock.now += seconds


def test_a_terminal_sees_that_kernels_are_built_and_then_traced(clock, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(lines.sys, "stderr", terminal)
    with lines.progress("tracing 16 rays", "rays") as report:
        build(clock, 3.0)
        clock.now += 1.0
        report(8, 16)
        clock.now += 1.0
        report(16, 16)
    shown = [line.strip() for line in terminal.getvalue().split("\r")[1:]]
    assert shown[0] == "building kernels ..."
    assert shown[1] == "tracing 16 rays ..."
    assert "8/16 rays, 1 s left" in shown[2], "what is built counts as no step"
    assert shown[-1] == "tracing 16 rays: 5.0 s, 3.0 s of them building kernels"


def test_a_log_has_one_line(clock, monkeypatch, capsys):
    with lines.progress("tracing", "rays") as report:
        clock.now += 1.0
        report(1, 2)
    assert capsys.readouterr().err == "tracing: 1.0 s\n"


def test_builds_of_several_threads_count_once(clock, capsys):
    with lines.progress("tracing"):
        with program_cache._telling():
            build(clock, 2.0)
            clock.now += 1.0
    assert capsys.readouterr().err == "tracing: 3.0 s, 3.0 s of them building kernels\n"

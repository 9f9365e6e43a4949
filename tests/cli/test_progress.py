"""The line of progress: what it says while programs are built, and afterwards."""

import io

import pytest

from lfcore.cli import progress as lines
from lfcore.opencl import program_cache


class Terminal(io.StringIO):
    def isatty(self):
        return True


class Clock:
    now = 1000.0

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


def test_rays_a_second_do_not_count_what_is_built(clock, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(lines.sys, "stderr", terminal)
    with lines.progress("tracing", rays=8_000_000) as report:
        build(clock, 3.0)
        clock.now += 2.0
        report(1, 2)
        clock.now += 2.0
        report(2, 2)
    shown = [line.strip() for line in terminal.getvalue().split("\r")[1:]]
    assert shown[2].endswith("50%, 2 million rays a second, 2 s left")
    assert shown[-1].endswith("3.0 s of them building kernels, 2 million rays a second")


def test_while_kernels_are_built_nothing_else_is_said(clock, monkeypatch):
    """Another thread may have a part ready; what holds it up is what is built."""
    terminal = Terminal()
    monkeypatch.setattr(lines.sys, "stderr", terminal)
    with lines.progress("tracing", "parts") as report, program_cache._telling():
        clock.now += 5.0
        report(1, 4)
        assert terminal.getvalue().split("\r")[-1].strip() == "building kernels ..."


def test_a_line_is_no_wider_than_the_terminal(clock, monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(lines.sys, "stderr", terminal)
    monkeypatch.setattr(lines.shutil, "get_terminal_size", lambda default: (40, 24))
    with lines.progress("tracing a picture with a long name", "parts") as report:
        clock.now += 1.0
        report(1, 4)
    shown = terminal.getvalue().split("\r")[1]
    assert len(shown) == 39


def test_a_record_has_what_would_be_said(clock, tmp_path, capsys):
    with lines.recorded("trace") as record:
        with lines.progress("tracing", rays=100):
            build(clock, 1.0)
            clock.now += 0.5
        lines.say("three triangles")
        (tmp_path / "a").write_bytes(b"12345")
        lines.wrote(tmp_path / "a", ": more")
        lines.note(scene="x")
    assert capsys.readouterr() == ("", "")
    step = {"what": "tracing", "seconds": 1.5, "building_kernels_seconds": 1.0, "rays": 100}
    assert record == {
        "command": "trace", "said": ["three triangles"], "scene": "x",
        "files": [{"file": str(tmp_path / "a"), "bytes": 5}],
        "steps": [step | {"rays_per_second": 200}],
    }  # fmt: skip

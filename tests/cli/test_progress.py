"""The line of progress, the last line's seconds and rate, and the record for programs."""

import io
import time

import pytest

from lfcore.cli import progress as lines
from lfcore.progress import BAKING, BUILDING, stage


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
    with stage(BUILDING):
        clock.now += seconds


def test_a_terminal_sees_a_bar_and_that_kernels_are_built(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(lines.sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")

    def wait_for(text):
        end = time.monotonic() + 30
        while text not in terminal.getvalue() and time.monotonic() < end:
            time.sleep(0.05)
        assert text in terminal.getvalue()

    with lines.progress("tracing", "parts") as report:
        with stage(BUILDING):
            wait_for("building kernels")
        report(8, 16)
        wait_for("8/16")
    assert "tracing: " in terminal.getvalue().splitlines()[-1]


def test_the_last_line_has_seconds_and_a_rate_without_those_of_building(clock, capsys):
    with lines.progress("tracing", "rays") as report:
        clock.now += 1.0
        report(1, 2)
    assert capsys.readouterr().err == "tracing: 1.0 s\n"
    with lines.progress("tracing"):
        with stage(BAKING):
            build(clock, 2.0)
            clock.now += 1.0
    said = "tracing: 3.0 s, 2.0 s of them building kernels, 1.0 s of them baking light\n"
    assert capsys.readouterr().err == said
    with lines.progress("tracing", rays=8_000_000):
        build(clock, 3.0)
        clock.now += 4.0
    assert capsys.readouterr().err.endswith("building kernels, 2 million rays per second\n")


def test_a_record_has_what_would_be_said(clock, tmp_path, capsys):
    with lines.recorded("record") as record:
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
        "command": "record", "said": ["three triangles"], "scene": "x",
        "files": [{"file": str(tmp_path / "a"), "bytes": 5}],
        "steps": [step | {"rays_per_second": 200}],
    }  # fmt: skip

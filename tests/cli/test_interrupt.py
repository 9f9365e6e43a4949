"""Signals end a command within seconds, whatever it waits for, and leave nothing."""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager

import pytest
from plain_scenes import SCENES

from lfcore.files import whole_file

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")

WITHIN_S = 2.0
LOAD_S = 1.0  # what a machine that is busy with other things may add


@contextmanager
def start(tmp_path, *command, **streams):
    """A process that obeys signals, even where the tests run with some of them ignored."""

    def heed():
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)

    with subprocess.Popen(
        [sys.executable, *map(str, command)], cwd=tmp_path, stderr=subprocess.PIPE, text=True,
        env=os.environ | {"LFCORE_THREADS": "1"}, preexec_fn=heed, **streams,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            process.kill()


def wait_for(condition, process, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert process.poll() is None, process.stderr.read()
        assert time.monotonic() < end, "the command did not come so far"
        time.sleep(0.02)


def end(process, number):
    """The status of a process that ends in time after a signal, and what it said."""
    begun = time.monotonic()
    process.send_signal(number)
    status = process.wait(timeout=30)
    assert time.monotonic() - begun < WITHIN_S + LOAD_S
    return status, process.stderr.read()


@pytest.mark.slow
@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_trace_ends_at_once_and_leaves_nothing(tmp_path, number, status):
    words = ("record", SCENES / "chart", "-o", "out.mkv", "--pixels", 1024, "--views", 64)
    with start(tmp_path, "-m", "lfcore", *words) as process:
        wait_for(lambda: list(tmp_path.glob(".out.mkv.*/*")), process)
        time.sleep(0.3)  # into the first tile
        found, said = end(process, number)
        assert found == status and said.splitlines()[-1] in ("Interrupted.", "Terminated.")
    assert list(tmp_path.iterdir()) == []


STUCK = """
import sys, time
from lfcore.cli import main
from lfcore.cli.interrupt import interruptible
from lfcore.files import whole_file, draft_folder
def deaf():
    end = time.monotonic() + 60
    while time.monotonic() < end:
        try:
            print("ready", flush=True)
            time.sleep(60)  # as a kernel that runs on: nothing comes of the exception
        except KeyboardInterrupt:
            print("was told", file=sys.stderr, flush=True)
with interruptible(), whole_file("a.bin") as file, draft_folder("b"):
    file.write(bytes(100))
    deaf()
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_command_that_does_not_listen_is_ended(tmp_path, name):
    number = getattr(signal, name)
    with start(tmp_path, "-c", STUCK, stdout=subprocess.PIPE) as process:
        assert process.stdout.readline() == "ready\n"
        assert len(list(tmp_path.iterdir())) == 2
        status, said = end(process, number)
        assert status == 128 + number and "was told" in said
    assert list(tmp_path.iterdir()) == []


def test_handlers_of_others_are_left_alone(tmp_path):
    from lfcore.cli.interrupt import interruptible

    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with interruptible():
            assert signal.getsignal(signal.SIGTERM) == signal.SIG_IGN
        assert signal.set_wakeup_fd(-1) == -1
    finally:
        signal.signal(signal.SIGTERM, before)
    with pytest.raises(KeyboardInterrupt), interruptible(), whole_file(tmp_path / "a"):
        raise KeyboardInterrupt

"""Forked children that judge inputs, with limits of time and memory.

The parent imports all modules and then forks, so a child costs milliseconds.  When a child dies,
its last input is at fault, and another child takes the next.
"""

import faulthandler
import os
import resource
import signal
import traceback
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from robustness.outcome import Outcome

ROOT = Path(__file__).resolve().parents[1]
"""The checkout, of whose frames the innermost names an outcome."""

FORK = get_context("fork")
PER_CHILD = 200
"""The inputs of a child, which may leak memory."""


@dataclass(frozen=True)
class Limits:
    """Limits of inputs and children.

    Attributes
    ----------
    cpu, wall : float
        CPU and wall seconds per input.
    memory : int, optional
        Bytes of a child's memory beyond the parent's; None is no limit.
    file : int
        Bytes of a file.
    """

    cpu: float = 10.0
    wall: float = 150.0
    memory: int | None = 2 << 30
    file: int = 256 << 20


class Children:
    """Runs ``judge(input)`` in a child; the stack of one that dies is written to ``crash_log``."""

    def __init__(self, judge: Callable[[Any], Outcome], limits: Limits, crash_log: Path):
        self._judge, self._limits, self._crash_log = judge, limits, crash_log
        self._child: Any = None

    def __enter__(self) -> "Children":
        return self

    def __exit__(self, *_: object) -> None:
        if self._child is not None:
            self._end()

    def judge(self, data: Any) -> Outcome:
        """Return the outcome of an input, pickled for the child."""
        if self._child is None:
            self._start()
        self._left -= 1
        outcome, hangs = None, False
        with suppress(EOFError, ConnectionError):
            self._pipe.send(data)
            hangs = not self._pipe.poll(self._limits.wall)
            outcome = None if hangs else self._pipe.recv()
        if outcome is None or not self._left:
            status = self._end()
        return outcome or _death(hangs, status, self._crash_log)

    def _start(self) -> None:
        self._crash_log.write_bytes(b"")
        self._pipe, end = FORK.Pipe()
        arguments = self._judge, self._limits, self._crash_log, end
        self._child, self._left = FORK.Process(target=_run, args=arguments, daemon=True), PER_CHILD
        self._child.start()
        end.close()

    def _end(self) -> int:
        """End the child, and its own children; return its status."""
        child, self._child = self._child, None
        self._pipe.close()
        with suppress(ProcessLookupError):
            os.killpg(child.pid, signal.SIGKILL)
        child.join()
        return child.exitcode


def judged(
    inputs: Iterable[Any], judge: Callable[[Any], Outcome], limits: Limits, crash_log: Path
) -> list[Outcome]:
    """Return the outcomes of some inputs, judged in children."""
    with Children(judge, limits, crash_log) as children:
        return [children.judge(data) for data in inputs]


def _run(judge: Callable, limits: Limits, crash_log: Path, pipe: Connection) -> None:
    """Judge inputs in a child, until it is killed."""
    os.setsid()
    _restrain(limits, crash_log)
    while True:
        data = pipe.recv()
        # CPU time, as the wall clock depends on the machine's load.
        signal.setitimer(signal.ITIMER_PROF, limits.cpu)
        try:
            outcome = judge(data)
        except Exception as error:  # a fault of the harness
            outcome = Outcome("harness", repr(error)[:200], traceback.format_exc())
        signal.setitimer(signal.ITIMER_PROF, 0)
        pipe.send(outcome)


def _restrain(limits: Limits, crash_log: Path) -> None:
    silence = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silence, stream)
    stack = open(crash_log, "wb", buffering=0)
    faulthandler.enable(stack, all_threads=False)
    # On a timeout the stack is written, then the signal kills the child.
    faulthandler.register(signal.SIGPROF, stack, all_threads=False, chain=True)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (limits.file, limits.file))
    if limits.memory is not None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + limits.memory
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _death(hangs: bool, status: int, crash_log: Path) -> Outcome:
    stack = crash_log.read_text(errors="replace")
    place = _innermost(stack)
    if hangs or status == -signal.SIGPROF:
        kind = "hang" if hangs else "time"
        return Outcome(kind, f"{kind} {place}", stack[:2000])
    how = signal.Signals(-status).name if status < 0 else f"status {status}"
    return Outcome("crash", f"{how} {place}", stack[:2000])


def _innermost(stack: str) -> str:
    """Return the project's innermost frame in a stack by faulthandler, innermost first."""
    for line in stack.splitlines():
        file, _, rest = line.partition('", line ')
        _, root, module = file.partition(f"{ROOT}/")
        if root and module.startswith(("lfcore/", "workflow/")):
            return f"in {module}:{rest.partition(' in ')[2]}"
    return "in the harness"

"""Inputs run in forked children, many per child, with limits of time and memory.

The parent imports what the inputs need and then forks, so a child costs milliseconds.  A child
reports each input when it has finished it.  When a child dies, the input after the last report is
at fault, and another child continues after it.
"""

import faulthandler
import json
import os
import resource
import select
import signal
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from robustness.outcome import Outcome


@dataclass(frozen=True)
class Limits:
    """The limits of an input, CPU and wall seconds, and of a child, bytes of memory and per file.

    ``memory`` is beyond the parent's memory; None is no limit.
    """

    cpu: float = 10.0
    wall: float = 150.0
    memory: int | None = 2 << 30
    file: int = 256 << 20


def run_all(
    count: int, one: Callable[[int], Outcome], limits: Limits, crash_log: Path
) -> Iterator[tuple[int, Outcome]]:
    """The outcomes of ``one(0) ... one(count - 1)``, run in children, in order.

    The stack of a child that dies is written to ``crash_log``.
    """
    start = 0
    while start < count:
        crash_log.write_bytes(b"")
        child, pipe = _fork(range(start, count), one, limits, crash_log)
        death = ""
        try:
            for outcome in _reports(pipe, limits.wall):
                yield start, outcome
                start += 1
        except TimeoutError:
            death = "hang"
        finally:
            os.close(pipe)
            if start < count:
                with suppress(ProcessLookupError):
                    os.killpg(child, signal.SIGKILL)
            _, status = os.waitpid(child, 0)
        if start < count:
            yield start, _death(death, status, crash_log)
            start += 1


def _reports(pipe: int, patience: float) -> Iterator[Outcome]:
    """A child's reports until it ends; :class:`TimeoutError` after ``patience`` silent seconds."""
    text, deadline = b"", time.monotonic() + patience
    while True:
        ready, _, _ = select.select([pipe], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            raise TimeoutError
        data = os.read(pipe, 1 << 16)
        if not data:
            return
        *lines, text = (text + data).split(b"\n")
        for line in lines:
            deadline = time.monotonic() + patience
            yield Outcome(*json.loads(line))


def _fork(
    indices: range, one: Callable[[int], Outcome], limits: Limits, crash_log: Path
) -> tuple[int, int]:
    """(process, read end of its pipe) of a child that runs the indices."""
    reader, writer = os.pipe()
    child = os.fork()
    if child:
        os.close(writer)
        return child, reader
    try:
        os.setsid()
        _restrain(limits, crash_log)
        for index in indices:
            # CPU time, as the wall clock depends on other work of the machine.
            signal.setitimer(signal.ITIMER_PROF, limits.cpu)
            try:
                outcome = one(index)
            except Exception as error:  # the judge's own mistake
                outcome = Outcome("harness", repr(error)[:200], traceback.format_exc())
            signal.setitimer(signal.ITIMER_PROF, 0)
            _tell(writer, outcome)
    finally:
        os._exit(0)


def _tell(writer: int, outcome: Outcome) -> None:
    line = json.dumps([outcome.kind, outcome.signature, outcome.text]).encode() + b"\n"
    while line:
        line = line[os.write(writer, line) :]


def _restrain(limits: Limits, crash_log: Path) -> None:
    silence = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(silence, stream)
    stack = open(crash_log, "wb", buffering=0)
    faulthandler.enable(stack, all_threads=False)
    # Out of time: the stack is written, then the signal kills as it would.
    faulthandler.register(signal.SIGPROF, stack, all_threads=False, chain=True)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (limits.file, limits.file))
    if limits.memory is not None:
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        most = pages * resource.getpagesize() + limits.memory
        resource.setrlimit(resource.RLIMIT_AS, (most, most))


def _death(death: str, status: int, crash_log: Path) -> Outcome:
    stack = crash_log.read_text(errors="replace")
    place = _innermost(stack)
    if not death and os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGPROF:
        death = "time"
    if death:
        return Outcome(death, f"{death} {place}", stack[:2000])
    how = f"status {os.WEXITSTATUS(status)}"
    if os.WIFSIGNALED(status):
        how = signal.Signals(os.WTERMSIG(status)).name
    return Outcome("crash", f"{how} {place}", stack[:2000])


def _innermost(stack: str) -> str:
    """The project's innermost frame in what faulthandler wrote, innermost first."""
    for line in stack.splitlines():
        for package in ("/lfcore/", "/workflow/"):
            if package in line and "site-packages" not in line:
                file, _, rest = line.partition('", line ')
                function = rest.partition(" in ")[2]
                return f"in {package[1:]}{file.rpartition(package)[2]}:{function}"
    return "in the harness"

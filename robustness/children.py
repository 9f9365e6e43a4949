"""Inputs run in forked children, many per child, with limits of time and memory.

The parent imports all modules and then forks, so a child costs milliseconds.  A child reports each
finished input.  When a child dies, the input after the last report is at fault, and another child
continues after it.
"""

import faulthandler
import os
import resource
import signal
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

from robustness.outcome import Outcome

FORK = get_context("fork")


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


def run_all(
    count: int, judge: Callable[[int], Outcome], limits: Limits, crash_log: Path
) -> Iterator[tuple[int, Outcome]]:
    """Yield the outcomes of ``judge(0) ... judge(count - 1)``, run in children, in order.

    The stack of a child that dies is written to ``crash_log``.
    """
    start = 0
    while start < count:
        crash_log.write_bytes(b"")
        reports, tell = FORK.Pipe(duplex=False)
        arguments = range(start, count), judge, limits, crash_log, tell
        child = FORK.Process(target=_run, args=arguments, daemon=True)
        child.start()
        tell.close()
        hangs = False
        with reports, suppress(EOFError):
            while not (hangs := not reports.poll(limits.wall)):
                yield start, reports.recv()
                start += 1
        if start < count:
            with suppress(ProcessLookupError):
                os.killpg(child.pid or 0, signal.SIGKILL)
        child.join()
        if start < count:
            yield start, _death(hangs, child.exitcode or 0, crash_log)
            start += 1


def _run(
    indices: range,
    judge: Callable[[int], Outcome],
    limits: Limits,
    crash_log: Path,
    tell: Connection,
) -> None:
    """Run the inputs in a child, and report each."""
    os.setsid()
    _restrain(limits, crash_log)
    for index in indices:
        # CPU time, as the wall clock depends on the machine's load.
        signal.setitimer(signal.ITIMER_PROF, limits.cpu)
        try:
            outcome = judge(index)
        except Exception as error:  # a fault of the harness
            outcome = Outcome("harness", repr(error)[:200], traceback.format_exc())
        signal.setitimer(signal.ITIMER_PROF, 0)
        tell.send(outcome)
    os._exit(0)


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
        for package in ("/lfcore/", "/workflow/"):
            if package in line and "site-packages" not in line:
                file, _, rest = line.partition('", line ')
                function = rest.partition(" in ")[2]
                return f"in {package[1:]}{file.rpartition(package)[2]}:{function}"
    return "in the harness"

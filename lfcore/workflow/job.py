"""What all scripts share: where they write, and how they fail."""

from __future__ import annotations

import atexit
import io
import logging
import os
import resource
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from lfcore.errors import LfcoreError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

VARIABLE = "LFCORE_RUN"
"""Environment variable that tells a job its run: host, a colon, and the path of its lock."""


@contextmanager
def job(log: str, threads: int) -> Iterator[None]:
    """Send all output of this process to the rule's ``log``; a user's error is one line.

    The process ends with the block: nothing of a script comes after it.

    Also what libraries in C print goes to the log.  An :class:`LfcoreError`, and an OSError such
    as a full disk, end the process with status 1 after one line, in the log and on the terminal;
    any other exception is a mistake of ours, and its traceback is in the log.
    """
    terminal, begun = os.dup(2), time.monotonic()
    end_with_run()
    try:
        file = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(file, stream)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)
        logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
        # The drivers' thread pools, and those of numpy's libraries, keep to the job's share.
        os.environ["LFCORE_THREADS"] = str(threads)
        yield
        print(usage(time.monotonic() - begun))
        _end()
    except LfcoreError as error:
        _fail(terminal, str(error))
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        _fail(terminal, f"{place}{error.strerror or error}.")


def end_with_run() -> None:
    """In a job: end this process as soon as its run has died, wherever it is then."""
    host, _, path = os.environ.get(VARIABLE, "").partition(":")
    if fcntl is None or host != socket.gethostname():
        return
    threading.Thread(target=_outlive, args=(path,), daemon=True, name="end with run").start()


def _outlive(path: str) -> None:
    try:
        with open(path, "rb") as file:
            fcntl.flock(file, fcntl.LOCK_SH)  # granted when the run is no more
    except FileNotFoundError:
        pass
    except OSError:
        return  # no locks here, so nothing is known
    os._exit(1)


def usage(seconds: float) -> str:
    """What this process and its children took: the last line of a job's log, which
    benchmarks/job_costs.py reads."""
    parts = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    core = sum(part.ru_utime + part.ru_stime for part in parts)
    peak = max(part.ru_maxrss for part in parts) / 1024
    return f"took {seconds:.1f} s, {core:.1f} core s, {peak:.0f} MiB"


def _end() -> None:
    """End this process well, and at once: to take its modules and drivers apart, which serves
    nobody, takes 0.05 s of a core, and 0.25 s where figures were drawn."""
    atexit._run_exitfuncs()
    sys.stdout.flush()
    os._exit(0)


def _fail(terminal: int, message: str) -> None:
    """End this process; a disk that is full takes no line of the log, nor what is buffered."""
    for stream in {1, terminal}:
        with suppress(OSError):
            os.write(stream, f"{message}\n".encode())
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    os._exit(1)


def log_progress(what: str, *, every_seconds: float = 5.0) -> Callable[[int, int], None]:
    """A ``progress(done, total)`` that writes a line now and then, and one at the end."""
    last = time.monotonic()

    def progress(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if done == total or now - last >= every_seconds:
            last = now
            print(f"{what}: {done} of {total}")

    return progress

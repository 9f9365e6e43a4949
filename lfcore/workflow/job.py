"""The frame of all scripts: their log, and their failures."""

import ctypes
import io
import logging
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any

from lfcore.errors import LfcoreError

PR_SET_PDEATHSIG = 1
"""Linux's option of prctl: the signal when the parent ends."""
RUN = "LFCORE_RUN"
"""The environment variable with the process number of the run's Snakemake."""


@contextmanager
def job(snakemake: Any) -> Iterator[tuple[Any, Any, Any]]:
    """Send all output of this process, of C libraries, too, to the rule's log; yield the rule's
    input, params and output.

    An :class:`LfcoreError`, or an OSError such as a full disk, ends the process with status 1 after
    one line, in the log and on the terminal.  Any other exception is a bug, and its traceback is in
    the log.
    """
    terminal = os.dup(2)
    end_with_run()
    try:
        file = os.open(snakemake.log[0], os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        for stream in (1, 2):
            os.dup2(file, stream)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)
        logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
        # The thread pools of drivers and of numpy's libraries have the job's number of threads.
        os.environ["LFCORE_THREADS"] = str(snakemake.threads)
        yield snakemake.input, snakemake.params, snakemake.output
    except LfcoreError as error:
        _fail(terminal, str(error))
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        _fail(terminal, f"{place}{error.strerror or error}.")


def end_with_run() -> None:
    """On Linux, let the kernel kill this process when its Snakemake is killed."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        try:
            os.kill(int(os.environ.get(RUN, os.getppid())), 0)
        except ProcessLookupError:  # killed before the prctl
            os.kill(os.getpid(), signal.SIGKILL)


def _fail(terminal: int, message: str) -> None:
    """End this process with status 1, also if a full disk cannot store the log."""
    for stream in {1, terminal}:
        with suppress(OSError):
            os.write(stream, f"{message}\n".encode())
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    os._exit(1)

"""What all scripts share: where they write, and how they fail."""

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
RUN = "LFCORE_RUN"
"""The environment variable with the process number of the run's Snakemake."""


@contextmanager
def job(snakemake: Any) -> Iterator[tuple[Any, Any, Any]]:
    """Send all output of this process to the rule's log; a user's error is one line.  Gives the
    rule's input, params and output.

    Also what libraries in C print goes to the log.  An :class:`LfcoreError`, and an OSError such
    as a full disk, end the process with status 1 after one line, in the log and on the terminal;
    any other exception is a mistake of ours, and its traceback is in the log.
    """
    terminal = os.dup(2)
    end_with_run()
    try:
        file = os.open(snakemake.log[0], os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for stream in (1, 2):
            os.dup2(file, stream)
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(line_buffering=True)
        logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
        # The drivers' thread pools, and those of numpy's libraries, keep to the job's share.
        os.environ["LFCORE_THREADS"] = str(snakemake.threads)
        yield snakemake.input, snakemake.params, snakemake.output
    except LfcoreError as error:
        _fail(terminal, str(error))
    except OSError as error:
        place = f"{error.filename}: " if error.filename else ""
        _fail(terminal, f"{place}{error.strerror or error}.")


def end_with_run() -> None:
    """On Linux: end this process as soon as the Snakemake that has started it is killed."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        try:
            os.kill(int(os.environ.get(RUN, os.getppid())), 0)
        except ProcessLookupError:  # killed while this process began
            os.kill(os.getpid(), signal.SIGKILL)


def _fail(terminal: int, message: str) -> None:
    """End this process with status 1; a full disk takes neither the log's line nor its buffer."""
    for stream in {1, terminal}:
        with suppress(OSError):
            os.write(stream, f"{message}\n".encode())
    with suppress(OSError, ValueError):
        sys.stdout.flush()
    os._exit(1)

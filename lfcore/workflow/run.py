"""Start Snakemake so that nothing is left to be done by hand after a kill.

    python -m lfcore.workflow.run --cores 2 -- results/tables/

Every run holds a lock file of its own in ``.snakemake/runs/``, which the system frees with the
process, however that ends.  So whoever starts next knows what is alive:

- another run that is alive is waited for;
- a run that was killed leaves jobs behind, which go on writing: each job waits for its run's
  lock, gets it when the run has died, and ends at once
  (:func:`lfcore.workflow.job.end_with_run`);
- Snakemake's own lock is a list of files, which a kill leaves behind: it is removed when no run
  is alive.

A bare ``snakemake`` holds such a lock, too (``onstart`` in the Snakefile), but cannot remove what
a killed run left: Snakemake refuses before that, and says ``--unlock``.
"""

from __future__ import annotations

import itertools
import logging
import os
import shutil
import socket
import sys
import time
import uuid
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any

from lfcore.errors import LfcoreError
from lfcore.workflow.cluster import check_folder
from lfcore.workflow.job import VARIABLE

try:
    import fcntl
except ImportError:  # Windows: Snakemake's own lock, and --unlock by hand
    fcntl = None  # type: ignore[assignment]

DEFAULT_LIMIT = 100, 1
"""Jobs, and in how many seconds: Snakemake's, of ``--max-jobs-per-timespan``."""
QUIET = "LFCORE_QUIET"
"""Environment variable that is set where Snakemake's words are left to its log file."""


def hold(folder: str | Path = ".") -> int | None:
    """Lock a new file below ``folder``; jobs of this process will end with it.

    Returns the descriptor that holds the lock, which must stay open; None where the process holds
    one already, or the file system has no locks.
    """
    if VARIABLE in os.environ or fcntl is None:
        return None
    path = Path(folder).resolve() / ".snakemake" / "runs" / f"{os.getpid()}.{uuid.uuid4().hex[:8]}"
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        path.unlink()
        return None
    os.environ[VARIABLE] = f"{socket.gethostname()}:{path}"
    return descriptor


def wait_for_others(folder: str | Path = ".") -> None:
    """Wait until no run of ``folder`` and no job of one is alive; forget those that are not."""
    for path in sorted((Path(folder) / ".snakemake" / "runs").glob("*")):
        told = False
        with path.open("rb+") as file:
            while not _taken(file):
                if not told:
                    number = path.name.split(".")[0]
                    print(f"Waiting for the run of process {number} in this folder to end.")
                    told = True
                time.sleep(0.2)
            # Within the lock: a job of that run that begins only now finds no file, and ends.
            path.unlink(missing_ok=True)


def _taken(file: IO[bytes]) -> bool:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def schedule_when_jobs_end(workflow: Any) -> None:
    """Have Snakemake look for jobs to start when one ends, and not ever more often besides.

    By default it starts at most 100 jobs a second, and with any such limit each job that has ended
    adds one more look at the files of all jobs that are ready, every second until the run is over
    (Snakemake 9.27, ``JobScheduler.schedule``): a quarter of a core after 80 jobs.  A limit that
    was asked for stays.
    """
    limit = workflow.scheduling_settings.max_jobs_per_timespan
    if limit is not None and (limit.max_jobs, limit.timespan) == DEFAULT_LIMIT:
        workflow.scheduler.job_rate_limiter = None


def say_why_groups_fail(group_job: type, logger: logging.Logger) -> None:
    """Have Snakemake say what its executor says of a group that failed: what SLURM refused and why,
    which state a submission ended in.

    It says so of single jobs alone (Snakemake 9.27, ``GroupJob.log_error``).
    """
    log_error = group_job.log_error  # type: ignore[attr-defined]

    def with_reason(group: Any, msg: str | None = None, **more: Any) -> None:
        if msg:  # without SLURM's plugin's command, which is long
            logger.error(" ".join(msg.partition("sbatch call:")[0].split()))
        log_error(group, msg, **more)

    group_job.log_error = with_reason  # type: ignore[attr-defined]


def check_files(arguments: Sequence[str]) -> None:
    """Read the configurations that Snakemake will read, which itself dies of depth.

    Raises :class:`LfcoreError` for what is no YAML, contains itself, or is too large or deep.
    """
    from lfcore.scene.reading import read_yaml

    for option, word in _of_options(arguments):
        if option in ("--configfile", "--configfiles"):
            read_yaml(Path(word), "configuration")


def folder_of(arguments: Sequence[str]) -> Path:
    """The run's folder: what ``--directory`` says, else the working folder."""
    given = (word for name, word in _of_options(arguments) if name in ("--directory", "-d"))
    return Path(next(given, ""))


def _of_options(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """The values on a command line, each with its option; what follows ``--`` is of none."""
    option = ""
    for word in itertools.takewhile(lambda word: word != "--", arguments):
        if word.startswith("-"):
            option, _, word = word.partition("=")
        if word:
            yield option, word


OWN_WORDS = {
    "-n", "--dry-run", "--dryrun", "--verbose", "-q", "--quiet", "-p", "--printshellcmds",
}  # fmt: skip
"""Who asks for these wants Snakemake's own words on the terminal, or none."""


def main(arguments: list[str]) -> None:
    """Become Snakemake with these arguments; its own words go to its log file alone."""
    try:
        check_files(arguments)
        check_folder(folder_of(arguments))
    except LfcoreError as error:
        sys.exit(str(error))
    if fcntl is not None:
        folder = folder_of(arguments)
        wait_for_others(folder)
        if (descriptor := hold(folder)) is not None:
            os.set_inheritable(descriptor, True)
            shutil.rmtree(folder / ".snakemake" / "locks", ignore_errors=True)
    if not OWN_WORDS.intersection(word.partition("=")[0] for word in arguments):
        os.environ[QUIET] = "1"
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-m", "snakemake", *arguments])


if __name__ == "__main__":
    main(sys.argv[1:])

"""Snakemake in processes that have it imported already, but nothing of this project."""

import os
import sys
from multiprocessing import get_context
from pathlib import Path

PROCESSES = get_context("forkserver")
PROCESSES.set_forkserver_preload(["snakemake.cli", "pandas", "kubernetes.config"])


def run_snakemake(folder: Path, words: tuple, environment: dict[str, str], said: Path) -> None:
    """As ``python -m snakemake`` in ``folder``; what it says goes to the file ``said``."""
    from snakemake.cli import main

    with said.open("wb") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    os.chdir(folder)
    os.environ.update(environment)
    sys.path[:0] = [str(folder), environment.get("PYTHONPATH", "")]
    assert "lfcore" not in sys.modules  # that of the folder is to be imported
    main(list(words))

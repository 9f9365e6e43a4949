"""A copy of the project that tests may edit, and Snakemake in it."""

import re
import subprocess
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from forked_snakemake import PROCESSES, run_snakemake

from tests.robustness.kills import copy_project


@dataclass
class Checkout:
    """A copy of the project in ``folder``."""

    folder: Path
    scripts: set[str] = field(default_factory=set)

    def snakemake(self, *arguments, timeout=420, **environment) -> subprocess.CompletedProcess:
        """Run Snakemake there; ``stdout`` holds its output and errors."""
        said = self.folder.with_name(f"{self.folder.name}-said")
        given = (self.folder, arguments, environment, said)
        process = PROCESSES.Process(target=run_snakemake, args=given)
        process.start()
        process.join(timeout)
        if process.exitcode is None:
            process.kill()
        return subprocess.CompletedProcess(arguments, process.exitcode, said.read_text())

    def planned(self, *arguments) -> dict[str, int]:
        """Jobs of a dry run by rule; empty when there is nothing to be done."""
        return self.made("--dry-run", "--quiet", "reason", *arguments)

    def made(self, *arguments) -> dict[str, int]:
        """Jobs of a run on two cores, which must not fail, by rule."""
        done = self.snakemake("--cores", "2", *arguments)
        assert done.returncode == 0, done.stdout[-4000:]
        if "Nothing to be done" in done.stdout:
            return {}
        table = done.stdout.split("Job stats:")[1].split("\n\n")[0]
        jobs = dict(re.findall(r"^(\S+) +(\d+)$", table, re.MULTILINE))
        return {rule: int(count) for rule, count in jobs.items() if rule != "total"}


def checkout_in(folder: Path) -> Checkout:
    copy_project(folder)
    return Checkout(folder)


@pytest.fixture(scope="session")
def checkout(tmp_path_factory) -> Checkout:
    """A copy for dry runs: nothing is ever made in it."""
    return checkout_in(tmp_path_factory.mktemp("checkout"))


@pytest.fixture(scope="module")
def project_copy(tmp_path_factory):
    """A function that makes a copy of one's own, to run and edit."""
    return lambda name: checkout_in(tmp_path_factory.mktemp(name))

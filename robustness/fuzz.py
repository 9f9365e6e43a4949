"""``python -m robustness.fuzz``: hostile inputs for a time, and a table of their outcomes.

Hypothesis draws and shrinks the inputs; children judge them, as an input may crash or hang.
"""

import argparse
import hashlib
import os
import re
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import hypothesis
import pandas as pd
from hypothesis.errors import Flaky

from robustness.children import Children
from robustness.outcome import OK, REFUSED, Outcome
from robustness.targets import Target, all_targets, seeds_folder

CORPUS = Path(__file__).with_name("corpus")
MEMORY_DISK = Path("/dev/shm")
"""The system's folder in memory, if there is one: children write thousands of small files."""
EXAMPLES = 100
"""The inputs of a target, then another has its turn."""
SLOW = ("hang", "time")
"""The kinds of findings that are not shrunk, which would take minutes."""


class FoundError(Exception):
    """A finding, for hypothesis, which shrinks the input."""


def kept(target: str) -> list[Path]:
    return sorted(path for path in (CORPUS / _slug(target)).glob("*") if path.is_file())


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


class Bench:
    """A target with its seeds, children, and outcomes.

    ``findings`` maps signatures to (outcome, smallest input).
    """

    def __init__(self, target: Target, home: Path):
        self.target, self.counts, self.seconds = target, Counter[str](), 0.0
        self.findings: dict[str, tuple[Outcome, bytes]] = {}
        work = home / _slug(target.name) / "work"
        seeds = seeds_folder(work)
        seeds.mkdir(parents=True)
        work.mkdir()
        self.seeds = target.seeds(seeds)
        self.inputs = target.inputs(self.seeds)
        target.sides(work)
        judge = lambda data: target.judge(data, work)  # noqa: E731
        self.children = Children(judge, target.limits, work.with_name("stack.txt"))

    def judge(self, data: bytes) -> Outcome:
        outcome = self.children.judge(data)
        self.counts[outcome.kind if outcome.kind in (OK, REFUSED) else "finding"] += 1
        if outcome.is_finding:
            self._add(outcome, data)
        return outcome

    def _add(self, outcome: Outcome, data: bytes) -> None:
        known = self.findings.setdefault(outcome.signature, (outcome, data))
        self.findings[outcome.signature] = min(
            known, (outcome, data), key=lambda pair: len(pair[1])
        )

    def replay(self) -> None:
        """Judge the corpus and the seeds."""
        for path in kept(self.target.name):
            self.judge(path.read_bytes())
        for data in self.seeds:
            outcome = self.judge(data)
            if self.target.takes_seeds and outcome.kind == REFUSED:
                self._add(Outcome("seed refused", outcome.text[:80], outcome.text), data)

    def explore(self, seed: int, count: int) -> None:
        """Judge new inputs; shrink the first finding."""
        before = time.monotonic()

        def check(data: bytes) -> None:
            outcome = self.judge(data)
            if outcome.is_finding and outcome.kind not in SLOW:
                raise FoundError(outcome.signature)

        settings = hypothesis.settings(
            max_examples=count, database=None, deadline=None, report_multiple_bugs=False,
            suppress_health_check=list(hypothesis.HealthCheck),
        )  # fmt: skip
        try:
            hypothesis.seed(seed)(settings(hypothesis.given(self.inputs)(check)))()
        except (FoundError, Flaky):
            pass  # it is among the findings
        self.seconds += time.monotonic() - before

    def keep(self) -> list[Path]:
        """Write the smallest input of each finding to the corpus, under the finding's name."""
        files: list[Path] = []
        for signature, (outcome, data) in self.findings.items() if self.target.portable else ():
            folder = CORPUS / _slug(self.target.name)
            folder.mkdir(parents=True, exist_ok=True)
            digest = hashlib.sha256(data).hexdigest()[:8]
            files.append(folder / f"{_slug(f'{outcome.kind} {signature}')[:60]}-{digest}")
            files[-1].write_bytes(data)
        return files


def fuzz(benches: Sequence[Bench], *, seed: int, seconds: float, each: int = 0) -> None:
    """Judge corpus and seeds, ``each`` new inputs per target, and more until the time is over.

    Each target has the same time; one with a finding draws no more.
    """
    for bench in benches:
        bench.replay()
        if each:
            bench.explore(seed, each)
    end = time.monotonic() + seconds
    while time.monotonic() < end and (waiting := [b for b in benches if not b.findings]):
        seed += 1
        min(waiting, key=lambda bench: bench.seconds).explore(seed, EXAMPLES)


def table(benches: Sequence[Bench]) -> pd.DataFrame:
    """Return the inputs and outcomes of each target, and of all."""
    rows = pd.DataFrame({bench.target.name: bench.counts for bench in benches}).T
    rows = rows.reindex(columns=[OK, REFUSED, "finding"]).fillna(0).astype(int)
    rows.loc["all"] = rows.sum()
    rows.insert(0, "inputs", rows.sum(axis=1))
    return rows


def report(benches: Sequence[Bench]) -> str:
    """Return the text of a report: each finding with its smallest input."""
    lines = []
    for bench in benches:
        for signature, (outcome, data) in bench.findings.items():
            lines.append(f"{bench.target.name}: {outcome.kind}: {signature}")
            lines.append(f"  input of {len(data)} bytes: {data[:200]!r}")
            lines += [f"  {line}" for line in outcome.text.splitlines()[-8:]]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser("robustness.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60, help="seconds of random inputs (60)")
    parser.add_argument("--each", type=int, default=0, help="at least this many per target (0)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random numbers (1)")
    parser.add_argument("--target", action="append", help="only this target; may be repeated")
    parser.add_argument("--keep", action="store_true", help="write findings to the corpus")
    arguments = parser.parse_args(argv)
    known = all_targets()
    wanted = arguments.target or known
    for name in set(wanted) - set(known):
        parser.error(f"no target {name!r}; there are {', '.join(known)}")
    disk = MEMORY_DISK if os.access(MEMORY_DISK, os.W_OK) else None
    with (
        tempfile.TemporaryDirectory("lfcore-fuzz", dir=disk, ignore_cleanup_errors=True) as home,
        ExitStack() as stack,
    ):
        benches = [Bench(known[name], Path(home)) for name in known if name in wanted]
        for bench in benches:
            stack.enter_context(bench.children)
        fuzz(benches, seed=arguments.seed, seconds=arguments.seconds, each=arguments.each)
        print(table(benches).to_markdown(), flush=True)
        print(report(benches), end="", flush=True)
        if arguments.keep:
            print(*(f"kept {file}" for bench in benches for file in bench.keep()), sep="\n")
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"largest child: {peak:,.0f} MiB; seed {arguments.seed}")
    return int(any(bench.findings for bench in benches))


if __name__ == "__main__":
    sys.exit(main())

"""``python -m robustness.fuzz``: hostile inputs for a time, and a table of their outcomes."""

import argparse
import hashlib
import math
import os
import re
import resource
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from robustness.children import run_all
from robustness.outcome import OK, REFUSED, Outcome
from robustness.targets import Target, all_targets, seeds_folder

CORPUS = Path(__file__).with_name("corpus")


def kept(target: str) -> list[Path]:
    folder = CORPUS / _slug(target)
    return sorted(path for path in folder.glob("*") if path.is_file()) if folder.is_dir() else []


def keep(target: str, data: bytes, signature: str) -> Path:
    """Write an input to the corpus, under the name of its finding."""
    folder = CORPUS / _slug(target)
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(data).hexdigest()[:8]
    path = folder / f"{_slug(signature)[:60]}-{digest}"
    path.write_bytes(data)
    return path


def _slug(text: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def smaller(data: bytes, judge: Callable[[bytes], Outcome], signature: str, tries: int) -> bytes:
    """Shorten an input: we leave out pieces as long as the finding stays the same.

    Delta debugging without its complements: Zeller, Hildebrandt, "Simplifying and Isolating
    Failure-Inducing Input", IEEE TSE 2002.
    """
    size = len(data) // 2
    while size >= 1 and tries > 0:
        at = 0
        while at < len(data) and tries > 0:
            shorter = data[:at] + data[at + size :]
            tries -= 1
            if judge(shorter).signature == signature:
                data = shorter
            else:
                at += size
        size //= 2
    return data


MINIMISE_TRIES = 120
"""The most runs to shorten an input."""
MEMORY_DISK = Path("/dev/shm")
"""The system's folder in memory, if there is one: children write thousands of small files."""


@dataclass
class Tally:
    """The outcomes of a target's inputs; ``findings`` maps signature to [outcome, input, count]."""

    counts: Counter = field(default_factory=Counter)
    findings: dict[str, list] = field(default_factory=dict)
    seconds: float = 0.0

    def add(self, outcome: Outcome, data: bytes) -> None:
        self.counts[outcome.kind if outcome.kind in (OK, REFUSED) else "finding"] += 1
        if outcome.is_finding:
            known = self.findings.setdefault(outcome.signature, [outcome, data, 0])
            known[2] += 1
            if len(data) < len(known[1]):
                known[:2] = outcome, data


class Bench:
    """A target with its seeds and the working folder of its children."""

    def __init__(self, target: Target, home: Path):
        self.target, self.tally, self.done = target, Tally(), 0
        self.folder = home / target.name.replace(" ", "-")
        self.work = self.folder / "work"
        seeds = seeds_folder(self.work)
        seeds.mkdir(parents=True)
        self.work.mkdir()
        self.crash_log = self.folder / "stack.txt"
        self.seeds = target.seeds(seeds)
        target.sides(self.work)

    def run(self, inputs: Sequence[bytes]) -> list[Outcome]:
        def judge(index: int) -> Outcome:
            return self.target.judge(inputs[index], self.work)

        outcomes = run_all(len(inputs), judge, self.target.limits, self.crash_log)
        return [outcome for _, outcome in outcomes]

    def batch(self, seed: int, count: int | None = None) -> None:
        before = time.monotonic()
        count = count or self.target.batch
        indices = range(self.done, self.done + count)
        inputs = [self.target.input(seed, index, self.seeds) for index in indices]
        self.account(inputs)
        self.done += count
        self.tally.seconds += time.monotonic() - before

    def account(self, inputs: Sequence[bytes], *, are_seeds: bool = False) -> None:
        for data, outcome in zip(inputs, self.run(inputs), strict=True):
            if are_seeds and outcome.kind == REFUSED:
                outcome = Outcome("seed refused", outcome.text[:80], outcome.text)
            self.tally.add(outcome, data)

    def replay(self) -> None:
        self.account([path.read_bytes() for path in kept(self.target.name)])
        self.account(self.seeds, are_seeds=self.target.takes_seeds)

    def keep(self) -> list[Path]:
        """Write one input per finding to the corpus, shortened."""
        files: list[Path] = []
        if not self.target.portable:
            return files
        for signature, (outcome, data, _) in self.tally.findings.items():
            tries = 0 if outcome.kind in ("hang", "time") else MINIMISE_TRIES
            data = smaller(data, lambda d: self.run([d])[0], signature, tries)
            files.append(keep(self.target.name, data, f"{outcome.kind} {signature}"))
        return files


def fuzz(
    targets: Sequence[Target], home: Path, *, seed: int, seconds: float, most: int, each: int = 0
) -> list[Bench]:
    """Run corpus, seeds and random inputs; return the benches of all targets.

    Every target runs ``each`` inputs, then more until ``seconds`` have passed or ``most`` inputs
    were run; each target has its share of the time.
    """
    benches = [Bench(target, home) for target in targets]
    for bench in benches:
        bench.replay()
        if each:
            bench.batch(seed, each)
    end = time.monotonic() + seconds
    while time.monotonic() < end and sum(bench.tally.counts.total() for bench in benches) < most:
        min(benches, key=lambda bench: bench.tally.seconds / bench.target.weight).batch(seed)
    return benches


def table(benches: Sequence[Bench]) -> pd.DataFrame:
    """Return inputs, outcomes and inputs per second of each target, and of all."""
    tallies = {bench.target.name: bench.tally for bench in benches}
    rows = pd.DataFrame(
        {name: {**tally.counts, "seconds": tally.seconds} for name, tally in tallies.items()}
    ).T.reindex(columns=[OK, REFUSED, "finding", "seconds"], fill_value=0).fillna(0)  # fmt: skip
    rows.loc["all"] = rows.sum()
    counts = rows[[OK, REFUSED, "finding"]].astype(int)
    rate = counts.sum(axis=1) / rows.seconds.replace(0, math.inf)
    counts.insert(0, "inputs", counts.sum(axis=1))
    return counts.assign(**{"inputs/s": rate.round().astype(int)})


def report(benches: Sequence[Bench]) -> str:
    """Return the text of a report: each finding once, with its count."""
    lines = []
    for bench in benches:
        for signature, (outcome, data, count) in bench.tally.findings.items():
            head = f"{bench.target.name}: {outcome.kind}, {count} times: {signature}"
            lines += [head, f"  input of {len(data)} bytes: {data[:200]!r}"]
            lines += [f"  {line}" for line in outcome.text.splitlines()[-8:]]
    return "\n".join(lines)


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser("robustness.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60, help="seconds of random inputs (60)")
    parser.add_argument(
        "--each", type=int, default=0, help="at least this many inputs per target (0)"
    )
    parser.add_argument("--inputs", type=int, default=1 << 62, help="at most this many inputs")
    parser.add_argument("--seed", type=int, default=1, help="seed of the random numbers (1)")
    parser.add_argument("--target", action="append", help="only this target; may be repeated")
    parser.add_argument("--keep", action="store_true", help="write findings to the corpus")
    arguments = parser.parse_args(argv)
    known = all_targets()
    wanted = arguments.target or known
    for name in set(wanted) - set(known):
        parser.error(f"no target {name!r}; there are {', '.join(known)}")
    chosen = [target for name, target in known.items() if name in wanted]
    disk = MEMORY_DISK if os.access(MEMORY_DISK, os.W_OK) else None
    with tempfile.TemporaryDirectory("lfcore-fuzz", dir=disk, ignore_cleanup_errors=True) as name:
        benches = fuzz(
            chosen, Path(name), seed=arguments.seed, seconds=arguments.seconds,
            most=arguments.inputs, each=arguments.each,
        )  # fmt: skip
        print(table(benches).to_markdown(), flush=True)
        if findings := report(benches):
            print(findings, flush=True)
        if arguments.keep:
            for bench in benches:
                for file in bench.keep():
                    print(f"kept {file}")
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    print(f"largest child: {peak:,.0f} MiB; seed {arguments.seed}")
    return int(any(bench.tally.findings for bench in benches))


if __name__ == "__main__":
    sys.exit(main())

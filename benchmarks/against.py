"""The tracer against another commit of itself, in turn: which is faster, and by how much.

    python -m benchmarks.against b916407 --out against.csv
    python -m benchmarks.against HEAD~1 --views 16 --scenes bike --work hits --out hits.csv

Each program runs in a process of its own bound to one core, on the same rays; the one that begins
changes from round to round.  Seconds are of the processor, with the host's part, and means of the
best quarter of the rounds.  Columns ``N = ...`` are speeds: seconds of the other commit over those
of this tree.  ``--devices intel pocl`` runs the other on one OpenCL device and this tree on a
second: with HEAD, driver against driver.  ``--work``: ``hits`` or ``radiance`` of 64 squares,
``frames`` with five planes of 16 tiles, spread over the picture, or whole ``views`` with depth.
``CL_CONFIG_CPU_TARGET_ARCH=core-avx2`` holds Intel's runtime to that instruction set.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measured.rows import parser_of, report, say
from lfcore.errors import LfcoreError

ROOT = Path(__file__).resolve().parents[1]
WORKER = ROOT / "benchmarks" / "measured" / "against_worker.py"
WORK = ("frames", "hits", "radiance", "views")


class Program:
    """The tracer of a checkout, in a process bound to ``core``.

    Programs are kept in ``cache``: old commits took those of one instruction set for another's.
    """

    def __init__(self, root: Path, core: int, cache: Path, device: str = ""):
        environment = os.environ | {"XDG_CACHE_HOME": str(cache)}
        if device:
            environment["LFCORE_DEVICE"] = device
        self._process = subprocess.Popen(
            [sys.executable, str(WORKER), str(root)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
            preexec_fn=lambda: os.sched_setaffinity(0, {core}),
        )

    def ask(self, case: dict[str, Any]) -> float:
        """Seconds of the processor that one run of a case took."""
        assert self._process.stdin and self._process.stdout  # pipes, above
        print(json.dumps(case), file=self._process.stdin, flush=True)
        answer = self._process.stdout.readline()
        if not answer:
            raise LfcoreError(f"the program under test ended at {case}")
        return float(json.loads(answer)["seconds"])

    def end(self) -> None:
        self._process.kill()
        self._process.wait()


def in_turn(programs: Sequence[Program], case: dict[str, Any], rounds: int) -> list[float]:
    """Seconds of each program, once both have run unseen."""
    taken: list[list[float]] = [[] for _ in programs]
    for program in programs:
        program.ask(case)
    for turn in range(rounds):
        order = range(len(programs)) if turn % 2 else reversed(range(len(programs)))
        for number in order:
            taken[number].append(programs[number].ask(case))
    return [float(np.mean(sorted(one)[: max(1, rounds // 4)])) for one in taken]


def rows(programs: Sequence[Program], options: argparse.Namespace) -> Iterator[dict[str, Any]]:
    for work in options.work:
        for scene in options.scenes:
            row: dict[str, Any] = {"work": work, "scene": scene}
            for views in options.views:
                case = {"work": work, "scene": scene, "views": views, "pixels": options.pixels,
                        "mrays": options.mrays}  # fmt: skip
                before, now = in_turn(programs, case, options.rounds)
                row[f"N = {views}"] = f"{before / now:.2f}"
                say(f"{work}, {scene}, N = {views}: {before:.3f} s, {now:.3f} s now")
            yield row


@contextlib.contextmanager
def checkout(revision: str) -> Iterator[Path]:
    """A folder with another commit, for as long as it is needed."""
    with tempfile.TemporaryDirectory() as folder:
        there = Path(folder) / "tree"
        git = ["git", "-C", str(ROOT), "worktree"]
        made = subprocess.run(
            [*git, "add", "--quiet", "--detach", str(there), revision],
            capture_output=True, text=True,
        )  # fmt: skip
        if made.returncode:
            raise LfcoreError(f"git has no {revision!r}: {made.stderr.strip()}", key="revision")
        try:
            yield there
        finally:
            subprocess.run([*git, "remove", "--force", str(there)], check=True)


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = parser_of(__doc__, pixels=512)
    parser.add_argument("revision", help="of the program to compare with")
    parser.add_argument("--views", nargs="+", type=int, default=[4, 8, 16, 64, 512], help="N")
    parser.add_argument("--work", nargs="+", choices=WORK, default=list(WORK))
    parser.add_argument("--rounds", type=int, default=8)
    parser.add_argument("--mrays", type=float, default=16.0, help="million rays of a case")
    parser.add_argument("--devices", nargs=2, default=["", ""], metavar="NAME",
                        help="of the other and of this tree")  # fmt: skip
    parser.add_argument("--core", type=int, default=max(os.sched_getaffinity(0)))
    options = parser.parse_args(arguments)
    if options.rounds < 1:
        parser.error("--rounds must be at least 1")
    return options


def main() -> None:
    options = parse()
    with checkout(options.revision) as other:
        cache = other.parent / "cache"
        cache.mkdir()
        programs = [
            Program(root, options.core, cache, device)
            for root, device in zip((other, ROOT), options.devices, strict=True)
        ]
        try:
            found = list(rows(programs, options))
        finally:
            for program in programs:
                program.end()
    report(options.out, "python -m benchmarks.against", found)


if __name__ == "__main__":
    main()

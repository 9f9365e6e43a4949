"""``python -m robustness.faults``: kills, full disks, missing folders, with a table of each."""

import argparse
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import pandas as pd

from robustness import disks, kills
from robustness.outcome import LONGEST_MESSAGE, OK, REFUSED, ROOT, Outcome

SIZE = ("--pixels", "16", "--views", "2")
"""The options of a small picture."""


@dataclass(frozen=True)
class Surrounding:
    """The environment of a command.

    Attributes
    ----------
    name : str
        A description.
    works : bool
        Whether the command must write the undisturbed picture; else it must fail with status 1 and
        one line.
    environment : dict
        Changed variables; None removes one.
    output : str
        The picture's path.
    redirect : str
        A redirection of the shell.
    """

    name: str
    works: bool = True
    environment: dict = field(default_factory=dict)
    output: str = "p.ppm"
    redirect: str = ""


def surroundings(folder: Path) -> list[Surrounding]:
    """Return all surroundings, with files below a writable ``folder``."""
    plain, empty = folder / "plain-file", folder / "empty-cache"
    plain.write_text("")
    empty.mkdir(exist_ok=True)
    return [
        Surrounding("home is /dev/null", environment={"HOME": "/dev/null"}),
        Surrounding("home does not exist", environment={"HOME": "/nowhere/at/all"}),
        Surrounding("home cannot be written", environment={"HOME": "/proc"}),
        Surrounding("no home is named", environment={"HOME": None}),
        Surrounding("cache is empty", environment={"XDG_CACHE_HOME": str(empty)}),
        Surrounding("cache is a file", environment={"XDG_CACHE_HOME": str(plain)}),
        Surrounding("cache cannot be written", environment={"XDG_CACHE_HOME": "/proc/sys"}),
        Surrounding(
            "no home, no cache, no temporary folder",
            environment={"HOME": "/dev/null", "XDG_CACHE_HOME": "/proc", "TMPDIR": "/nowhere"},
        ),
        Surrounding("ASCII terminal", environment={"LC_ALL": "C", "PYTHONIOENCODING": "ascii"}),
        Surrounding("standard input is closed", redirect="<&-"),
        Surrounding("standard output is closed", redirect=">&-"),
        Surrounding("standard error is closed", redirect="2>&-"),
        Surrounding("standard output is full", redirect=">/dev/full"),
        Surrounding("the output's folder is new", output="new/folder/p.ppm"),
        Surrounding("the output is a folder", works=False, output="."),
        Surrounding("the output is below a file", works=False, output="plain-file/p.ppm"),
        Surrounding("the output cannot be written", works=False, output="/proc/p.ppm"),
        Surrounding("threads: abc", works=False, environment={"LFCORE_THREADS": "abc"}),
        Surrounding("threads: -1", works=False, environment={"LFCORE_THREADS": "-1"}),
        Surrounding("an unknown device", works=False, environment={"LFCORE_DEVICE": "no such"}),
    ]


def try_all(folder: Path, only: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """Yield (name, problem or empty) per surrounding, or of ``only`` some names."""
    folder.mkdir(parents=True, exist_ok=True)
    undisturbed = _render(Surrounding("undisturbed"), folder)
    right = (folder / "p.ppm").read_bytes()
    if undisturbed.returncode:
        raise RuntimeError(f"fails undisturbed: {undisturbed.stderr}")
    for surrounding in surroundings(folder):
        if only and surrounding.name not in only:
            continue
        picture = folder / surrounding.output
        if picture.is_file():
            picture.unlink()
        done = _render(surrounding, folder)
        output = done.stderr.decode(errors="replace") + done.stdout.decode(errors="replace")
        yield surrounding.name, _problem(surrounding, done.returncode, output, picture, right)


def _problem(
    surrounding: Surrounding, status: int, output: str, picture: Path, right: bytes
) -> str:
    if "Traceback" in output:
        return f"a traceback: {output[-800:]}"
    if status != (0 if surrounding.works else 1):
        return f"status {status}: {output[-400:]}"
    if surrounding.works:
        return "" if picture.read_bytes() == right else "another picture"
    line = output.strip().rpartition("\n")[2]
    return "" if 0 < len(line) <= LONGEST_MESSAGE else f"no message: {output[-400:]}"


def _render(surrounding: Surrounding, folder: Path) -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | surrounding.environment
    command = [sys.executable, "-m", "lfcore", "render", str(ROOT / "scenes/sphere")]
    command += ["-o", surrounding.output, *SIZE]
    if surrounding.redirect:
        command = ["sh", "-c", f'exec "$@" {surrounding.redirect}', "sh", *command]
    return subprocess.run(
        command,
        cwd=folder,
        env={name: value for name, value in environment.items() if value is not None},
        capture_output=True,
        timeout=600,
    )


WORKFLOW_PAGES = (1, 300, 480, 530)
"""The pages of disks without room for anything, for a scene, its hierarchy, and a light field."""
Findings = list[str]
"""Descriptions of what went wrong."""


def kill_all(home: Path, count: int) -> tuple[pd.DataFrame, Findings]:
    """Kill ``count`` runs; return a row per job and way, and one for all."""
    killed = [kills.Killed(job, home / job.name) for job in kills.jobs()]
    tallies = {(run.job.name, way): kills.Tally() for run in killed for way in run.job.ways}
    draw, done = Random(1), 0
    while done < count:
        run = killed[done % len(killed)]
        way = draw.choice(run.job.ways)
        run.disturb(draw, way, tallies[run.job.name, way])
        done = sum(tally.kills for tally in tallies.values())
        print(f"{done} of {count} kills", file=sys.stderr)
    table = pd.DataFrame([
        {"run": name, "ended by": way, "kills": tally.kills, "went on by itself": tally.went_on,
         "identical": tally.identical, "slowest end": f"{tally.slowest:.1f} s",
         "findings": len(tally.findings)}
        for (name, way), tally in tallies.items()
    ])  # fmt: skip
    table.loc[len(table)] = table.sum(numeric_only=True).to_dict() | {"run": "all"}
    return table.fillna(""), [finding for tally in tallies.values() for finding in tally.findings]


def fill_all(home: Path) -> tuple[pd.DataFrame, Findings]:
    """Write each kind of file on disks from too small to large enough; then run the workflow."""
    home.mkdir(parents=True)
    if reason := disks.can_mount(home):
        return pd.DataFrame({"SKIPPED full disks: no file system can be mounted": [reason]}), []
    rows, findings = [], []

    def add(name: str, outcomes: list[tuple[int, Outcome]]) -> Counter:
        counts = Counter(outcome.kind for _, outcome in outcomes)
        wrong = [
            f"{name}, disk of {pages} pages: {outcome.kind} {outcome.signature}: {outcome.text}"
            for pages, outcome in outcomes
            if outcome.is_finding
        ]
        findings.extend(wrong)
        rows.append({"file": name, "disks": len(outcomes), "refused": counts[REFUSED],
                     "written": counts[OK], "findings": len(wrong)})  # fmt: skip
        return counts

    for writer in disks.writers(home):
        counts = add(writer.name, disks.fill(writer, home))
        if not counts[OK] or not counts[REFUSED]:
            findings.append(f"{writer.name}: the disks were all too small, or all large enough")
    (job,) = (job for job in kills.jobs() if job.name == "workflow")
    run = kills.Killed(job, home / "workflow")
    add("workflow, then more room", disks.fill_workflow(run, WORKFLOW_PAGES))
    return pd.DataFrame(rows), findings


def miss_all(home: Path) -> tuple[pd.DataFrame, Findings]:
    """Run with missing folders and closed streams."""
    results = list(try_all(home))
    table = pd.DataFrame(results, columns=["surrounding", "result"])
    table["result"] = ["wrong" if problem else "right" for _, problem in results]
    return table, [f"{name}: {problem}" for name, problem in results if problem]


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser("robustness.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=20, help="number of kills (20)")
    count, any_finding = parser.parse_args(argv).kills, False
    with tempfile.TemporaryDirectory(prefix="lfcore-faults-", ignore_cleanup_errors=True) as name:
        home = Path(name)
        for part in (
            lambda: fill_all(home / "disks"),
            lambda: miss_all(home / "folders"),
            lambda: kill_all(home, count),
        ):
            table, findings = part()
            any_finding |= bool(findings)
            print(table.to_markdown(index=False), "", sep="\n")
            print(*(f"FINDING {finding}" for finding in findings), sep="\n", flush=True)
    return int(any_finding)


if __name__ == "__main__":
    sys.exit(main())

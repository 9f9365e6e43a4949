"""``python -m robustness.faults``: kills, full disks, missing folders; a table of each."""

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from random import Random

from robustness import disks, folders, kills
from robustness.outcome import OK, REFUSED

# Too small for anything, for a scene, for its tree, for a store.
WORKFLOW_PAGES = (1, 300, 480, 530)


def kill_all(home: Path, count: int) -> str:
    """Kill ``count`` runs in all; (table, findings) as text."""
    killed = [kills.Killed(job, home / job.name) for job in kills.jobs()]
    tallies = {(one.job.name, way): kills.Tally() for one in killed for way in one.job.ways}
    draw, done = Random(1), 0
    while done < count:
        one = killed[done % len(killed)]
        way = draw.choice(one.job.ways)
        one.disturb(draw, way, tallies[one.job.name, way])
        done = sum(tally.kills for tally in tallies.values())
        print(f"{done} of {count} kills", file=sys.stderr)
    lines = [
        "| run | ended by | kills | went on by itself | identical | slowest end | findings |",
        "|---|---" + 5 * "|--:" + "|",
    ]
    for (name, way), tally in tallies.items():
        slowest = f"{tally.slowest:.1f} s" if tally.slowest else ""
        numbers = f"{tally.kills} | {tally.went_on} | {tally.identical} | {slowest}"
        lines.append(f"| {name} | {way} | {numbers} | {len(tally.findings)} |")
    keys = ("kills", "went_on", "identical")
    total = [sum(getattr(tally, key) for tally in tallies.values()) for key in keys]
    found = [finding for tally in tallies.values() for finding in tally.findings]
    lines.append(f"| all | | {total[0]} | {total[1]} | {total[2]} | | {len(found)} |")
    return _text(lines, found)


def _text(lines: list[str], findings: list[str]) -> str:
    return "\n".join([*lines, "", *(f"FINDING {finding}" for finding in findings)])


def fill_all(home: Path) -> str:
    """Each kind of file on disks from too small to large enough; as :func:`kill_all`."""
    home.mkdir(parents=True)
    if reason := disks.can_mount(home):
        return f"SKIPPED full disks: no file system can be mounted here ({reason})\n"
    lines = ["| file | disks | refused | written | findings |", "|---" + 4 * "|--:" + "|"]
    found = []
    for writer in disks.writers(home):
        outcomes = disks.fill(writer, home)
        counts = Counter(outcome.kind for _, outcome in outcomes)
        wrong = [
            f"{writer.name}, {pages} pages: {outcome.kind} {outcome.signature}: {outcome.text}"
            for pages, outcome in outcomes
            if outcome.is_finding
        ]
        found += wrong
        numbers = (len(outcomes), counts[REFUSED], counts[OK], len(wrong))
        lines.append(f"| {writer.name} | " + " | ".join(map(str, numbers)) + " |")
        if not counts[OK] or not counts[REFUSED]:
            found.append(f"{writer.name}: the disks were all too small, or all large enough")
    (job,) = (job for job in kills.jobs() if job.name == "workflow")
    outcomes = disks.fill_workflow(kills.Killed(job, home / "workflow"), WORKFLOW_PAGES)
    wrong = [f"{o.signature}, disk of {n} pages: {o.text}" for n, o in outcomes if o.is_finding]
    lines.append(
        f"| workflow, then more room | {len(outcomes)} | {len(outcomes)} | | {len(wrong)} |"
    )
    return _text(lines, found + wrong)


def miss_all(home: Path) -> str:
    """Missing folders and closed streams; as :func:`kill_all`."""
    results = list(folders.try_all(home))
    lines = ["| surrounding | |", "|---|---|"]
    lines += [f"| {name} | {'wrong' if wrong else 'as it must'} |" for name, wrong in results]
    return _text(lines, [f"{name}: {wrong}" for name, wrong in results if wrong])


def main(argv: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser("robustness.faults", description=__doc__)
    parser.add_argument("--kills", type=int, default=20, help="how many (20)")
    count, bad = parser.parse_args(argv).kills, False
    with tempfile.TemporaryDirectory(prefix="lfcore-faults-", ignore_cleanup_errors=True) as name:
        home = Path(name)
        for part in (
            lambda: fill_all(home / "disks"),
            lambda: miss_all(home / "folders"),
            lambda: kill_all(home, count),
        ):
            text = part()
            bad |= "\nFINDING" in text
            print(text, flush=True)
    return int(bad)


if __name__ == "__main__":
    sys.exit(main())

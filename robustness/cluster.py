"""The smoke workflow on a throw-away SLURM, once undisturbed and once with jobs cancelled.

    python -m robustness.cluster                          (make cluster)
    python -m robustness.cluster --faults all             (make cluster FAULTS=all)

Says how many jobs went in how many submissions, and whether the results of a disturbed run are
those of the undisturbed one.  With ``--faults`` a smaller run meets what may happen to a node
(:mod:`robustness.cluster_faults`).  Skipped, aloud, where SLURM is not installed.
"""

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from robustness import cluster_faults
from robustness.cluster_runs import ROOT, Run, run
from robustness.local_slurm import CannotRun, LocalSlurm, local_slurm, missing

SMOKE = ("--configfile", str(ROOT / "config" / "smoke.yaml"), "--", "results/tables/")
KILLS = 2
"""The submissions that are cancelled."""


def cancelling(
    slurm: LocalSlurm, kills: int, after_s: float
) -> tuple[Callable[[], None], list[str]]:
    """What cancels ``kills`` submissions ``after_s`` from their start, and their numbers."""
    done: list[str] = []
    since: dict[str, float] = {}

    def cancel() -> None:
        for number in slurm.running() if len(done) < kills else ():
            begun = since.setdefault(number, time.monotonic())
            if number not in done and time.monotonic() - begun > after_s:
                slurm.command("scancel", number)
                done.append(number)
                return

    return cancel, done


def smoke(folder: Path) -> list[Run]:
    """Both runs, of which the second is not made where the first failed."""
    with local_slurm(folder / "slurm") as slurm:
        undisturbed = run(slurm, folder / "undisturbed", "smoke", SMOKE)
        print(undisturbed.summary(), flush=True)
        if undisturbed.status:
            return [undisturbed]
        # Half of what one takes: in the middle of its work, however fast the machine is.
        after_s = undisturbed.inside_s / max(1, len(undisturbed.submissions)) / 2
        cancel, done = cancelling(slurm, KILLS, after_s)
        disturbed = run(
            slurm, folder / "disturbed", f"smoke, {KILLS} cancelled", SMOKE, beside=cancel
        )
        if len(done) < KILLS:
            disturbed.wrong.append(f"only {len(done)} submissions ran long enough to be cancelled")
        disturbed.compare(undisturbed)
        print(disturbed.summary(), flush=True)
    return [undisturbed, disturbed]


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument(
        "--faults", nargs="*", default=[], choices=["all", *cluster_faults.FAULTS],
        help="what happens to a node, in place of the smoke workflow",
    )  # fmt: skip
    parser.add_argument("--publish", action="store_true", help="keep the rows for the documents")
    options = parser.parse_args(arguments)
    if absent := missing():
        print(f"SKIPPED: {', '.join(absent)} not found (apt-get install slurm-wlm munge; make)")
        return 0
    # SLURM's sockets want a short name.
    with tempfile.TemporaryDirectory(prefix="lf", dir="/tmp") as name:
        folder = Path(name)
        folder.chmod(0o755)
        try:
            if options.faults:
                names = list(cluster_faults.FAULTS) if "all" in options.faults else options.faults
                runs = cluster_faults.all_of(folder, names)
            else:
                runs = smoke(folder)
        except CannotRun as error:
            print(error)
            return 1
    if options.publish:
        publish(runs, options.faults)
    return int(any(one.wrong for one in runs))


def publish(runs: list[Run], faults: Sequence[str]) -> None:
    """Keep a row a run, with commit and processor; rows of runs that were not made stay."""
    from benchmarks.publish import RESULTS, Result, of_this_run, with_kept

    of_faults = f'FAULTS="{" ".join(faults)}" ' if faults else ""
    rows = with_kept(pd.DataFrame([one.row() for one in runs]), "cluster", "run")
    provenance = of_this_run(f"make cluster {of_faults}PUBLISH=1")
    Result(provenance, rows).write(RESULTS / "cluster.csv")


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))  # and so end the servers, too
    sys.exit(main())

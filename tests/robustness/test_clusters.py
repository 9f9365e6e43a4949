"""The throw-away SLURM, and how runs are judged."""

import os
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest

from robustness import cluster, cluster_faults
from robustness.cluster_runs import Run, digests, working_seconds
from robustness.local_slurm import local_slurm, missing

pytestmark = pytest.mark.slow

JOB = {
    "number": "3", "name": "run", "state": "NODE_FAIL", "submitted": "2026-01-01T00:00:00",
    "begun": "2026-01-01T00:00:02", "ended": "2026-01-01T00:00:12", "limit": "10:00",
    "memory": "3000M", "comment": "rule_trace",
}  # fmt: skip


@pytest.fixture(scope="module")
def slurm(tmp_path_factory):
    if absent := missing():
        pytest.skip(f"{', '.join(absent)} not found")
    folder = Path(f"/tmp/lft{os.getpid()}")  # SLURM's sockets want a short name
    folder.mkdir(mode=0o755)
    try:
        with local_slurm(folder / "s", cores=1, memory_mib=2000) as slurm:
            yield slurm
    finally:
        import shutil

        shutil.rmtree(folder, ignore_errors=True)


def test_a_node_dies_and_comes_back(slurm):
    state = ("sinfo", "-h", "-o", "%T")
    slurm.kill_node()
    assert slurm.command(*state).strip() == "down"
    slurm.revive_node()
    assert slurm.command(*state).strip() == "idle"


def a_run(**more):
    given = Run("a", 0, "", 20.0, 5, [JOB], {"a": "1", "b": "2"}, 4.0)
    return replace(given, wrong=[], **more)


def test_a_run_is_held_to_the_undisturbed_one():
    undisturbed = a_run()
    same, other, failed = a_run(), a_run(digests={"a": "1", "b": "3"}), a_run(status=1, said="x")
    for one in (same, other, failed):
        one.compare(undisturbed)
    assert not same.wrong and same.row()["results"] == "2 identical"
    assert other.wrong == ["other results: ['b']"] and "DIFFERENT" in other.summary()
    assert failed.wrong[0].startswith("status 1")
    # Ten seconds on the node, of which rules ran four; two seconds waited.
    assert same.row()["of it starts"] == "60%" and same.row()["waited, s"] == "2"


class Queue:
    """As much of a SLURM as is asked: two submissions that run."""

    def __init__(self):
        self.cancelled = []

    def running(self):
        return [number for number in ("7", "8") if number not in self.cancelled]

    def command(self, *words):
        assert words[0] == "scancel"
        self.cancelled.append(words[1])


def test_submissions_are_cancelled_in_the_middle_of_their_work(monkeypatch):
    now, queue = [0.0], Queue()
    monkeypatch.setattr(cluster.time, "monotonic", lambda: now[0])
    cancel, done = cluster.cancelling(queue, 2, 6.0)
    for now[0], known in ((0.0, []), (5.0, []), (7.0, ["7"]), (8.0, ["7", "8"])):
        cancel()
        assert queue.cancelled == done == known
    cancel()
    assert done == ["7", "8"]


@pytest.mark.parametrize("kills, status", [(0, 0), (1, 1)])
def test_too_few_kills_and_other_results_are_failures(monkeypatch, tmp_path, kills, status):
    monkeypatch.setattr(cluster, "local_slurm", lambda *_, **__: nullcontext(Queue()))
    monkeypatch.setattr(cluster, "missing", list)
    names = []

    def ran(slurm, folder, name, words, beside=None):
        names.append(name)
        return a_run(name=name)

    monkeypatch.setattr(cluster, "run", ran)
    monkeypatch.setattr(cluster, "KILLS", kills)
    assert cluster.main([]) == status
    assert names == ["smoke", f"smoke, {kills} cancelled"]


def test_what_is_tried_again_must_ask_for_more():
    more = JOB | {"number": "5", "limit": "20:00", "memory": "6000M", "state": "COMPLETED"}
    assert not list(cluster_faults.more_was_asked(a_run(submissions=[JOB, more]), [JOB]))
    for less in ({"memory": "3000M"}, {"limit": "10:00"}, {"number": "2"}, {"comment": "rule_x"}):
        done = a_run(submissions=[JOB, more | less])
        assert list(cluster_faults.more_was_asked(done, [JOB]))
    assert cluster_faults.minutes("1-02:00:30") == 1440 + 120 + 0.5
    assert cluster_faults.memory_mib("1.5G") == 1536


LOG = """
SNAKEMAKE
[Sun Nov 22 20:09:00 2026]
rule trace:

SNAKEMAKE
[Sun Nov 22 20:09:29 2026]
rule trace:
[Sun Nov 22 20:09:41 2026]
Finished jobid: 0
"""


def test_work_is_what_the_second_snakemake_does(tmp_path):
    for place in ("rule_a/1.log", "group_b/x/2.log"):
        file = tmp_path / ".snakemake" / "slurm_logs" / place
        file.parent.mkdir(parents=True)
        file.write_text(LOG)
    assert working_seconds(tmp_path) == 24


def test_tables_are_compared_without_their_seconds(tmp_path):
    tables = tmp_path / "results" / "tables"
    tables.mkdir(parents=True)

    def written(seconds, psnr):
        (tables / "table_7_1.csv").write_text(f"scene,N,seconds,psnr_db\nbike,8,{seconds},{psnr}\n")
        return digests(tmp_path)

    assert written(1.0, 40.5) == written(2.0, 40.5) != written(1.0, 40.6)

"""The throw-away SLURM, and how runs are judged."""

import os
from dataclasses import replace
from pathlib import Path

import pytest

from robustness import cluster
from robustness.cluster_runs import Run, digests
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
    given = Run("a", 0, "", 20.0, 5, [JOB], {"a": "1", "b": "2"})
    return replace(given, wrong=[], **more)


def test_a_run_is_held_to_the_undisturbed_one():
    undisturbed = a_run()
    same, other, failed = a_run(), a_run(digests={"a": "1", "b": "3"}), a_run(status=1, said="x")
    for one in (same, other, failed):
        one.compare(undisturbed)
    assert not same.wrong and same.row()["results"] == "2 identical"
    assert other.wrong == ["other results: ['b']"] and "DIFFERENT" in other.summary()
    assert failed.wrong[0].startswith("status 1")
    assert same.inside_s == 10


def test_what_is_tried_again_must_ask_for_more():
    more = JOB | {"number": "5", "limit": "20:00", "memory": "6000M", "state": "COMPLETED"}
    assert not list(cluster.more_was_asked(a_run(submissions=[JOB, more]), [JOB]))
    for less in ({"memory": "3000M"}, {"limit": "10:00"}, {"number": "2"}, {"comment": "rule_x"}):
        done = a_run(submissions=[JOB, more | less])
        assert list(cluster.more_was_asked(done, [JOB]))
    assert cluster.minutes("1-02:00:30") == 1440 + 120 + 0.5
    assert cluster.memory_mib("1.5G") == 1536


def test_tables_are_compared_without_their_seconds(tmp_path):
    tables = tmp_path / "results" / "tables"
    tables.mkdir(parents=True)

    def written(seconds, psnr):
        (tables / "table_7_1.csv").write_text(f"scene,N,seconds,psnr_db\nbike,8,{seconds},{psnr}\n")
        return digests(tmp_path)

    assert written(1.0, 40.5) == written(2.0, 40.5) != written(1.0, 40.6)

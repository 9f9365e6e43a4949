"""What a run will take: the table of costs, the plan of cores, the disk."""

from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lfcore.errors import SettingsError
from lfcore.workflow import costs, forecast
from lfcore.workflow.costs import Cost, job_cost, measured_costs
from lfcore.workflow.forecast import START_SECONDS, Task, check_disk

TABLE = """# commit: none
stage,scene,N,M,core_seconds,mib,kept_bytes,temporary_bytes
trace,a,16,100,10,300,0,1000
trace,a,64,100,40,300,0,4000
trace,a,16,200,34,300,0,4000
trace,a,64,200,136,300,0,16000
trace,b,16,100,20,200,0,2000
trace,tiny,2,4,9,200,0,2000
study,,0,100,50,400,7,0
"""


@pytest.fixture
def table(tmp_path):
    (tmp_path / "costs.csv").write_text(TABLE)
    return tmp_path / "costs.csv"


def seconds(file, *place):
    return job_cost(*place, file=file).core_seconds


def test_what_was_measured_is_told_and_what_lies_between_lies_between(table):
    assert job_cost("trace", "a", 16, 100, file=table) == Cost(10, 300, 0, 1000)
    assert seconds(table, "trace", "a", 32, 100) == pytest.approx(20)  # a power of N
    middle = (100**2 + 200**2) / 2
    assert seconds(table, "trace", "a", 16, middle**0.5) == pytest.approx(22)  # linear in M²
    assert seconds(table, "trace", "a", 16, 400) == pytest.approx(34 + 8 / 10**4 * (160000 - 40000))
    assert seconds(table, "trace", "a", 128, 100) == pytest.approx(160)  # as its rays
    assert seconds(table, "trace", "a", 16, 50) == pytest.approx(10 - 8 / 10**4 * 7500)
    assert seconds(table, "trace", "other", 16, 100) == 10  # as those that were measured most
    assert (
        seconds(table, "trace", "tiny", 2, 4) == 9
        and seconds(table, "trace", "tiny", 16, 100) == 10
    )
    assert seconds(table, "trace", "b", 16, 200) == pytest.approx(20 * 34 / 10)  # grows as a does
    assert seconds(table, "study", "", 0, 512) == 50
    assert job_cost("unknown", file=table) == costs.SMALL_JOB


def test_the_table_of_the_project_has_the_tables_own_cells():
    for pixels in (128, 512):
        for scene in ("bike", "cabin", "bedroom"):
            cells = [job_cost("trace", scene, n, pixels) for n in (16, 32, 64, 128, 256, 512)]
            assert all(cell.core_seconds > 0 and cell.temporary_bytes > 0 for cell in cells)
    for stage, cells in measured_costs().items():
        assert all(cost.core_seconds >= 0 and cost.mib > 0 for cost in cells.values()), stage


def tasks(*lengths, **more):
    return [Task(Cost(length - START_SECONDS, 100, 10, 5), **more) for length in lengths]


def planned(some, *cores, **pace):
    return forecast.forecast(dict(enumerate(some)), *cores, **pace)


def test_cores_share_the_tasks():
    assert planned(tasks(10, 10, 10, 10), 2).seconds == pytest.approx(20)
    assert planned(tasks(4, 3, 3), 2).seconds == pytest.approx(6)
    assert planned(tasks(10, 10), 8).seconds == pytest.approx(10)
    assert planned(tasks(10), 2, pace=1.5).seconds == pytest.approx(15)
    both = [Task(Cost(20, 1), threads=2), *tasks(5)]
    assert planned(both, 2).seconds == pytest.approx(10 + START_SECONDS + 5)
    assert planned([], 2).seconds == 0


def test_one_waits_for_another_and_temporary_files_for_their_readers():
    first, second, last = tasks(10, 4, 6)
    chain = [first, second, Task(last.cost, after=(0, 1))]
    found = planned(chain, 2)
    assert found.seconds == pytest.approx(16)
    assert found.mib == 200  # of two at once
    # 5 and 5 of the first two are there until the last is done; all keep 10.
    assert found.bytes == 3 * 15
    alone = planned(tasks(10, 4, 6), 1)
    assert alone.bytes == 10 + 10 + 15  # nobody reads their temporary files


@given(
    st.lists(st.tuples(st.floats(1, 100), st.lists(st.integers(0, 30))), min_size=1, max_size=30),
    st.integers(1, 8),
)
def test_a_plan_lies_within_grahams_bounds(some, cores):
    """Any list schedule of m machines takes at most the work of each and the longest chain."""
    made, chain = [], []
    for place, (length, others) in enumerate(some):
        after = tuple(k for k in others if k < place)
        made.append(Task(Cost(length - START_SECONDS, 1), after=after))
        chain.append(length + max((chain[k] for k in after), default=0))
    found = planned(made, cores).seconds
    work = sum(length for length, _ in some) / cores
    assert found >= max(work, max(chain)) * (1 - 1e-9)
    assert found <= (work + max(chain) * (1 - 1 / cores)) * (1 + 1e-9)


def test_a_disk_that_is_too_small_is_refused_in_one_line(tmp_path, monkeypatch):
    need = planned([Task(Cost(1, 1, 2e9, 1e9))], 1)
    monkeypatch.setattr(forecast.shutil, "disk_usage", lambda _: SimpleNamespace(free=3.61e9))
    check_disk(need, tmp_path / "results")
    monkeypatch.setattr(forecast.shutil, "disk_usage", lambda _: SimpleNamespace(free=3.59e9))
    with pytest.raises(SettingsError) as error:
        check_disk(need, tmp_path / "results")
    line = str(error.value)
    assert "\n" not in line and str(tmp_path / "results") in line
    assert "needs 3.4 GiB" in line and "3.3 GiB left" in line and "angular_resolutions" in line


def test_what_is_said():
    need = planned([Task(Cost(7200, 1000, 3 * 2**30), rays=68_719_476_736)], 2)
    assert need.text(2) == (
        "To be made: 1 job, 68.7 billion rays. About 2 h 00 min on 2 cores, 3.0 GiB of disk, "
        "1000 MiB of memory."
    )
    assert forecast.duration(89) == "89 s" and forecast.duration(600) == "10 min"
    assert forecast.rays_of(12e9, 68.7e9) == "12.0 of 68.7 billion rays"
    assert forecast.rays_of(0, 5120) == "0 of 5120 rays"

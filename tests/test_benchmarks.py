"""Results of benchmarks: files, tables, and what a comparison's rows have."""

import re
import shutil
import subprocess
import sys
from unittest.mock import MagicMock

import numpy as np
import pandas as pd
import pytest

from benchmarks import pathtracers, readers, results, tracer
from benchmarks.peers.method import SkippedError
from benchmarks.peers.mitsuba import Lit, check_plain
from lfcore import Material, SensorPlane
from lfcore.rendering.prepared import open_tracer
from robustness.outcome import ROOT
from tests.plain_scenes import scene, wall

RUN = {"command": "make x", "commit": "abc", "processor": "a machine", "date": "2026-01-02"}


@pytest.fixture
def result(tmp_path):
    """A result file with three rows."""
    rows = pd.DataFrame({"N": [2, 3, 4], "s": ["1.50", "2.0", "inf"]})
    file = tmp_path / "some.csv"
    file.write_text(results.head(RUN | {"note": "Hot."}) + rows.to_csv(index=False))
    return file


def test_a_table_has_its_rows_and_its_run(result):
    rows = results.read_result(result)[1]
    results.write_tables(result, {"_part": rows[rows["N"] != "3"]})
    *table, _, source, _ = result.with_name("some_part.md").read_text().split("\n")
    assert [line.split() for line in table[2:]] == ["| 2 | 1.50 |".split(), "| 4 | inf |".split()]
    assert source == "Made by `make x`: commit abc, 2026-01-02, a machine. Hot."


def test_a_result_without_its_run_is_refused(tmp_path):
    (tmp_path / "some.csv").write_text("# command: x\nN\n1\n")
    with pytest.raises(results.ResultError, match=r"some\.csv.* has no commit, processor, date"):
        results.read_result(tmp_path / "some.csv")


def test_rows_of_other_runs_are_kept(result):
    found = results.with_kept(pd.DataFrame({"N": ["3"], "s": ["9"]}), result, "N")
    assert found[["N", "s"]].values.tolist() == [["3", "9"], ["2", "1.50"], ["4", "inf"]]
    assert found["commit"].iloc[0]


def test_published_tables_have_the_rows_of_their_results():
    """Tables of the manual are files that a command wrote: their cells are in the CSV beside."""
    published = ROOT / "benchmarks" / "published"
    tables = {file.stem: file.read_text() for file in published.glob("*.md")}
    assert tables
    for name, text in tables.items():
        whole = (published / f"{name}.csv").exists()
        result = name if whole else name.partition("_")[0]
        run, rows = results.read_result(published / f"{result}.csv")
        assert text.endswith(f"\n\n{results.source(run)}\n"), name
        if result == "readers":  # its tables count rows
            rows = readers.tables_of(rows)[name.removeprefix("readers")].astype(str)
            rows = rows.map(str.strip)
        if result == "peers":  # its table has ratios
            rates = {"mrays_per_core_second": float}
            rows = tracer.beside_embree(rows.astype(rates)).astype(str)
        names, _, *lines = [
            [cell.strip() for cell in line.strip("|").split(" | ")]
            for line in text.splitlines() if line.startswith("|")
        ]  # fmt: skip
        cells = {tuple(row) for row in rows[[one.strip() for one in names]].values.tolist()}
        assert {tuple(line) for line in lines} <= cells, name


def test_every_published_table_is_on_a_page():
    pages = "".join(path.read_text("utf-8") for path in (ROOT / "docs").glob("*.md"))
    for file in (ROOT / "benchmarks" / "published").glob("*.md"):
        assert f"../benchmarks/published/{file.name}\n" in pages


def test_two_checkouts_take_turns():
    git = shutil.which("git") and subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT)
    if not git or git.returncode:
        pytest.skip("no git, or no history: there is no other commit to compare with")
    words = ["HEAD", "sum(range(10**6))", "--setup", "", "--rounds", "2"]
    said = subprocess.run(
        [sys.executable, "-m", "benchmarks.against", *words],
        cwd=ROOT, capture_output=True, text=True, check=True, timeout=120,
    ).stdout  # fmt: skip
    before, now, ratio = map(float, re.findall(r"\d+\.\d+", said))
    assert before > 0 and now > 0 and ratio == pytest.approx(before / now, rel=0.2)


def test_embree_has_the_better_of_its_packets():
    rows = [("lfcore", 90.0), ("embree, 4 x 4 pixels", 30.0), ("embree, 4 x 4 lens samples", 20.0)]
    table = pd.DataFrame(rows, columns=["method", "mrays_per_core_second"])
    (row,) = tracer.beside_embree(table.assign(scene="bike", N=16)).to_dict("records")
    assert (row[tracer.HITS], row["Embree 3"], row["times Embree"]) == ("90", "30", "3")


def test_a_scene_that_a_peer_cannot_shade_is_left_out_by_name():
    cut = scene(wall(3.0), colours=np.ones((len(wall(3.0)), 3, 3), np.float32))
    with pytest.raises(SkippedError, match="colours at corners"):
        check_plain(cut)


@pytest.mark.kernels
def test_rows_have_what_each_setting_made(tmp_path):
    """Seconds are of the best of the runs, dB of each plane; a figure and crops are made of it."""
    shown = scene(wall(3.0))
    tracer = open_tracer(shown)
    planes = [SensorPlane(focus, shown.camera.f_number) for focus in (2.0, 3.0, 5.0)]
    points = list(pathtracers.ours(tracer, planes, 64, 4))
    assert {point.rays for point in points if np.isfinite(point.rays)} == {1, 4}
    fixed = [point for point in points if np.isfinite(point.rays)]
    truths, kept = fixed[-1].make()[0], {}
    rows = list(pathtracers.rows_of(shown, fixed, truths, 64, 1, kept))
    assert [row["setting"] for row in rows] == [point.setting for point in fixed]
    assert all(float(row["core s"]) > 0 for row in rows)
    assert float(rows[-1]["middle dB"]) > 60
    kept[shown.name, 64, "true", ""] = truths[1]
    table = pathtracers.pd.DataFrame(rows)
    pathtracers.figure(table, tmp_path / "figure.png")
    pathtracers.crops(table, kept, tmp_path)
    assert len(list(tmp_path.glob("*.png"))) == 2


@pytest.mark.parametrize("ambient", [(0.0, 0.0, 0.0), (0.3, 0.3, 0.3)])
def test_lamps_alone_emit_in_mitsuba(ambient):
    lamp, walls = Material("lamp", emission=(2.0, 1.0, 1.0)), Material("walls")
    room = scene(
        np.concatenate([wall(2.0), wall(3.0)]), materials=[lamp, walls],
        material_ids=np.int32([0, 0, 1, 1]), ambient=ambient,
    )  # fmt: skip
    mitsuba = MagicMock()
    Lit(mitsuba, room).all()
    loaded = [call.args[0] for call in mitsuba.load_dict.call_args_list]
    emitters = [given["radiance"] for given in loaded if given["type"] == "area"]
    assert emitters == [{"type": "rgb", "value": [2.0, 1.0, 1.0]}]

"""Sweeps: what cases share, what they make, and what is wrong with a table."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from lfcore import SensorPlane, Slab, open_device
from lfcore.errors import SettingsError
from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.evaluation.sweep import sweep_figure, sweep_rows
from lfcore.evaluation.table_files import read_rows, write_rows
from lfcore.rendering.prepared import open_tracer
from lfcore.workflow import cases
from lfcore.workflow.sweep import joined, plan, read_sweep

ROOT = Path(__file__).resolve().parents[2]
BASE = yaml.safe_load((ROOT / "config" / "config.yaml").read_text())


def sweep_of(tmp_path, text):
    path = tmp_path / "s.tsv"
    path.write_text(text)
    return plan(path, BASE)


@pytest.mark.parametrize("name", ["crf", "layout"])
def test_the_sweeps_of_the_project(name):
    sweep = plan(ROOT / "config" / "sweeps" / f"{name}.tsv", BASE)
    assert len(sweep.settings) >= 4
    # Five rate factors share one tracing; layouts and pixel formats share none.
    assert len(sweep.members) == {"crf": 1, "layout": 16}[name]


def test_cases_share_a_tracing_when_they_differ_in_the_encoder_alone(tmp_path):
    text = """case\tscenes\tviews\tencoding.crf\tpixels
a\t[chart]\t[4, 8]\t20\t16
b\t[chart]\t[4]\t30\t16
c\t[chart]\t[4]\t20\t32
"""
    sweep = sweep_of(tmp_path, text)
    (group,) = {group for (group, _, n), cases in sweep.members.items() if cases == ["a", "b"]}
    assert sorted(case for one in sweep.members.values() for case in one) == ["a", "a", "b", "c"]
    assert sweep.scenes == ["chart"]
    assert [one["encoding"]["crf"] for one in sweep.study(group, "chart", 4).values()] == [20, 30]


def test_a_sweep_is_measured_and_joined(tmp_path):
    text = "case\tscenes\tviews\tpixels\tencoding.crf\n"
    text += "fine\t[chart]\t[4]\t16\t10\ncoarse\t[chart]\t[4]\t16\t45\n"
    sweep = sweep_of(tmp_path, text)
    triangles = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]
    scene = bare_scene(np.float32(triangles), ambient=(0.5, 0.4, 0.3), name="chart")
    tracer = open_tracer(scene, open_device(threads=1))
    ((group, *_),) = sweep.members
    study = sweep.study(group, "chart", 4)
    one = study["fine"]
    rows = sweep_rows(
        tracer,
        Slab(CAMERA, 4, 16),
        cases.tiles(one, 4),
        [SensorPlane(2.0, 2.0)],
        {case: cases.encoding(settings, 4) for case, settings in study.items()},
        tmp_path,
    )
    table = joined(sweep.overrides, [row | {"made_of": ""} for row in rows[::-1]])
    assert table.case.tolist() == ["fine", "coarse"]
    assert table.columns[:4].tolist() == ["case", "pixels", "encoding.crf", "scene"]
    assert table.video_bytes[0] > table.video_bytes[1] and table.psnr_db[0] > table.psnr_db[1]
    assert [path.name for path in tmp_path.iterdir()] == ["s.tsv"]
    axis = sweep_figure(table).axes[0]
    assert sorted(axis.lines[0].get_xdata()) == sorted(table.bits_per_ray)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name\tcrf\na\t1\n", "column 'case'"),
        ("case\tencoding.crf\na\t1\na\t2\n", "two cases are called 'a'"),
        ("case\tfigures.make\na\t[]\n", "figures.make: is not varied by a sweep. Vary scenes"),
        ("case\tencoding.crf\na\t[1\n", "encoding.crf: '\\[1' is no YAML"),
    ],
)
def test_sweeps_say_what_is_wrong(tmp_path, text, words):
    path = tmp_path / "s.tsv"
    path.write_text(text)
    with pytest.raises(SettingsError, match=words):
        read_sweep(path)


@pytest.mark.workflow
def test_a_changed_row_leaves_the_others(project_copy):
    """Planted seconds stay in the row that did not change, and are measured in the others."""
    checkout, planted = project_copy("sweep"), 123.0
    table = checkout.folder / "config" / "sweeps" / "s.tsv"
    for rows in ("a\t20\nb\t30\n", "new\t25\na\t20\nb\t31\n"):
        table.write_text("case\tencoding.crf\n" + rows)
        checkout.made(
            "--configfile", "config/micro.yaml", "--config", "scenes=[chart]", "views=[4]",
            "sweep=config/sweeps/s.tsv", "--", "sweep",
        )  # fmt: skip
        files = list((checkout.folder / "results/sweeps/s").rglob("*.json"))
        made = read_rows(files)
        for file in files:
            write_rows(file, [row | {"trace_seconds": planted} for row in read_rows([file])])
    assert {row["case"] for row in made} == {"new", "a", "b"}
    for row in made:
        assert (row["trace_seconds"] == planted) == (row["case"] == "a")
        assert row["video_bytes"] > 0

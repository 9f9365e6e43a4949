"""The tables on made-up records, figures and the page: what was drawn is found in the files."""

import base64
import math
import re

import jinja2
import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view
from PIL import Image
from plain_scenes import refused

from lfcore import SensorPlane, write_picture
from lfcore.evaluation.figures import QUALITY, TIME, contact_sheet, curves_over_n
from lfcore.evaluation.metrics import mse, psnr, ssim
from lfcore.evaluation.page import Section, left_over, to_html, write_page
from lfcore.evaluation.stability.measurement import COLUMNS, Measurement
from lfcore.evaluation.stability.report import (
    cases_table,
    error_growth,
    heat_map,
    stability_table,
    summary,
)
from lfcore.evaluation.table_files import human_bytes, readable, write_csv, write_markdown
from lfcore.evaluation.tables import make_table, scene_records, sizes, thesis_figures
from lfcore.evaluation.true_picture import Reference, save_reference
from lfcore.files import write_json
from lfcore.optics.plane_pictures import save_stack
from lfcore.oracle.colour import srgb_decode, srgb_encode


def slow_ssim(x, y, peak):
    """Wang's formula over every window of one channel."""
    line = np.exp(-(np.arange(-5, 6) ** 2) / (2 * 1.5**2))
    weights = np.outer(line, line) / line.sum() ** 2
    c1, c2 = (0.01 * peak) ** 2, (0.03 * peak) ** 2
    scores = []
    for a, b in zip(
        *(sliding_window_view(z, (11, 11)).reshape(-1, 11, 11) for z in (x, y)), strict=True
    ):
        mean_a, mean_b = (weights * a).sum(), (weights * b).sum()
        var_a, var_b = (weights * (a - mean_a) ** 2).sum(), (weights * (b - mean_b) ** 2).sum()
        cov = (weights * (a - mean_a) * (b - mean_b)).sum()
        alike = (2 * mean_a * mean_b + c1) / (mean_a**2 + mean_b**2 + c1)
        scores.append(alike * (2 * cov + c2) / (var_a + var_b + c2))
    return np.mean(scores)


def test_psnr_of_hand_values():
    reference = np.zeros((4, 4, 3))
    # Every code off by 1: MSE = 1, 10 log10(255^2) = 48.1308 dB.
    assert psnr(reference + 1, reference, peak=255) == pytest.approx(48.1308, abs=1e-4)
    # One of 48 values off by 255: MSE = 255^2 / 48, 10 log10(48) = 16.8124 dB.
    one_off = reference.copy()
    one_off[0, 0, 0] = 255
    assert psnr(one_off, reference, peak=255) == pytest.approx(16.8124, abs=1e-4)
    # The same picture in [0, 1].
    assert psnr(one_off / 255, reference, peak=1) == pytest.approx(16.8124, abs=1e-4)
    picture = np.random.default_rng(1).uniform(0, 255, (20, 30, 3))
    assert psnr(picture, picture, peak=255) == math.inf
    assert ssim(picture, picture, peak=255) == pytest.approx(1.0, abs=1e-12)
    low, high = np.zeros((11, 11), np.uint8), np.full((11, 11), 255, np.uint8)
    assert mse(low, high) == mse(high, low) == 255**2, "unsigned bytes do not wrap"


@settings(max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(11, 18), width=st.integers(11, 18))
def test_ssim_against_the_plain_formula(seed, height, width):
    rng = np.random.default_rng(seed)
    x = rng.uniform(0, 255, (height, width, 3))
    y = np.clip(x + rng.normal(0, rng.uniform(1, 60), x.shape), 0, 255)
    channels = [slow_ssim(x[..., c], y[..., c], 255) for c in range(3)]
    assert ssim(x[..., 0], y[..., 0], peak=255) == pytest.approx(channels[0], abs=1e-9)
    assert ssim(x, y, peak=255) == pytest.approx(np.mean(channels), abs=1e-9)


def test_what_does_not_compare_is_refused():
    black, small = np.zeros((12, 12)), np.zeros((10, 20))
    refused("do not compare", psnr, black, np.zeros((12, 13)), peak=255)
    refused("not finite", psnr, np.full((12, 12), np.nan), black, peak=255)
    refused("at least 11", ssim, small, small, peak=255)


CONTEXT = {"triangles": 9990, "M": 128, "device": "made up", "threads": 1}


def quality(scene, n, psnr_db=40.0, table="table_7_1"):
    measured = {"seconds": 1.23456, "psnr_db": psnr_db, "psnr_true_db": 32.456, "ssim": 0.9}
    return {"table": table, "scene": scene, "N": n, **measured, **CONTEXT}


def test_each_row_stands_beside_the_thesis():
    table = make_table("table_7_1", [quality("bike", 16), quality("bedroom", 512, math.inf)])
    assert table.thesis_seconds.tolist() == [175, 4230]
    assert table.thesis_psnr_db.tolist() == [38.396, math.inf]
    assert table.seconds.tolist() == [1.235, 1.235]
    retrieval = make_table("table_7_3", [quality("cabin", 64, table="table_7_3")])
    assert retrieval.thesis_psnr_db.tolist() == [45.268]
    table = make_table("table_7_1", [quality("teapot", 16)])
    assert table.thesis_seconds.isna().all()
    assert list(readable(table))[:3] == ["scene", "N", "seconds"]


def test_the_thesis_is_in_brackets_behind_ours_and_next_to_the_keys():
    rows = [quality("bike", 16), quality("teapot", 16)]
    text = readable(make_table("table_7_1", rows))
    names = ["scene", "N", "seconds (thesis)", "psnr db (thesis)", "ssim (thesis)"]
    assert list(text)[:5] == names and not any(name.startswith("thesis") for name in text)
    assert text["seconds (thesis)"].tolist() == ["1.235 (175)", "1.235"]


def test_sizes_in_both_conventions():
    # Thesis, bike, N = 16: 512^2 * 256 rays of 12 bytes are its 768 MiB.
    rays = 512**2 * 16**2
    row = thesis_figures().loc[("bike", 16)]
    measured = sizes(rays=rays, video_bytes=int(row.video_bytes))
    assert measured["raw_bytes_float32"] == row.raw_bytes_float32 == 768 * 2**20
    assert measured["ratio_float32"] == pytest.approx(row.compression_ratio, rel=1e-3)
    assert measured["ratio_uint8"] == pytest.approx(measured["ratio_float32"] / 4)
    found = [human_bytes(n) for n in (0, 1000, 1536, 3 * 2**30)]
    assert found == ["0 B", "1000 B", "1.5 KiB", "3 GiB"]


def test_records_that_do_not_fit_are_refused():
    record = quality("bike", 16)
    refused("extra", make_table, "table_7_1", [record | {"extra": 1}])
    del record["ssim"]
    refused("ssim", make_table, "table_7_1", [record])


def test_files(tmp_path):
    table = make_table("table_7_1", [quality("bike", 16), quality("bike", 512, math.inf)])
    write_csv(tmp_path / "t.csv", table)
    text = (tmp_path / "t.csv").read_text()
    row = "bike,512,1.235,inf,32.46,0.9,9990,128,made up,1,1598,inf"
    assert text.splitlines()[2].startswith(row)
    pd.testing.assert_frame_equal(pd.read_csv(tmp_path / "t.csv"), table, check_dtype=False)
    write_markdown(tmp_path / "t.md", table, title="A title", caption="A caption.")
    lines = (tmp_path / "t.md").read_text().splitlines()
    assert lines[0] == "# A title" and lines[-1] == "A caption."
    assert sum(line.startswith("| bike") for line in lines) == 2
    assert {p.name for p in tmp_path.iterdir()} == {"t.csv", "t.md"}


def test_pictures_are_judged_by_the_largest_n_and_by_the_truth(tmp_path):
    """What the recipe converges to is perfect by its own measure, and off by a known error."""
    planes = [SensorPlane(2.0, 1.0), SensorPlane(5.0, 1.0)]
    true = np.full((2, 32, 32, 3), 0.25, np.float32)
    traced = {"seconds": 1.5, "rays": 32**2, "triangles": 9, "device": "none", "threads": 1}
    write_json(tmp_path / "trace.json", traced)
    files = {}
    for views, off in ((16, 0.02), (32, 0.01)):
        # Off by so much in sRGB but at the border, which does not count.
        stack = srgb_decode(srgb_encode(true) + off).astype(np.float32)
        stack[:, :2] = 0
        save_stack(tmp_path / f"{views}.npz", stack, planes)
        files[views] = tmp_path / f"{views}.npz", tmp_path / "trace.json"
    truth = Reference(planes, true, np.full(2, 60.0))
    save_reference(tmp_path / "truth.npz", truth)
    rows = scene_records("bike", 32, files, tmp_path / "truth.npz")
    assert rows[1]["psnr_db"] == math.inf, "the reference itself"
    expected = [-20 * math.log10(off) for off in (0.02, 0.01)]
    assert [row["psnr_true_db"] for row in rows] == pytest.approx(expected, abs=1e-3)
    assert make_table("table_7_1", rows).shape[0] == 2


def test_contact_sheet_holds_every_picture(tmp_path):
    colours = np.eye(3)
    pictures = [np.broadcast_to(c, (300, 300, 3)) for c in colours]
    cells = list(zip(pictures, ["red", "green", "blue"], strict=True))
    contact_sheet(tmp_path / "c.png", cells, 2)
    with Image.open(tmp_path / "c.png") as image:
        sheet = np.asarray(image)
    for colour in colours:
        assert (sheet == 255 * colour).all(axis=-1).sum() == 300 * 300


def of_scenes(pixels):
    """A table like the thesis's, of two scenes."""
    rows = pd.DataFrame({"scene": ["a", "a", "b"], "N": [16, 32, 16], "M": pixels})
    rows["psnr_db"], rows["thesis_psnr_db"] = [40.0, math.inf, 42.0], [38.0, 41.0, None]
    rows["seconds"], rows["thesis_seconds"] = [1.0, 2.0, 3.0], [100.0, None, None]
    return rows


def shown(axis):
    """Curves of an axis by label and style: their points."""
    return {
        (line.get_label()[:1], line.get_linestyle()): line.get_xydata().tolist()
        for line in axis.lines
        if len(line.get_xdata())
    }


def test_curves_share_an_axis_with_the_thesis_if_m_is_its():
    panels = (QUALITY[0], TIME)
    ours, thesis, time = curves_over_n(of_scenes(128), panels).axes
    assert ours.get_title() == "M = 128" and thesis.get_title() == "the thesis, M = 512"
    # What is infinite or missing is left out.
    assert shown(ours) == {("a", "-"): [[16, 40]], ("b", "-"): [[16, 42]]}
    assert shown(thesis) == {("a", "--"): [[16, 38], [32, 41]]}
    # Time per ray compares whatever M is.
    points = shown(time)
    assert points["a", "-"][0][1] == pytest.approx(1e9 / (16 * 128) ** 2)
    assert points["_", "--"][0][1] == pytest.approx(100e9 / (16 * 512) ** 2)
    assert time.get_title() == "M = 128; dashed: the thesis, M = 512"
    # Scenes that the thesis does not have need no axes for it.
    unknown = of_scenes(128).assign(thesis_psnr_db=None, thesis_seconds=None)
    assert [axis.get_title() for axis in curves_over_n(unknown, panels).axes] == ["M = 128"] * 2
    # Labels of a figure this wide can be read on a page of 1280 pixels.
    assert curves_over_n(of_scenes(128), (*panels, *panels)).get_size_inches()[0] < 12
    quality, time = curves_over_n(of_scenes(512), (QUALITY[0], TIME)).axes
    assert set(shown(quality)) == {("a", "-"), ("b", "-"), ("_", "--")}
    assert shown(time)["_", "--"][0][1] == pytest.approx(100e9 / (16 * 512) ** 2)


def test_a_page_folds_long_tables_and_says_once_what_is_the_same(tmp_path):
    table = pd.DataFrame({"case": [f"c{k}" for k in range(21)], "device": ["a device"] * 21})
    table["verdict"], table["value"] = ["pass"] * 20 + ["fail"], range(21)
    for rows, folded in ((table, True), (table[1:], False)):
        rows.to_csv(tmp_path / "t.csv", index=False)
        caption = "{{ (table['verdict'] == 'pass').sum() }} of {{ table | length }} pass."
        section = Section("t", "T", caption, table=tmp_path / "t.csv")
        write_page(tmp_path / "index.html", [section], title="", introduction="", facts={},
                   config={})  # fmt: skip
        text = (tmp_path / "index.html").read_text()
        assert ("<details><summary>Table of 21 rows" in text) == folded
        assert text.count("a device") == 1 and f"{len(rows) - 1} of {len(rows)} pass." in text
        assert text.index("pass.") < text.index("<table>")


def test_page_is_whole_and_self_contained(tmp_path):
    table = pd.DataFrame({"scene": ["a<b", "c"], "N": [16, 16], "thesis_seconds": [1.5, None]})
    table.to_csv(tmp_path / "t.csv", index=False)
    for name in ("t.md", "t_cases.csv", "stale.csv"):
        (tmp_path / name).write_text("| |")
    write_picture(tmp_path / "p.png", np.full((4, 4, 3), 0.5))
    sections = [
        Section("pictures", "Pictures", "See ``this``.", figures={"a": tmp_path / "p.png"}),
        Section("t", "A table", "M is {{ snakemake.config['M'] }}.", table=tmp_path / "t.csv"),
    ]
    write_page(
        tmp_path / "index.html", sections, title="Light & fields", introduction="Hello.",
        facts={"cores": 2}, config={"M": 128},
    )  # fmt: skip
    text = (tmp_path / "index.html").read_text()
    assert "Light &amp; fields" in text and "a&lt;b" in text and "a<b" not in text
    assert "M is 128." in text and 'href="t.csv"' in text and 'href="t.md"' in text
    data = re.search(r"data:image/png;base64,([^\"]+)", text)[1]
    assert base64.b64decode(data) == (tmp_path / "p.png").read_bytes()
    assert not re.search(r"(src|href)=\"(?:https?:|/)", text)
    assert left_over(tmp_path / "index.html", sections, []) == ["stale.csv"]
    with pytest.raises(jinja2.UndefinedError):
        to_html("{{ snakemake.config['absent'] }}", {})


REFUSED = "coordinates", "1 triangle is out of range"


def test_cases_table():
    rows = [
        Measurement("needles (depth)", "aspect", 10.0**k, 9, k, 16, condition=2 + k)
        for k in range(3)
    ]
    rows += [Measurement("thin gap", "gap m", 1.0, 0.5, math.nan, 0.0, *REFUSED)]
    table = cases_table(stability_table(rows)).set_index("case")
    assert table.loc["needles (depth)", ["least", "most", "passed"]].tolist() == [1, 100, 3]
    assert table.condition_number["needles (depth)"] == 4 and table.worst["needles (depth)"] == 2
    assert table.refused["thin gap"] == 1 and np.isnan(table.worst["thin gap"])


def test_table_and_figures(tmp_path, drawn, shows):
    rows = [Measurement("a", "x", 10.0**k, 10.0**k, 10.0 ** (k / 2), 1.0) for k in range(-2, 4)]
    rows += [Measurement("b", "y", 1.0, math.inf, math.nan, 0.0, *REFUSED)]
    table = stability_table(rows)
    assert set(COLUMNS) < set(table.columns) and "refused" in summary(table)
    heat_map(tmp_path / "heat.png", table)
    error_growth(tmp_path / "growth.png", table)
    heat, growth = drawn
    naive, ours = heat.axes[:2]
    assert [label.get_text() for label in naive.get_yticklabels()] == ["a", "b"]
    cells = np.asarray(ours.images[0].get_array().filled(np.nan))
    assert cells.shape == (2, 6) and (cells[0] == np.log10(table.error[:6] / table.bound[:6])).all()
    failed = ["×"] * int((table.error[:6] > 1).sum())
    assert [text.get_text() for text in ours.texts] == [*failed, "r"] and not naive.texts
    (axis,) = (axis for axis in growth.axes if axis.get_visible())
    assert axis.get_title() == "a"
    for column in ("error", "naive_error", "bound"):
        assert shows(axis, table[["value", column]][:6].to_numpy()), column
    assert np.isnan(table.error.iloc[-1])

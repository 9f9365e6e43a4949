"""Pictures, figures and the page: what was drawn can be found again in the files."""

import base64
import math
import re

import jinja2
import numpy as np
import pandas as pd
import pytest
from PIL import Image

from lfcore.evaluation.figures import QUALITY, TIME, contact_sheet, curves_over_n
from lfcore.evaluation.page import Section, to_html, write_page
from lfcore.pictures import write_picture


def test_contact_sheet_holds_every_picture(tmp_path):
    colours = np.eye(3)
    pictures = [np.broadcast_to(c, (300, 300, 3)) for c in colours]
    contact_sheet(tmp_path / "c.png", pictures, ["red", "green", "blue"], columns=2)
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


def test_curves_of_unequal_m_have_axes_of_their_own():
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


def test_curves_of_the_thesis_s_m_share_an_axis():
    quality, time = curves_over_n(of_scenes(512), (QUALITY[0], TIME)).axes
    assert set(shown(quality)) == {("a", "-"), ("b", "-"), ("_", "--")}
    assert shown(time)["_", "--"][0][1] == pytest.approx(100e9 / (16 * 512) ** 2)


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
        tmp_path / "index.html",
        sections,
        title="Light & fields",
        introduction="Hello.",
        facts={"cores": 2},
        config={"M": 128},
    )
    text = (tmp_path / "index.html").read_text()
    assert "Light &amp; fields" in text and "a&lt;b" in text and "a<b" not in text
    assert "M is 128." in text and 'href="t.csv"' in text and 'href="t.md"' in text
    data = re.search(r"data:image/png;base64,([^\"]+)", text)[1]
    assert base64.b64decode(data) == (tmp_path / "p.png").read_bytes()
    assert not re.search(r"(src|href)=\"(?:https?:|/)", text)
    assert "not shown</dt><dd>stale.csv</dd>" in text


def test_a_caption_with_a_mistake_is_an_error():
    with pytest.raises(jinja2.UndefinedError):
        to_html("{{ snakemake.config['absent'] }}", {})

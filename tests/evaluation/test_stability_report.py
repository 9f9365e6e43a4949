"""Verdicts against documented ranges, and the figures."""

import math
from pathlib import Path

import numpy as np
import pytest

from lfcore.evaluation.stability.rows import COLUMNS, Row
from lfcore.evaluation.stability_report import (
    RANGES,
    error_growth,
    heat_map,
    stability_table,
    summary,
    verdict,
)

DOCUMENT = Path(__file__).parents[2] / "docs" / "stability.md"


def test_only_failures_outside_a_documented_range_are_excused():
    assert verdict(Row("scaled scene (depth)", "scale", 1e-20, 1, 99, 16)) == "out of range"
    assert verdict(Row("scaled scene (depth)", "scale", 1.0, 1, 99, 16)) == "fail"
    assert verdict(Row("scaled scene (depth)", "scale", 1e-20, 1, 9, 16)) == "pass"
    assert verdict(Row("needles (depth)", "aspect", 1e-20, 1, 99, 16)) == "fail"
    assert verdict(Row("needles", "aspect", 1, 1, math.nan, 16, refused=True)) == "refused"


@pytest.mark.parametrize("limit", RANGES, ids=lambda limit: limit.case)
def test_every_range_is_documented(limit):
    assert limit.text in " ".join(DOCUMENT.read_text(encoding="utf-8").split())


def test_table_and_figures(tmp_path):
    rows = [Row("a", "x", 10.0**k, 10.0**k, 10.0 ** (k / 2), 1.0) for k in range(-2, 4)]
    rows += [Row("b", "y", 1.0, math.inf, math.nan, 0.0, refused=True)]
    table = stability_table(rows)
    assert tuple(table.columns) == COLUMNS and "refused" in summary(table)
    heat_map(tmp_path / "heat.png", table)
    error_growth(tmp_path / "growth.png", table)
    assert all(path.stat().st_size > 5000 for path in tmp_path.iterdir())
    assert np.isnan(table.error.iloc[-1])

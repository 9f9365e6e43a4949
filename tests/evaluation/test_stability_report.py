"""Cases and their bounds, the documented range, and the figures."""

import math

import numpy as np

from lfcore.evaluation.stability.measurement import COLUMNS, Measurement
from lfcore.evaluation.stability.report import (
    cases_table,
    error_growth,
    heat_map,
    stability_table,
    summary,
)

REFUSED = "coordinates", "1 triangle is out of range"


def test_cases_table():
    rows = [
        Measurement("needles (depth)", "aspect", 10.0**k, 9, k, 16, condition=2 + k)
        for k in range(3)
    ]
    rows += [Measurement("thin gap", "gap m", 1.0, 0.5, math.nan, 0.0, *REFUSED)]
    table = cases_table(rows).set_index("case")
    assert table.loc["needles (depth)", ["least", "most", "passed"]].tolist() == [1, 100, 3]
    assert table.condition_number["needles (depth)"] == 4 and table.worst["needles (depth)"] == 2
    assert table.refused["thin gap"] == 1 and np.isnan(table.worst["thin gap"])


def test_table_and_figures(tmp_path, drawn, shows):
    rows = [Measurement("a", "x", 10.0**k, 10.0**k, 10.0 ** (k / 2), 1.0) for k in range(-2, 4)]
    rows += [Measurement("b", "y", 1.0, math.inf, math.nan, 0.0, *REFUSED)]
    table = stability_table(rows)
    assert tuple(table.columns) == COLUMNS and "refused" in summary(table)
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

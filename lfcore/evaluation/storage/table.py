"""Rows as a table for people and programs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from lfcore.files import read_json, write_json

DIGITS = 5
"""Significant digits that are published: more than any measurement carries."""


def make_table(rows: Iterable[Mapping], columns: Sequence[str]) -> pd.DataFrame:
    """The rows with these columns in this order, numbers rounded to five significant digits.

    Raises ``KeyError`` when a row lacks a column or has one too many.
    """
    rows = list(rows)
    for row in rows:
        if set(row) != set(columns):
            raise KeyError(f"columns {sorted(set(row) ^ set(columns))}")
    return pd.DataFrame([{c: _rounded(row[c]) for c in columns} for row in rows], columns=columns)


def _rounded(value: object) -> object:
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def write_rows(path: str | Path, rows: Iterable[Mapping]) -> None:
    """Rows as JSON, which knows no infinity (written as text) and no missing number (null)."""
    write_json(path, {"rows": [{key: _plain(value) for key, value in row.items()} for row in rows]})


def read_rows(paths: Iterable[str | Path]) -> list[dict]:
    """The rows of all files, in order."""
    rows = [row for path in paths for row in read_json(path)["rows"]]
    return [{k: math.inf if v == "inf" else v for k, v in row.items()} for row in rows]


def _plain(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return "inf" if value > 0 else None
    return value

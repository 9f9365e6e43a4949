"""Tables on disk, written here alone: rows for programs, CSV and Markdown for people."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from lfcore.errors import LfcoreError
from lfcore.files import read_json, write_json, write_text

DIGITS = 5
"""The significant digits of published numbers."""
UNKNOWN = "–"
"""The text of a cell without a value."""


class TableError(LfcoreError):
    """Rows that do not fit their table."""


def table_of(
    rows: Iterable[Mapping],
    columns: Sequence[str] | None = None,
    decimals: Mapping[str, int] | None = None,
) -> pd.DataFrame:
    """The rows as a table of ``columns``, in this order; by default the first row's.

    Numbers are rounded to five significant digits or, where ``decimals`` are given, to those of
    their columns.  Raises :class:`TableError` when a row lacks a column or has one too many.
    """
    rows = list(rows)
    columns = list(rows[0]) if columns is None else columns
    for row in rows:
        if odd := set(row) ^ set(columns):
            raise TableError(f"a row lacks or has too many of: {', '.join(sorted(odd))}")
    if decimals is not None:
        return pd.DataFrame(rows, columns=list(columns)).round(decimals)
    return pd.DataFrame([{c: _rounded(row[c]) for c in columns} for row in rows], columns=columns)


def _rounded(value: object) -> object:
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def write_rows(path: str | Path, rows: Iterable[Mapping]) -> None:
    """Write rows as JSON; infinities are text, missing numbers null."""
    rows = [{key: _for_json(value) for key, value in row.items()} for row in rows]
    write_json(path, {"rows": rows})


def read_rows(paths: Iterable[str | Path]) -> list[dict]:
    """The rows of all files, in order."""
    rows = [row for path in paths for row in read_json(path)["rows"]]
    return [{k: math.inf if v == "inf" else v for k, v in row.items()} for row in rows]


def _for_json(value: object) -> object:
    if isinstance(value, float) and not math.isfinite(value):
        return "inf" if value > 0 else None
    return value


def write_csv(path: str | Path, table: pd.DataFrame) -> None:
    """Write any table as CSV; infinities as ``inf``, unknown cells empty."""
    write_text(path, table.to_csv(index=False, lineterminator="\n"))


def write_markdown(path: str | Path, table: pd.DataFrame, *, title: str, caption: str) -> None:
    """Write any table as Markdown under its title, with the caption below."""
    body = readable(table).to_markdown(index=False, disable_numparse=True)
    write_text(path, f"# {title}\n\n{body}\n\n{caption.strip()}\n")


def readable(table: pd.DataFrame) -> pd.DataFrame:
    """The table as text for people: sizes in KiB, MiB, GiB, unknown cells as a dash, and the
    thesis's values in brackets after this program's, next to the keys."""
    text = pd.DataFrame(index=table.index)
    for column in table.columns:
        in_bytes = "bytes" in column
        text[readable_name(column)] = [
            _cell(value, in_bytes=in_bytes) for value in table[column].tolist()
        ]
    compared = [name for name in text if f"thesis {name}" in text]
    if not compared:
        return text
    keys = list(text.columns)[: text.columns.get_loc(compared[0])]
    renamed = {}
    for name in compared:
        thesis = text.pop(f"thesis {name}")
        if (thesis != UNKNOWN).any():
            renamed[name] = f"{name} (thesis)"
            text[name] = [
                ours if value == UNKNOWN else f"{ours} ({value})"
                for ours, value in zip(text[name], thesis, strict=True)
            ]
    rest = [name for name in text if name not in (*keys, *compared)]
    return text[[*keys, *compared, *rest]].rename(columns=renamed)


def readable_name(column: str) -> str:
    """The name of a column for people."""
    return column.replace("_bytes", "").replace("bytes_", "").replace("_", " ")


def _cell(value: Any, *, in_bytes: bool) -> str:
    if value is None or value != value:
        return UNKNOWN
    if in_bytes:
        return human_bytes(float(value))
    if isinstance(value, float):
        return f"{value:.0f}" if value.is_integer() and abs(value) < 1e15 else f"{value:.6g}"
    return str(value)


def human_bytes(count: float) -> str:
    """``1536`` as ``1.5 KiB``."""
    for unit in ("B", "KiB", "MiB", "GiB"):
        if count < 1024:
            return f"{count:.4g} {unit}"
        count /= 1024
    return f"{count:.4g} TiB"

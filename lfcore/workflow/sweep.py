"""Sweeps: tables of light fields, one case per row.

A sweep is a table of tab-separated values: the column ``case`` names a case, every other column is
a key of the configuration (``encoding.crf`` for a key within a key) and every cell its value, in
YAML; a line that begins with ``#`` is a comment.  All cases are in one job graph.  They share the
scene and its hierarchy; cases that differ only in the encoder also share the tracing.
"""

import copy
import csv
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd
import yaml

from lfcore.errors import SettingsError
from lfcore.evaluation.table_files import read_rows
from lfcore.workflow import cases
from lfcore.workflow.settings import check_settings

SWEPT = ("scenes", "views", "pixels", "planes", "layout", "encoding", "tile_mib")
"""The keys of a light field, which a sweep may vary."""


def read_sweep(path: Path) -> dict[str, dict[str, object]]:
    """Read the keys, with dots, and values that each case overrides.

    Raises :class:`SettingsError` for a table without cases, a name of a case or a key that is there
    twice, a row of more or fewer cells, a key that a sweep may not vary, and a cell that is not
    YAML.
    """
    columns, *rows = _cells(path) or [[]]
    if "case" not in columns or not rows:
        raise SettingsError("a sweep needs a column 'case' and at least one row", file=path)
    if column := _repeated(columns):
        raise SettingsError("two columns have this name", file=path, key=column)
    for row in rows:
        if len(row) != len(columns):
            counts = f"{len(row)} cells, and the table {len(columns)} columns"
            remedy = "Separate cells by one tab each"
            raise SettingsError(f"the row {row[0]!r} has {counts}", file=path, remedy=remedy)
    if name := _repeated([row[columns.index("case")] for row in rows]):
        raise SettingsError(f"two cases are called {name!r}", file=path)
    keys = [column for column in columns if column != "case"]
    for column in keys:
        if column.split(".")[0] not in SWEPT:
            allowed = ", ".join(SWEPT)
            raise SettingsError(
                "cannot be varied by a sweep", file=path, key=column, remedy=f"Vary {allowed}"
            )
    records = (dict(zip(columns, row, strict=True)) for row in rows)
    return {one["case"]: {key: _cell(path, key, one[key]) for key in keys} for one in records}


def _cells(path: Path) -> list[list[str]]:
    """Return the cells of each row, the header first; a tab at a line's end has no cell after
    it."""
    try:
        lines = path.read_text(encoding="utf-8-sig").split("\n")
        table = [line for line in lines if line.strip() and not line.startswith("#")]
        rows = list(csv.reader(table, delimiter="\t", strict=True))
    except (OSError, ValueError, csv.Error) as error:
        raise SettingsError(f"cannot be read: {error}", file=path) from None
    width = len(rows[0]) - (not rows[0][-1]) if rows else 0
    return [row[:-1] if len(row) == width + 1 and not row[-1] else row for row in rows]


def _repeated(names: list[str]) -> str | None:
    return next((name for name in names if names.count(name) > 1), None)


def _cell(path: Path, key: str, text: str) -> object:
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        raise SettingsError(f"{text[:80]!r} is no YAML", file=path, key=key) from None


def overridden(base: Mapping, row: Mapping[str, object]) -> dict:
    """Return a copy of ``base`` with the values of ``row``, whose keys have dots.

    Raises :class:`SettingsError` for a key within one that is no mapping.
    """
    settings = copy.deepcopy(dict(base))
    for key, value in row.items():
        *above, last = key.split(".")
        inner = settings
        for name in above:
            inner = inner.setdefault(name, {})
            if not isinstance(inner, dict):
                raise SettingsError(f"{name!r} has no keys within it", key=key)
        inner[last] = value
    return settings


@dataclass(frozen=True)
class Sweep:
    """The light fields of a table of cases.

    Attributes
    ----------
    overrides : dict
        The keys of each case, as in the table.
    settings : dict
        The complete configuration of each case.
    members : dict
        The cases that share a tracing, by group, scene and views.
    """

    overrides: dict[str, dict[str, object]]
    settings: dict[str, dict]
    members: dict[tuple[str, str, int], list[str]]

    @property
    def scenes(self) -> list[str]:
        """The entries of the key ``scenes`` of all cases, each once."""
        entries = (scene for settings in self.settings.values() for scene in settings["scenes"])
        return list(dict.fromkeys(entries))

    def study(self, group: str, scene: str, n: int) -> dict[str, dict]:
        """Return the settings of the cases that share a tracing."""
        return {
            case: {key: self.settings[case][key] for key in SWEPT[2:]}
            for case in self.members[group, scene, n]
        }


def plan(path: Path, base: Mapping) -> Sweep:
    """Return the sweep of a table over a configuration.

    Raises :class:`SettingsError` for a case with invalid settings.
    """
    overrides = read_sweep(path)
    settings = {}
    for case, row in overrides.items():
        try:
            whole = overridden(base, row)
        except SettingsError as error:
            raise error.named(SettingsError, file=path) from None
        settings[case] = check_settings(whole, file=path, key=f"case {case}")
    members: dict[tuple[str, str, int], list[str]] = {}
    for case, keys in settings.items():
        for scene in cases.scene_files(keys["scenes"]):
            for n in keys["views"]:
                group = repr((cases.frame_layout(keys, n), keys["planes"], keys["tile_mib"]))
                members.setdefault((_digest(group), scene, n), []).append(case)
    return Sweep(overrides, settings, members)


def made_of(study: Mapping[str, Mapping], *common: str) -> dict[str, str]:
    """Return the digest of each case: of its settings, and of the ``common`` code and scene."""
    return {case: _digest(repr((sorted(keys.items()), common))) for case, keys in study.items()}


def unchanged(path: Path, digests: Mapping[str, str]) -> list[dict]:
    """Return an earlier run's rows whose cases have these digests; none without its file."""
    rows = read_rows([path]) if path.exists() else []
    return [row for row in rows if digests.get(row["case"]) == row["made_of"]]


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def joined(overrides: Mapping[str, Mapping], rows: list[dict]) -> pd.DataFrame:
    """Return all cases' rows in the sweep's order, with the keys of their ``overrides`` first."""
    order, hidden = list(overrides), ("scenes", "views")
    varied = {
        case: {key: str(value) for key, value in keys.items() if key not in hidden}
        for case, keys in overrides.items()
    }
    rows = sorted(rows, key=lambda row: (order.index(row["case"]), row["scene"], row["N"]))
    table = pd.DataFrame([{"case": row["case"], **varied[row["case"]], **row} for row in rows])
    return table.drop(columns="made_of")

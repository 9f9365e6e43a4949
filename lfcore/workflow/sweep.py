"""Sweeps: tables of light fields, one case per row.

A sweep is a table of tab-separated values: the column ``case`` names a case, every other column is
a key of the configuration (``encoding.crf`` for a key within a key) and every cell its value, in
YAML.  All cases are in one job graph.  They share the scene and its hierarchy; cases that differ
only in the encoder also share the tracing.
"""

import copy
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

    Raises :class:`SettingsError` for a table without cases, two cases with the same name, a key
    that a sweep may not vary, and a cell that is not YAML.
    """
    try:
        table = pd.read_csv(path, sep="\t", dtype=str, comment="#", keep_default_na=False)
    except (OSError, ValueError) as error:
        raise SettingsError(f"cannot be read: {error}", file=path) from None
    if "case" not in table.columns or table.empty:
        raise SettingsError("a sweep needs a column 'case' and at least one row", file=path)
    repeated = table.case[table.case.duplicated()]
    if len(repeated):
        raise SettingsError(f"two cases are called {repeated.iloc[0]!r}", file=path)
    for column in table.columns.drop("case"):
        if column.split(".")[0] not in SWEPT:
            allowed = ", ".join(SWEPT)
            raise SettingsError(
                "cannot be varied by a sweep", file=path, key=column, remedy=f"Vary {allowed}"
            )
    return {
        row["case"]: {key: _cell(path, key, text) for key, text in row.items() if key != "case"}
        for row in table.to_dict("records")
    }


def _cell(path: Path, key: str, text: str) -> object:
    try:
        return yaml.safe_load(text)
    except (yaml.YAMLError, ValueError, RecursionError):
        raise SettingsError(f"{text[:80]!r} is no YAML", file=path, key=key) from None


def overridden(base: Mapping, row: Mapping[str, object]) -> dict:
    """Return a copy of ``base`` with the values of ``row``, whose keys have dots."""
    settings = copy.deepcopy(dict(base))
    for key, value in row.items():
        *above, last = key.split(".")
        inner = settings
        for name in above:
            inner = inner.setdefault(name, {})
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
    settings = {
        case: check_settings(overridden(base, row), file=path, key=f"case {case}")
        for case, row in overrides.items()
    }
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

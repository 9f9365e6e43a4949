"""A configuration, checked as a whole before the first job is planned.

An error during planning is too late: if an input function fails, Snakemake concludes that the rule
cannot make its output, and continues with files of an earlier run.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from lfcore.datasets.description import Description
from lfcore.errors import SettingsError, did_you_mean
from lfcore.workflow import cases
from lfcore.workflow.settings import check_settings

if TYPE_CHECKING:
    from lfcore.workflow.sweep import Sweep


@dataclass(frozen=True)
class Plan:
    """A checked configuration: ``settings`` with all keys, ``scenes`` with files by name, and the
    sweep and the data set, if any."""

    settings: dict
    scenes: dict[str, str]
    sweep: Sweep | None
    dataset: Description | None

    @classmethod
    def of(cls, config: Mapping, reports: Collection[str], *, first: bool = True) -> Plan:
        """Check a configuration against the names of ``reports``.

        The ``first`` process of a run also tests the encoder, and the disk's room for a data set;
        its jobs do not, as the disk is filling then.

        Raises a subclass of :class:`LfcoreError` that names the key.
        """
        settings = check_settings(config)
        if settings["reports"] == "all":
            settings["reports"] = list(reports)
        for name in settings["reports"]:
            if name not in reports:
                problem, remedy = f"there is no report {name!r}", did_you_mean(name, reports)
                raise SettingsError(problem, key="configuration: reports", remedy=remedy)
        for views in settings["views"]:
            layout = cases.frame_layout(settings, views)
            if first and settings["store"]:
                cases.check_encoder(cases.encoding(settings, views), layout)
        dataset = sweep = None
        if settings["dataset"]:
            dataset = Description.check(settings["dataset"], key="configuration: dataset")
            dataset.check_files(Path() if first else None)
        if settings["sweep"]:
            from lfcore.workflow.sweep import plan  # loads pandas

            sweep = plan(Path(settings["sweep"]), settings)
        return cls(settings, cases.scene_files(settings["scenes"]), sweep, dataset)

    @cached_property
    def files(self) -> dict[str, str]:
        """The file of every scene: the tables', the sweep's, and the project's."""
        swept = cases.scene_files(self.sweep.scenes) if self.sweep else {}
        return cases.own_scenes() | swept | self.scenes

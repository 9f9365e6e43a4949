"""All that a configuration asks for, checked before the first job is planned.

An error in the middle of planning is too late: Snakemake takes a rule without input for one that
cannot make its output, and goes on with files of an earlier run.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from lfcore.datasets.description import Description
from lfcore.workflow import cases
from lfcore.workflow.settings import check_settings

if TYPE_CHECKING:
    from lfcore.workflow.sweep import Sweep


@dataclass(frozen=True)
class Plan:
    """A checked configuration.

    ``settings`` has all keys, ``scenes`` and ``assignment_scenes`` are files by name.
    """

    settings: dict
    scenes: dict[str, str]
    assignment_scenes: dict[str, str]
    sweep: Sweep | None
    dataset: Description | None

    @classmethod
    def of(cls, config: Mapping, *, room: Path | None = None) -> Plan:
        """Check a configuration, and that the disk of the folder ``room`` can hold its data set.

        Raises a subclass of :class:`LfcoreError` that names the key.
        """
        settings = check_settings(config)
        for views in settings["views"]:
            cases.frame_layout(settings, views)
        dataset = sweep = None
        if settings["dataset"]:
            dataset = Description.check(settings["dataset"])
            dataset.check_files(room)
        if settings["sweep"]:
            from lfcore.workflow.sweep import plan  # loads pandas

            sweep = plan(Path(settings["sweep"]), settings)
        scenes, others = (
            cases.scene_files(one["scenes"]) for one in (settings, settings["assignment"])
        )
        return cls(settings, scenes, others, sweep, dataset)

    @cached_property
    def files(self) -> dict[str, str]:
        """The file of every scene: of the tables, of the assignment, of the sweep, and our own."""
        swept = cases.scene_files(self.sweep.scenes) if self.sweep else {}
        return cases.own_scenes() | swept | self.assignment_scenes | self.scenes

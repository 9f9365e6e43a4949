"""Baked light: irradiance on a scene's surfaces, computed once for all rays."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from lfcore.errors import SceneError
from lfcore.files import read_arrays, whole_file
from lfcore.scene.arrays import check_array

MOST_CELLS = 1 << 20
"""More cells per edge than any grid has: its points would not fit into memory."""
FORMAT = "lfcore light 1"
ASKS = ("sky", "bounces")
"""The keys of a scene.yaml that ask for baked light."""
DARK = 0.25
"""Errors are relative to the light, or to this share of its mean where the light is less."""
NO_SKY = np.zeros((0, 0, 3), np.float32)


@dataclass(frozen=True)
class BakeOptions:
    """Settings of :func:`lfcore.bake`.

    Parameters
    ----------
    bounces : int or "all"
        The number of bounces between matt surfaces; all: until another one changes the light by
        less than the error.
    error : float
        The root mean square error to reach, relative to the light, or to a quarter of its mean
        where the light is less.
    mib : int
        The memory that baking may use, MiB.
    cells : int
        Cells of the first grids per width of the picture.
    """

    bounces: int | Literal["all"] = "all"
    error: float = 0.02
    mib: int = 1024
    cells: int = 32

    @property
    def fineness(self) -> float:
        """The share of first rays and cells: below 1 for errors above 0.06, which need fewer."""
        return min(1.0, math.sqrt(0.06 / self.error))


@dataclass(frozen=True, eq=False)
class BakedLight:
    """Irradiance over pi: the radiance of a white, matt surface.

    Attributes
    ----------
    grids : ndarray
        (T, 3) int32: of each triangle the first point of its grid on the front (where corners run
        counter-clockwise) and on the back, and the grid's cells R per edge.
    values : ndarray
        (P, 3) float32 linear RGB at the points (i, j) with i + j <= R, row by row of j; i / R and
        j / R are the weights of the second and the third corner.
    error : float
        The expected root mean square error in the picture, as in :class:`BakeOptions`; it
        includes the light of omitted bounces.
    rays : int
        The number of traced rays.
    """

    grids: np.ndarray
    values: np.ndarray
    error: float = 0.0
    rays: int = 0

    def __post_init__(self) -> None:
        check_array("grids", self.grids, (None, 3), "integers")
        check_array("values", self.values, (None, 3))
        first, cells = self.grids[:, :2].astype(np.int64), self.grids[:, 2:].astype(np.int64)
        points = np.where(cells < MOST_CELLS, (cells + 1) * (cells + 2) // 2, len(self.values) + 1)
        if (first < 0).any() or (cells < 1).any() or (first + points > len(self.values)).any():
            problem = f"have a grid outside the {len(self.values)} points"
            raise SceneError(problem, key="grids", remedy="Give first points and cells from 1 on")
        if points.sum() * 2 > len(self.values):
            different = np.unique(first * MOST_CELLS + cells) % MOST_CELLS
            if int(((different + 1) * (different + 2) // 2).sum()) > len(self.values):
                raise SceneError("overlap", key="grids", remedy="Share whole grids, or none")

    def save(self, path: str | Path) -> None:
        """Write the light to a file, which appears only when it is whole."""
        with whole_file(path) as file:
            np.savez(file, format=FORMAT, **vars(self))

    @classmethod
    def load(cls, path: str | Path) -> BakedLight:
        """Inverse of :meth:`save`; raises :class:`SceneError` for a missing or damaged file."""

        def read(file: Any) -> BakedLight:
            if str(file["format"]) != FORMAT:
                raise ValueError(f"format {file['format']}")
            return cls(file["grids"], file["values"], float(file["error"]), int(file["rays"]))

        remedy = "Delete it and bake again"
        return read_arrays(path, "file of baked light", read, kind=SceneError, remedy=remedy)

"""Sensor planes while they are formed: exact integer sums, and pictures of them.

Radiance is summed in fixed point, so that the sum of a plane's rays does not depend on the order
of the rays, on tiles or on threads.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError
from lfcore.files import read_arrays, whole_file
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Rectangle, Slab

FIXED_ONE = 1 << 20
"""Radiance 1 in sums of rays up to :data:`SPARE_STOPS` above white: a ray fits in 32 bits."""
SPARE_STOPS = 5
"""The stops above white for which sums keep all 20 fractional bits."""


def one_of_sums(stops: int) -> int:
    """Radiance 1 in sums of rays up to ``stops`` above white."""
    return FIXED_ONE >> max(stops - SPARE_STOPS, 0)


def targets(slab: Slab, plane: SensorPlane) -> np.ndarray:
    """The pixel that the ray of pixel u and lens column i hits: (M, N) int32; rows are alike.

    It is ``floor(u + shift_i + 1/2)`` and may be outside the picture.  Planes that keep the
    magnification, or have their own pixels, are magnified about the centre first.
    """
    return np.arange(slab.pixels, dtype=np.int32)[:, None] + offsets(slab, plane)


def offsets(slab: Slab, plane: SensorPlane) -> np.ndarray:
    """:func:`targets` relative to the pixel: (M, N) int32.

    Without magnification all pixels have the same offsets, (1, N).
    """
    shifts, side = np.clip(plane.shifts(slab), -1e6, 1e6), plane.side(slab)
    scale = plane.magnification(slab) * (side / slab.pixels)
    if scale == 1.0 and side == slab.pixels:
        return np.floor(shifts + 0.5).astype(np.int32)[None, :]
    pixels, centre = np.arange(slab.pixels)[:, None], (slab.pixels - 1) / 2
    moved = (pixels + shifts[None, :] - centre) * scale + (side - 1) / 2
    return np.floor(np.clip(moved, -1e6, 1e6) + 0.5).astype(np.int32) - pixels.astype(np.int32)


def ray_counts(slab: Slab, plane: SensorPlane) -> np.ndarray:
    """The number of recorded rays within the aperture per pixel, (height, width) int64.

    It is A mask B^T: B[x, i] is the number of pixel columns u whose ray through lens column i hits
    pixel column x, and A is the same for rows.
    """
    left, top, width, height = slab.held.pixels
    x, y, across, down = slab.picture(plane.side(slab))
    target = targets(slab, plane)
    columns, column_repeats = _hits(target[left : left + width] - x, across)
    rows, row_repeats = _hits(target[top : top + height] - y, down)
    counts = np.rint(rows @ plane.mask(slab).astype(np.float64) @ columns.T).astype(np.int64)
    return counts.repeat(row_repeats, axis=0).repeat(column_repeats, axis=1)


def _hits(targets: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Count the ``targets`` (M, N) per pixel and lens column, without repeated rows.

    Returns (D, N) float64 counts, and for each row the number of consecutive pixels that have it:
    away from the rim all pixels are alike.
    """
    views = targets.shape[1]
    inside = (targets >= 0) & (targets < size)
    lens = np.broadcast_to(np.arange(views), targets.shape)
    keys = targets[inside].astype(np.int64) * views + lens[inside]
    hits = np.bincount(keys, minlength=size * views).reshape(size, views)
    begins = np.flatnonzero(np.append(True, (hits[1:] != hits[:-1]).any(axis=1)))
    return hits[begins].astype(np.float64), np.diff(np.append(begins, size))


def shown(slab: Slab, planes: Sequence[SensorPlane]) -> Rectangle:
    """The smallest rectangle that contains the pictures of all planes; without planes the slab's.

    Planes of several sizes have different pictures, which do not fit in one array.
    """
    sides = {plane.side(slab) for plane in planes} or {slab.pixels}
    pictures = np.array([slab.picture(side) for side in sides])
    left, top = pictures[:, :2].min(axis=0).tolist()
    right, bottom = (pictures[:, :2] + pictures[:, 2:]).max(axis=0).tolist()
    return left, top, right - left, bottom - top


@dataclass
class PlaneSums:
    """Sums of a slab's rays over a region of some planes.

    Attributes
    ----------
    slab, planes
        The rays and the planes.
    sums : ndarray
        (P, 3, height, width) uint64.
    left, top : int
        The region's first column and row.
    one : float
        Radiance 1.
    """

    slab: Slab
    planes: list[SensorPlane]
    sums: np.ndarray
    left: int = 0
    top: int = 0
    one: float = FIXED_ONE

    @classmethod
    def zeros(cls, slab: Slab, planes: list[SensorPlane], one: float = FIXED_ONE) -> PlaneSums:
        left, top, width, height = shown(slab, planes)
        sums = np.zeros((len(planes), 3, height, width), np.uint64)
        return cls(slab, list(planes), sums, left, top, one)

    def add(self, part: PlaneSums) -> None:
        """Add the sums of other rays of the same slab on the same planes."""
        if (part.slab, part.planes, part.one) != (self.slab, self.planes, self.one):
            raise OpticsError("these partial planes belong to another slab or other planes")
        height, width = part.sums.shape[2:]
        top, left = part.top - self.top, part.left - self.left
        self.sums[:, :, top : top + height, left : left + width] += part.sums

    def with_part(self, part: PlaneSums) -> PlaneSums:
        """Add ``part``, over the smallest region that contains both; may return this object."""
        (height, width), (rows, columns) = self.sums.shape[2:], part.sums.shape[2:]
        left, top = min(self.left, part.left), min(self.top, part.top)
        right = max(self.left + width, part.left + columns)
        bottom = max(self.top + height, part.top + rows)
        both = self
        if (left, top, right - left, bottom - top) != (self.left, self.top, width, height):
            shape = (*self.sums.shape[:2], bottom - top, right - left)
            sums = np.zeros(shape, np.uint64)
            both = PlaneSums(self.slab, self.planes, sums, left, top, self.one)
            both.add(self)
        both.add(part)
        return both

    def pictures(self) -> np.ndarray:
        """(P, height, width, 3) float32, linear light; pixels without rays are black."""
        slab, shape = self.slab, self.sums.shape[2:]
        sides = sorted({plane.side(slab) for plane in self.planes})
        if len(sides) > 1:
            problem = (
                f"planes with {' and '.join(map(str, sides))} pixels cannot be formed together"
            )
            remedy = "Form pictures of one size at a time"
            raise OpticsError(problem, key="pixels", remedy=remedy)
        *_, width, height = shown(slab, self.planes)
        if shape != (height, width):
            raise OpticsError("the planes are incomplete", remedy="Add all tiles first")
        out = np.empty((len(self.planes), *shape, 3), np.float32)
        for picture, plane, sums in zip(out, self.planes, self.sums, strict=True):
            if plane.normalise == "lens":
                view_pixels = (slab.pixels / plane.side(slab)) ** 2
                rays = np.full(shape, slab.views_held().sum() * view_pixels)
            else:
                rays = np.maximum(ray_counts(slab, plane), 1)
            np.divide(
                sums, rays * float(self.one), out=picture.transpose(2, 0, 1), casting="same_kind"
            )
        return out

    def save(self, path: str | Path) -> None:
        """Write region and sums as npz, whole or not at all; not the slab and the planes."""
        with whole_file(path) as file:
            np.savez(file, sums=self.sums, corner=np.array([self.left, self.top]), one=self.one)

    @classmethod
    def load(cls, path: str | Path, slab: Slab, planes: list[SensorPlane]) -> PlaneSums:
        """Inverse of :meth:`save`; raises :class:`LfcoreError` for any other file."""
        return read_arrays(
            path, "file of sums",
            lambda data: cls(
                slab, list(planes), data["sums"],
                int(data["corner"][0]), int(data["corner"][1]), float(data["one"]),
            ),
        )  # fmt: skip


def total(slab: Slab, planes: list[SensorPlane], parts: Iterable[PlaneSums]) -> PlaneSums:
    """The sum of partial sums that together cover the slab."""
    whole: PlaneSums | None = None
    for part in parts:
        whole = whole or PlaneSums.zeros(slab, planes, part.one)
        whole.add(part)
    return whole or PlaneSums.zeros(slab, planes)

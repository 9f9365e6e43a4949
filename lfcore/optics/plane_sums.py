"""Sensor planes while they are formed: exact integer sums, and how to read pictures from them.

Radiance is summed in fixed point, so the sum of a plane's rays is the same in
whatever order and on however many threads or tiles they were added.
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
"""Radiance 1 in sums, where 32 bits hold the brightest ray's."""
SPARE_STOPS = 5
"""Stops above white that sums while tracing hold beside it."""


def one_of_sums(stops: int) -> int:
    """Radiance 1 in sums of rays up to so many stops above white."""
    return FIXED_ONE >> max(stops - SPARE_STOPS, 0)


def targets(slab: Slab, plane: SensorPlane) -> np.ndarray:
    """Pixel that a ray of pixel u and lens column i falls on, perhaps outside the picture: (M, N)
    int32 (rows v, j alike).

    ``floor(u + shift_i + 1/2)``, after magnification about the centre where it is kept or where the
    plane has pixels of its own.
    """
    return np.arange(slab.pixels, dtype=np.int32)[:, None] + offsets(slab, plane)


def offsets(slab: Slab, plane: SensorPlane) -> np.ndarray:
    """:func:`targets` relative to the pixel: (M, N) int32, or (1, N) where all pixels agree,
    which they do unless magnification is kept."""
    shifts, side = np.clip(plane.shifts(slab), -1e6, 1e6), plane.side(slab)
    scale = plane.magnification(slab) * (side / slab.pixels)
    if scale == 1.0 and side == slab.pixels:
        return np.floor(shifts + 0.5).astype(np.int32)[None, :]
    pixels, centre = np.arange(slab.pixels)[:, None], (slab.pixels - 1) / 2
    moved = (pixels + shifts[None, :] - centre) * scale + (side - 1) / 2
    return np.floor(np.clip(moved, -1e6, 1e6) + 0.5).astype(np.int32) - pixels.astype(np.int32)


def ray_counts(slab: Slab, plane: SensorPlane) -> np.ndarray:
    """(height, width) int64: how many recorded rays within the aperture fall on each pixel.

    Separable but for the mask: count = A mask B^T with B[x, i] the number of pixel columns u
    whose ray through lens column i falls on x, and A alike for rows.
    """
    left, top, width, height = slab.held.pixels
    x, y, across, down = slab.picture(plane.side(slab))
    found = targets(slab, plane)
    columns, of_column = _hits(found[left : left + width] - x, across)
    rows, of_row = _hits(found[top : top + height] - y, down)
    counts = np.rint(rows @ plane.mask(slab).astype(np.float64) @ columns.T).astype(np.int64)
    return counts.repeat(of_row, axis=0).repeat(of_column, axis=1)


def _hits(targets: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """(D, N) float64: how many of ``targets`` (M, N) are each of ``size`` pixels, and how many
    pixels, one after the other, are hit alike, as those away from the rim are."""
    views = targets.shape[1]
    inside = (targets >= 0) & (targets < size)
    lens = np.broadcast_to(np.arange(views), targets.shape)
    keys = targets[inside].astype(np.int64) * views + lens[inside]
    hits = np.bincount(keys, minlength=size * views).reshape(size, views)
    begins = np.flatnonzero(np.append(True, (hits[1:] != hits[:-1]).any(axis=1)))
    return hits[begins].astype(np.float64), np.diff(np.append(begins, size))


def shown(slab: Slab, planes: Sequence[SensorPlane]) -> Rectangle:
    """The pixels that the pictures of these planes have, the slab's where there is none.

    Of planes of several sizes those of any, which are no one array.
    """
    sides = {plane.side(slab) for plane in planes} or {slab.pixels}
    pictures = np.array([slab.picture(side) for side in sides])
    left, top = pictures[:, :2].min(axis=0).tolist()
    right, bottom = (pictures[:, :2] + pictures[:, 2:]).max(axis=0).tolist()
    return left, top, right - left, bottom - top


@dataclass
class PlaneSums:
    """Sums (P, 3, height, width) uint64 of rays of a slab on ``planes``, whose radiance 1 is
    ``one``, of the region of the planes that starts at pixel (left, top)."""

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
        """These sums and those of ``part``, over as much of the planes as both reach."""
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
        """(P, height, width, 3) float32, linear light; a pixel that no recorded ray reaches is
        black."""
        slab, shape = self.slab, self.sums.shape[2:]
        sides = sorted({plane.side(slab) for plane in self.planes})
        if len(sides) > 1:
            problem = f"planes of {' and '.join(map(str, sides))} pixels cannot be formed together"
            remedy = "Form pictures of one size at a time"
            raise OpticsError(problem, key="pixels", remedy=remedy)
        if shape != shown(slab, self.planes)[:1:-1]:
            raise OpticsError("the planes are not whole yet", remedy="Add all tiles first")
        out = np.empty((len(self.planes), *shape, 3), np.float32)
        for picture, plane, sums in zip(out, self.planes, self.sums, strict=True):
            if plane.normalise == "lens":
                of_pixel = (slab.pixels / plane.side(slab)) ** 2
                rays = np.full(shape, slab.views_held().sum() * of_pixel)
            else:
                rays = np.maximum(ray_counts(slab, plane), 1)
            np.divide(
                sums, rays * float(self.one), out=picture.transpose(2, 0, 1), casting="same_kind"
            )
        return out

    def save(self, path: str | Path) -> None:
        """Write the region and sums (npz), whole or not at all; slab and planes are the
        configuration's."""
        with whole_file(path) as file:
            np.savez(file, sums=self.sums, corner=np.array([self.left, self.top]), one=self.one)

    @classmethod
    def load(cls, path: str | Path, slab: Slab, planes: list[SensorPlane]) -> PlaneSums:
        """Read what :meth:`save` wrote; raises :class:`LfcoreError` for any other file."""
        return read_arrays(
            path, "file of sums",
            lambda data: cls(
                slab, list(planes), data["sums"],
                int(data["corner"][0]), int(data["corner"][1]), float(data["one"]),
            ),
        )  # fmt: skip


def total(slab: Slab, planes: list[SensorPlane], parts: Iterable[PlaneSums]) -> PlaneSums:
    """The sum of all partial sums, which together must cover the slab."""
    whole: PlaneSums | None = None
    for part in parts:
        whole = whole or PlaneSums.zeros(slab, planes, part.one)
        whole.add(part)
    return whole or PlaneSums.zeros(slab, planes)

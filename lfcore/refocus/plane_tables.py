"""Tables for the kernels that form sensor planes: the targets of rays, and the aperture masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lfcore.optics.plane_sums import shown, targets
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Rectangle, Slab

PLANE = np.dtype([("mask", np.int32), ("targets", np.int32)])
"""A plane: its mask, and its offset into the tables' ``runs``."""
PLANE_ARGUMENTS = np.dtype([
    ("left", np.int32),  # region of the sums in pixels of the planes
    ("top", np.int32),
    ("width", np.int32),
    ("height", np.int32),
    ("size", np.int32),  # side M of the square grid of pixels
    ("column", np.int32),  # the pixels of a view: first column and row, and their numbers
    ("row", np.int32),
    ("columns", np.int32),
    ("rows", np.int32),
    ("strips", np.int32),  # of the rows of a macropixel
    ("views", np.int32),  # side N of the lens
    ("planes", np.int32),  # sorted by mask
])  # fmt: skip
"""The arguments of kernels that form planes."""

Corners = tuple[int, int, int, int]
"""First column and row, and the column and row after the last."""


@dataclass(frozen=True)
class PlaneTables:
    """Planes of a slab, for views.

    Attributes
    ----------
    order : ndarray
        The kernel's plane k is ``planes[order[k]]``.  Planes with the same mask are neighbours.
    info : ndarray
        A record PLANE per plane of the kernel.
    runs : ndarray
        int32: the targets of all pixels, per plane and lens column.
    masks : ndarray
        (masks, N, N) uint8, indexed [j, i]: 255 where open.
    left, top, width, height : int
        The region of the planes that the rays can hit.
    """

    order: np.ndarray
    info: np.ndarray
    runs: np.ndarray
    masks: np.ndarray
    left: int
    top: int
    width: int
    height: int

    strips = 0
    """The strips of lens rows in a macropixel; views have none."""

    @property
    def arrays(self) -> tuple[np.ndarray, ...]:
        """The kernel's arguments, in its order."""
        return self.info, self.runs, self.masks


def reached_region(
    slab: Slab, planes: Sequence[SensorPlane], moves_of: Sequence[np.ndarray], corners: Corners
) -> Rectangle:
    """The pixels that a tile's rays can hit; ``moves_of`` are each plane's :func:`offsets`."""
    u0, v0, u1, v1 = corners
    low, high = [slab.pixels, slab.pixels], [0, 0]
    for moves in moves_of:
        for axis, (first, last) in enumerate(((u0, u1), (v0, v1))):
            part = moves if len(moves) == 1 else moves[first:last]
            pixels = np.arange(first, last)
            low[axis] = min(low[axis], int((pixels + part.min(axis=1)).min()))
            high[axis] = max(high[axis], int((pixels + part.max(axis=1)).max()) + 1)
    picture = shown(slab, planes)
    corner, size = np.array(picture[:2]), np.array(picture[2:])
    (left, top), end = (np.clip(edge, corner, corner + size).tolist() for edge in (low, high))
    return left, top, max(end[0] - left, 0), max(end[1] - top, 0)


def view_tables(slab: Slab, planes: Sequence[SensorPlane]) -> PlaneTables:
    """Tables for views: ``runs`` has the target of every pixel, per plane and lens column."""
    masks, mask_of = distinct_masks(slab, planes)
    order = np.argsort(mask_of, kind="stable")
    info = np.zeros(len(planes), PLANE)
    info["mask"] = mask_of[order]
    info["targets"] = np.arange(len(planes)) * (slab.views * slab.pixels)
    runs = [np.ascontiguousarray(targets(slab, planes[k]).T).reshape(-1) for k in order]
    flat = np.concatenate(runs) if runs else np.zeros(0, np.int32)
    return PlaneTables(order, info, flat, masks, *shown(slab, planes))


def distinct_masks(slab: Slab, planes: Sequence[SensorPlane]) -> tuple[np.ndarray, np.ndarray]:
    """The planes' different masks, (masks, N, N) uint8 0 or 255, and each plane's mask number."""
    openings = [plane.lens_aperture(slab) for plane in planes]
    plane_of = dict(zip(openings, planes, strict=True))
    bits = {opening: plane.mask(slab).tobytes() for opening, plane in plane_of.items()}
    number = {mask: k for k, mask in enumerate(dict.fromkeys(bits.values()))}
    masks = np.frombuffer(b"".join(number), np.uint8).reshape(-1, slab.views, slab.views) * 255
    return masks, np.array([number[bits[opening]] for opening in openings], np.int64)

"""Tables for the kernels that form sensor planes: the targets of rays, and the aperture masks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lfcore.opencl.interface import FLOAT, INT, given, read, write
from lfcore.optics.plane_sums import shown, targets
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Ends, Rectangle, Slab

PLANE = np.dtype([("mask", INT), ("targets", INT)])
"""A plane of views: its mask, and its first target."""
PLANE_ARGUMENTS = np.dtype([
    ("left", INT),  # region of the sums in pixels of the planes
    ("top", INT),
    ("width", INT),
    ("height", INT),
    ("size", INT),  # side M of the square grid of pixels
    ("column", INT),  # the pixels of a view: first column and row, and their numbers
    ("row", INT),
    ("columns", INT),
    ("rows", INT),
    ("strips", INT),  # of the rows of a macropixel
    ("views", INT),  # side N of the lens
    ("planes", INT),  # sorted by mask
    ("elements", INT),  # whose rays are added
    ("rays_width", INT),  # of a frame, of a traced view, or of the traced rays of a macropixel
    ("rays_height", INT),
    ("halved", INT),  # of frames: whether chroma has half the width and height
    ("is_rgb", INT),
    ("brightest", FLOAT),  # traced light
    ("one", FLOAT),  # light 1 in fixed point
    ("coarse", INT),  # whether sums give up last bits
    ("scratch_words", INT),  # of a worker
])  # fmt: skip
"""The arguments of kernels that form planes."""
# placements (E,); sums (workers, planes, height, width) of red, green, blue and 0.
KERNEL = (
    read(rays="stored", placements="Placement", masks="uchar")
    | given(numbers="SensorPlaneArguments")
    | write(next="int", scratch="uint", sums="ulong4")
)
"""The parameters of all kernels that form planes."""
VIEW_KERNEL = KERNEL | read(planes="SensorPlane", targets="int")
"""Those of views, with the tables of :func:`view_tables`."""


@dataclass(frozen=True)
class PlaneTables:
    """Tables of a slab's planes.

    Attributes
    ----------
    order : ndarray
        The kernel's plane k is ``planes[order[k]]``.  Planes with the same mask are neighbours.
    region : tuple of int
        The left and top, width and height of the part of the planes that the rays can hit.
    arrays : dict
        The kernel's arguments.  ``masks`` (masks, N, N) is uint8, indexed [j, i]: 255 where open.
    strips : int
        The strips of lens rows in a macropixel; views have none.
    """

    order: np.ndarray
    region: Rectangle
    arrays: dict[str, np.ndarray]
    strips: int = 0


def reached_region(
    slab: Slab, planes: Sequence[SensorPlane], moves_of: Sequence[np.ndarray], corners: Ends
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
    """Tables for views: ``targets`` of all pixel columns, per plane and lens column; rows alike."""
    masks, mask_of = distinct_masks(slab, planes)
    order = np.argsort(mask_of, kind="stable")
    records = np.zeros(len(planes), PLANE)
    records["mask"] = mask_of[order]
    records["targets"] = np.arange(len(planes)) * (slab.views * slab.pixels)
    parts = [np.ascontiguousarray(targets(slab, planes[k]).T).reshape(-1) for k in order]
    flat = np.concatenate([*parts, np.zeros(0, np.int32)])
    arrays = {"planes": records, "targets": flat, "masks": masks}
    return PlaneTables(order, shown(slab, planes), arrays)


def distinct_masks(slab: Slab, planes: Sequence[SensorPlane]) -> tuple[np.ndarray, np.ndarray]:
    """The planes' different masks, (masks, N, N) uint8 0 or 255, and each plane's mask number."""
    openings = [plane.lens_aperture(slab) for plane in planes]
    plane_of = dict(zip(openings, planes, strict=True))
    bits = {opening: plane.mask(slab).tobytes() for opening, plane in plane_of.items()}
    number = {mask: k for k, mask in enumerate(dict.fromkeys(bits.values()))}
    masks = np.frombuffer(b"".join(number), np.uint8).reshape(-1, slab.views, slab.views) * 255
    return masks, np.array([number[bits[opening]] for opening in openings], np.int64)

"""Visible depths of a scene, without a device: a coarse depth map by numpy.

A ray through the lens centre with tangents (x, y) hits the triangle v0 v1 v2 if (x, y, 1) has the
same sign against the three planes through the lens centre and an edge.  So triangles on both sides
of the lens need no clipping.  Source: Olano and Greer, "Triangle Scan Conversion using 2D
Homogeneous Coordinates", Graphics Hardware 1997.
"""

from collections.abc import Sequence

import numpy as np

from lfcore.optics.focus import DepthRange, check_place, check_surface, ends_of
from lfcore.optics.size import Pixels, Size
from lfcore.scene.arrays import columnwise

SIDE = 64
"""The rays per side of the coarse picture."""
PAIRS_AT_A_TIME = 1 << 19
"""The pairs of triangle and ray that are tested at a time."""
Ticks = tuple[np.ndarray, np.ndarray]
"""The tangents of the rays' columns and rows, evenly spaced."""


def depth_range(triangles: np.ndarray, width: float) -> DepthRange | None:
    """The depths that a picture of tangent extent ``width`` shows, without its nearest and farthest
    2 percent; None if no ray has a hit and no vertex is in the picture."""
    ticks = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * width
    depth = _depths(triangles, (ticks, ticks))
    depth = depth[np.isfinite(depth)]
    if not len(depth):  # wires between the rays
        points = triangles.reshape(-1, 3).astype(np.float64)
        z = points[:, 2]
        inside = (z > 0) & (np.abs(points[:, :2]).max(1, initial=0.0) <= width / 2 * z)
        depth = z[inside]
    return ends_of(depth)


def focus_at(
    triangles: np.ndarray, width: float, place: Sequence[float], pixels: Pixels = 1
) -> float:
    """The depth at a place of the picture, metres, as in a camera's autofocus.

    ``width`` is the tangent extent of the shorter side of a picture of ``pixels``.
    """
    (x, y), size = check_place(place), Size.of(pixels)
    column, row = (
        np.array([(share - 0.5) * width * (side / size.shorter)])
        for share, side in zip((x, y), size, strict=True)
    )
    return check_surface(float(_depths(triangles, (column, row))[0, 0]), (x, y))


def _depths(triangles: np.ndarray, ticks: Ticks) -> np.ndarray:
    """Depths (R, C) of the rays; inf for a miss."""
    columns, rows = map(len, ticks)
    nearest = np.full(rows * columns, np.inf)
    before = columnwise(np.logical_or, triangles[:, :, 2] > 0)
    corners = (triangles if before.all() else triangles[before]).astype(np.float64, copy=False)
    first, count = _boxes(corners, ticks)
    met = np.flatnonzero(count[:, 0] * count[:, 1])
    corners, first, count = corners[met], first[met], count[met]
    pairs = np.concatenate([[0], np.cumsum(count[:, 0] * count[:, 1])])
    start = 0
    while start < len(corners):
        end = int(np.searchsorted(pairs, pairs[start] + PAIRS_AT_A_TIME, "right")) - 1
        part = slice(start, max(end, start + 1))
        _draw(nearest, corners[part], first[part], count[part], ticks)
        start = part.stop
    return nearest.reshape(rows, columns)


def _boxes(corners: np.ndarray, ticks: Ticks) -> tuple[np.ndarray, np.ndarray]:
    """First column and row, and numbers of columns and rows, (T, 2) each, around triangles."""
    z = corners[:, :, 2]
    whole = ~columnwise(
        np.logical_and, z > 0
    )  # triangles that cross the plane of the lens can be anywhere
    first, count = np.empty((2, len(corners), 2), np.int64)
    for axis, places in enumerate(ticks):
        tangents = corners[:, :, axis] / np.where(z > 0, z, 1.0)
        # Rounding may leave out a ray on an edge, which the neighbour has as well.
        low = np.searchsorted(places, columnwise(np.minimum, tangents), "left")
        high = np.searchsorted(places, columnwise(np.maximum, tangents), "right")
        first[:, axis] = np.where(whole, 0, low)
        count[:, axis] = np.where(whole, len(places), high - low)
    return first, count


def _draw(
    nearest: np.ndarray, corners: np.ndarray, first: np.ndarray, count: np.ndarray, ticks: Ticks
) -> None:
    """Lower ``nearest`` to the depths of ``corners`` (K, 3, 3) at the rays of their boxes."""
    columns, rows = ticks
    # Scaled to about 1, so that products of three lengths neither overflow nor vanish.
    size = np.abs(corners).max()
    v = corners / size
    planes = np.stack([np.cross(v[:, (k + 1) % 3], v[:, (k + 2) % 3]) for k in range(3)], 1)
    volume = (v[:, 0] * planes[:, 0]).sum(-1)
    counts = count.prod(1)
    owner = np.repeat(np.arange(len(corners)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    row, column = np.divmod(within, count[owner, 0])
    column, row = column + first[owner, 0], row + first[owner, 1]
    rays = np.stack([columns[column], rows[row], np.ones(len(owner))], -1)
    sides = np.einsum("kvc,kc->kv", planes[owner], rays)
    inside = (sides >= 0).all(1) | (sides <= 0).all(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = volume[owner] / sides.sum(1) * size
    hit = inside & (depth > 0) & np.isfinite(depth)
    np.minimum.at(nearest, (row * len(columns) + column)[hit], depth[hit])

"""Pictures from rays of known depth, each spread over what its cell sweeps: float64, slow.

The reference for :mod:`lfcore.refocus.depth_slicing`, with which it shares the cells of lens
samples (``lens_cells``) and the magnification, and no other code.

A ray stands for a cell: ``ds`` of the lens and a part of a pixel.  A surface that it meets at
depth z moves on the plane focused at 1 / delta' by ``(delta' - 1/z) ds`` while the lens point
crosses the cell.  So the ray's light is spread evenly over a box of that side about the place
where it falls.  What lies behind adds to a pixel only what nearer light has left of it.

Where pixels of the views are large in the picture, boxes are whole numbers of them wide, so that
they overlap evenly: each ray has two, of the numbers below and above its side, with weights by
which the mean is its side.
"""

import numpy as np

from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import ViewSet, lens_cells
from lfcore.optics.slab import Slab


def slice_by_depth(
    views: ViewSet,
    plane: SensorPlane,
    light: np.ndarray,
    depth: np.ndarray,
    pixels: int,
    *,
    least_px: float,
    bounds_px: tuple[float, ...],
    coarse_px: float = np.inf,
    edge_steps: int | None = None,
    least_weight: float = 0.0,
) -> np.ndarray:
    """One picture (H, W, 3) float64, linear light; ``pixels`` are those of its longer side.

    Rays have radiance ``light`` (K, rows, columns, 3), at most 1, and ``depth`` (K, rows,
    columns), infinity for a miss.  Their boxes have sides of ``least_px`` at least; edges are
    rounded to a part of a pixel if ``edge_steps`` are given.  ``bounds_px`` are sweeps that part
    the layers, rising: what is swept by less than the first is in focus; what lies before and
    behind it has a layer for every further bound.  A layer of less than ``least_weight`` in a pixel
    has no light there.
    """
    slab, scale = views.slab, plane.magnification(views.slab)
    cells = lens_cells(slab, plane.lens_aperture(slab))
    pitch = slab.camera.field_width / pixels
    layers = 2 * len(bounds_px) + 1
    *corner, width, height = slab.picture(pixels)
    total = np.zeros((layers, height, width, 4))
    room = np.zeros((layers, height, width))
    for k, (at, displacement) in enumerate(zip(views.positions, views.displacement, strict=True)):
        if not cells.share[k]:
            continue
        across, down = (
            _places(slab, plane, at[axis], displacement[axis], pixels, axis) - corner[axis]
            for axis in range(2)
        )
        for number in range(layers):
            each = _typical(abs(number - len(bounds_px)), bounds_px) * cells.extent[k]
            sides = each / slab.lens_pitch_m
            reached = _covered(down, height, sides[1]), _covered(across, width, sides[0])
            room[number] += cells.share[k] * np.outer(*reached)
        # How far a point seen moves on the plane, in pixels a metre of the lens.
        moves = (plane.delta - 1.0 / depth[k].astype(float)) * scale / pitch
        layer = _layer(moves * slab.lens_pitch_m, bounds_px)
        step = np.diff(across)[0]
        sides = [np.maximum(np.abs(moves) * extent, least_px) for extent in cells.extent[k]]
        colour = np.ones((layer.size, 4))
        colour[:, :3] = np.minimum(light[k].reshape(-1, 3), 1)
        for grown, weight in _even(np.maximum(*sides) / step, step > coarse_px):
            boxes = []
            for axis, place in enumerate((across[None, :-1], down[:-1, None])):
                half = grown * sides[axis] / 2
                middle = place + step / 2 + (cells.middle[k, axis] - at[axis]) * moves
                edges = [middle - half, middle + half]
                if edge_steps:
                    edges = [np.rint(edge * edge_steps) / edge_steps for edge in edges]
                boxes.append(_shares(edges[0].ravel(), edges[1].ravel(), (width, height)[axis]))
            for number in range(layers):
                rays = (layer == number).ravel()
                rows = boxes[1][rays] * weight.reshape(-1, 1)[rays]
                parts = boxes[0][rays][..., None] * colour[rays][:, None]
                total[number] += cells.share[k] * np.tensordot(rows, parts, (0, 0))
    total[total[..., 3] < least_weight] = 0
    room *= (slab.pixels / pixels / scale) ** 2
    return _composed(total, room)


def _even(side: np.ndarray, coarse: bool) -> list[tuple[np.ndarray, np.ndarray]]:
    """Boxes of every ray: the side over that given, in pixels of the views, and the weight."""
    if not coarse:
        return [(np.ones(side.shape), np.ones(side.shape))]
    whole = np.maximum(side, 1)
    below = np.floor(whole)
    return [(below / side, 1 - (whole - below)), ((below + 1) / side, whole - below)]


def _places(
    slab: Slab, plane: SensorPlane, at: float, displacement: float, pixels: int, axis: int
) -> np.ndarray:
    """(S + 1,) edges of the views' pixels along an axis, in pixels of the picture's square grid."""
    first, count = slab.held.pixels[axis], slab.held.pixels[2 + axis]
    size, scale = slab.pixels, plane.magnification(slab)
    tangent = (first + np.arange(count + 1) + displacement - size / 2) * slab.pixel_pitch
    moved = (tangent + at * (plane.delta - slab.camera.delta)) * scale
    return moved / (slab.camera.field_width / pixels) + pixels / 2


def _typical(away: int, bounds: tuple[float, ...]) -> float:
    """The sweep of a layer's rays, by its number from the plane's: hardly any up to 1."""
    ends = [*bounds, 2 * bounds[-1]] if bounds else []
    return np.sqrt(ends[away - 1] * ends[away]) if away > 1 else 0.0


def _covered(edges: np.ndarray, pixels: int, side: float) -> np.ndarray:
    """(pixels,) weight of a pixel from light between the first and the last of ``edges``, spread
    over a box of that side."""
    places = ((np.arange(64) + 0.5) / 64 * side - side / 2)[:, None] if side else 0.0
    left = np.arange(pixels)[None]
    ends = np.minimum(edges[-1] + places, left + 1), np.maximum(edges[0] + places, left)
    return np.clip(ends[0] - ends[1], 0, 1).mean(axis=0)


def _shares(low: np.ndarray, high: np.ndarray, pixels: int) -> np.ndarray:
    """(R, pixels): part of the box [low, high] that lies in each pixel."""
    left = np.arange(pixels)[None, :]
    inside = np.minimum(high[:, None], left + 1) - np.maximum(low[:, None], left)
    return np.maximum(inside, 0) / (high - low)[:, None]


def _layer(sweep: np.ndarray, bounds: tuple[float, ...]) -> np.ndarray:
    """(R,) number of the layer, the nearest first; ``sweep`` is negative before the plane."""
    beyond = np.searchsorted(np.array(bounds), np.abs(sweep), side="right")
    return len(bounds) + np.where(sweep < 0, -beyond, beyond)


def _composed(total: np.ndarray, room: np.ndarray) -> np.ndarray:
    """The layers front to back, each taking no more of a pixel than those before it left; what a
    pixel then lacks is given to all but the first, at most as much as they have."""
    left, colour, first = (np.zeros((*room.shape[1:], each)) for each in (1, 4, 4))
    left += 1
    for layer in total * np.where(room > 1e-6, 1 / np.maximum(room, 1e-6), 0)[..., None]:
        used = np.minimum(layer[..., 3:], left)
        colour += layer * (used / np.maximum(layer[..., 3:], 1e-300))
        left -= used
        first = np.where(first[..., 3:] > 0, first, colour)
    behind = colour - first
    lacks = np.minimum(left, behind[..., 3:])
    colour += behind * (lacks / np.maximum(behind[..., 3:], 1e-300))
    return colour[..., :3] / np.maximum(colour[..., 3:], 1e-300)

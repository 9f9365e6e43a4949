"""Sample blocks of a job, from which the plan is made: how many leaves and triangles they meet."""

from collections.abc import Callable

import numpy as np

from lfcore.optics.bundles import Bundles
from lfcore.tracing.layouts import BLOCK

PROBED_BLOCKS = 16
OUTER = (1, 2, 4)
"""The numbers of elements along each axis that a block can span."""


def probed_elements(bundles: Bundles) -> np.ndarray:
    """(up to PROBED_BLOCKS, 4) float32: the elements, spread evenly, whose blocks stand for all."""
    last = len(bundles.elements) - 1
    return bundles.elements[np.unique(np.linspace(0, last, PROBED_BLOCKS).astype(int))]


def leaves_a_ray(leaf_boxes: np.ndarray, bundles: Bundles, outer: int = 1) -> float:
    """The mean number of leaves per ray that a block of at most 256 rays meets.

    ``leaf_boxes`` is (L, 6).  PROBED_BLOCKS blocks of ``outer`` x ``outer`` elements are counted,
    spread evenly over elements and inner grid, without occlusion, so that the same bundles always
    give the same number.
    """
    lo, hi = leaf_boxes[:, :3], leaf_boxes[:, 3:]
    depths = np.maximum(np.stack([lo[:, 2], hi[:, 2]]), 0)
    size, inner = np.array([bundles.columns, bundles.rows]), BLOCK // outer
    blocks = -(-size // inner)
    half = ((np.minimum(size, inner) - 1) / 2).astype(np.float32)
    among = 0.0
    lattice = bundles.lattice
    if outer > 1 and lattice is not None:
        among = (outer - 1) / 2 * np.abs(lattice.origin + depths * lattice.direction)
    chosen, count = probed_elements(bundles), 0
    for number, element in enumerate(chosen):
        place = number % blocks[0], number // blocks[0] % blocks[1]
        meets = hi[:, 2] > 0
        for axis in (0, 1):
            middle = np.float32(place[axis] * inner + half[axis] - (size[axis] - 1) / 2)
            step, tilt = bundles.step[axis], bundles.step[2 + axis]
            centre = element[axis] + middle * step + depths * (element[2 + axis] + middle * tilt)
            reach = half[axis] * np.abs(step + depths * tilt) + among
            meets &= lo[:, axis] <= (centre + reach).max(0)
            meets &= hi[:, axis] >= (centre - reach).min(0)
        count += int(meets.sum())
    return count / len(chosen) / float(np.prod(2 * half + 1) * outer**2)


SPANNING_COST = {"HITS": 6.5, "FRAMES": 1.6}
"""The additional cost of a block that spans several elements, in triangles hit: measured for N = 16
to 64, M = 128 and 512 on three scenes."""
PLACES = 4


def probed_blocks(bundles: Bundles, outer: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions of the rays of some blocks of ``outer`` x ``outer`` elements.

    (B, 256, 3) float32 each; PLACES blocks about each of :func:`probed_elements`, spread over the
    inner grid: the same for equal bundles.
    """
    assert bundles.lattice is not None
    inner, elements = BLOCK // outer, probed_elements(bundles)
    number = np.arange(len(elements) * PLACES)
    down, across = -(-bundles.rows // inner), -(-bundles.columns // inner)
    place = number * (down * across) // len(number)
    first = np.stack([place % across, place // across], 1) * inner
    middle = first - (np.array([bundles.columns, bundles.rows]) - 1) / 2
    i, u = np.tile(np.arange(inner), outer), np.repeat(np.arange(outer) - (outer - 1) / 2, inner)
    rays = []
    for part, among in enumerate((bundles.lattice.origin, bundles.lattice.direction)):
        element = np.repeat(elements[:, 2 * part : 2 * part + 2], PLACES, 0)
        out = np.full((len(number), BLOCK, BLOCK, 3), float(part))
        for axis in (0, 1):
            step = bundles.step[2 * part + axis]
            line = (middle[:, axis, None] + i) * step + u * among + element[:, axis, None]
            out[..., axis] = line[:, None, :] if axis == 0 else line[:, :, None]
        rays.append(out.reshape(len(number), -1, 3).astype(np.float32))
    return rays[0], rays[1]


def best_outer(
    closest_hit: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]],
    bundles: Bundles,
    sink: str,
) -> int:
    """Elements along each axis that a block best spans, for a sink of SPANNING_COST.

    Decided by how many triangles the rays of some blocks meet, of ``closest_hit``: what can be seen
    decides, and not how it is sorted.
    """
    least, best = np.inf, 1
    for outer in OUTER:
        if min(bundles.columns, bundles.rows) < BLOCK // outer and outer > 1:
            continue
        cost = SPANNING_COST[sink] if outer > 1 else 0.0
        if cost >= least:
            break
        origins, directions = probed_blocks(bundles, outer)
        ids = closest_hit(origins.reshape(-1, 3), directions.reshape(-1, 3))[0]
        ids = np.sort(ids.reshape(len(origins), -1), 1)
        new = (ids[:, 1:] != ids[:, :-1]) & (ids[:, 1:] >= 0)
        cost += float((new.sum(1) + (ids[:, 0] >= 0)).mean())
        if cost < least:
            least, best = cost, outer
    return best

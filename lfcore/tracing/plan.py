"""The choice of packets for a scene's rays, from their number and the leaves that they may hit."""

import numpy as np

from lfcore.opencl.interface import BLOCK
from lfcore.optics.bundles import Bundles, macropixels, views
from lfcore.optics.slab import Slab
from lfcore.tracing.packets import PacketShape

PROBED_BLOCKS = 16
"""The most sampled elements, and the sampled blocks of :func:`mean_leaves_per_ray`."""
SPANNED = 4
"""The elements along each axis of a block that spans several."""
MOST_SPANNED = 24
"""The largest side of an inner grid whose blocks span elements: measured, see docs/decisions.md."""


def probed_elements(bundles: Bundles) -> np.ndarray:
    """(up to PROBED_BLOCKS, 4) float32: the sampled elements, spread evenly."""
    last = len(bundles.elements) - 1
    return bundles.elements[np.unique(np.linspace(0, last, PROBED_BLOCKS).astype(int))]


def mean_leaves_per_ray(leaf_boxes: np.ndarray, bundles: Bundles, outer: int = 1) -> float:
    """The mean number of leaves per ray that a block of at most 256 rays overlaps.

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
        block = number % blocks[0], number // blocks[0] % blocks[1]
        overlaps = hi[:, 2] > 0
        for axis in (0, 1):
            offset = np.float32(block[axis] * inner + half[axis] - (size[axis] - 1) / 2)
            step, tilt = bundles.step[axis], bundles.step[2 + axis]
            centre = element[axis] + offset * step + depths * (element[2 + axis] + offset * tilt)
            reach = half[axis] * np.abs(step + depths * tilt) + among
            overlaps &= lo[:, axis] <= (centre + reach).max(0)
            overlaps &= hi[:, axis] >= (centre - reach).min(0)
        count += int(overlaps.sum())
    return count / len(chosen) / float(np.prod(2 * half + 1) * outer**2)


def probe(slab: Slab, macro: bool = True) -> Bundles:
    """A few elements, macropixels or views, spread evenly: the same for all tiles of a slab."""
    left, top, width, height = slab.held.pixels if macro else (0, 0, slab.views, slab.views)
    columns_rows = [
        first + (2 * np.arange(side := min(4, size)) + 1) * size // (2 * side)
        for first, size in ((left, width), (top, height))
    ]
    grid = np.stack(np.meshgrid(*columns_rows), axis=-1).reshape(-1, 2)
    return macropixels(slab, grid) if macro else views(slab, grid)


SINGLE_RAY_LEAVES = 2.5
"""The leaves per ray of a block above which single rays are faster: measured."""


def _plan_key(bundles: Bundles) -> tuple:
    """The bundles' properties that decisions depend on: equal bundles have equal plans."""
    grid = bundles.columns, bundles.rows, bundles.lattice, bundles.step.tobytes()
    return *grid, probed_elements(bundles).tobytes()


class Plan:
    """The choice of packets for the rays of a scene.

    Parameters
    ----------
    leaf_boxes : (L, 6) of the scene's hierarchy.
    spanning, single_rays : fixed choices; default: the faster ones.
    """

    def __init__(
        self,
        leaf_boxes: np.ndarray,
        *,
        spanning: bool | None = None,
        single_rays: bool | None = None,
    ):
        self._leaf_boxes = leaf_boxes
        self._spanning, self._single_rays = spanning, single_rays
        self._cache: dict[tuple, bool] = {}

    def shape(self, bundles: Bundles, *, grouped: bool = True) -> PacketShape:
        """The shape of these rays' packets.

        ``grouped``: whether the elements' coordinates are known.  On a lattice, elements can then
        share blocks.
        """
        outer = self._outer(bundles) if grouped else 1
        single = self.single_rays(bundles, outer)
        inner = max(bundles.columns, bundles.rows)
        return PacketShape.for_inner(inner, 1 if single else outer, single)

    def _outer(self, bundles: Bundles) -> int:
        """Elements along each axis that a block spans."""
        if bundles.lattice is None:
            return 1
        spanning = max(bundles.columns, bundles.rows) <= MOST_SPANNED
        return SPANNED if (spanning if self._spanning is None else self._spanning) else 1

    def single_rays(self, bundles: Bundles, outer: int = 1) -> bool:
        """Whether blocks of these rays overlap so many leaves that single rays are faster.

        Never for elements of one ray: such rays may be anywhere, and must not change how their
        neighbours are traced.
        """
        if self._single_rays is not None:
            return self._single_rays
        if bundles.columns * bundles.rows == 1:
            return False
        key = outer, *_plan_key(bundles)
        if key not in self._cache:
            self._cache[key] = (
                mean_leaves_per_ray(self._leaf_boxes, bundles, outer) > SINGLE_RAY_LEAVES
            )
        return self._cache[key]

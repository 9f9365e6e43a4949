"""The choice of packets for a scene's rays, from the leaves and triangles that sample blocks
hit."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.interface import BLOCK
from lfcore.optics.bundles import Bundles, macropixels, views
from lfcore.optics.slab import Slab
from lfcore.tracing.packets import PacketShape

PROBED_BLOCKS = 16
"""The most sampled elements, and the sampled blocks of :func:`mean_leaves_per_ray`."""
OUTER = (1, 2, 4)
"""The numbers of elements along each axis that a block can span."""


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


SPANNING_COST = 6.5
"""The additional cost of a block that spans several elements, in triangles hit: measured for N = 16
to 64, M = 128 and 512 on three scenes."""
BLOCKS_EACH = 4
"""The sampled blocks per sampled element."""


def probed_blocks(bundles: Bundles, outer: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions of the rays of some blocks of ``outer`` x ``outer`` elements.

    (B, 256, 3) float32 each; BLOCKS_EACH blocks of each of :func:`probed_elements`, spread over the
    inner grid: the same for equal bundles.
    """
    assert bundles.lattice is not None
    inner, elements = BLOCK // outer, probed_elements(bundles)
    number = np.arange(len(elements) * BLOCKS_EACH)
    down, along = -(-bundles.rows // inner), -(-bundles.columns // inner)
    block = number * (down * along) // len(number)
    first = np.stack([block % along, block // along], 1) * inner
    offset = first - (np.array([bundles.columns, bundles.rows]) - 1) / 2
    i, u = np.tile(np.arange(inner), outer), np.repeat(np.arange(outer) - (outer - 1) / 2, inner)
    rays = []
    for part, among in enumerate((bundles.lattice.origin, bundles.lattice.direction)):
        element = np.repeat(elements[:, 2 * part : 2 * part + 2], BLOCKS_EACH, 0)
        out = np.full((len(number), BLOCK, BLOCK, 3), float(part))
        for axis in (0, 1):
            step = bundles.step[2 * part + axis]
            line = (offset[:, axis, None] + i) * step + u * among + element[:, axis, None]
            out[..., axis] = line[:, None, :] if axis == 0 else line[:, :, None]
        rays.append(out.reshape(len(number), -1, 3).astype(np.float32))
    return rays[0], rays[1]


def best_outer(
    closest_hit: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]],
    bundles: Bundles,
) -> int:
    """The best number of elements along each axis of a block.

    The criterion is the number of triangles that the rays of some blocks hit, from
    ``closest_hit``: it does not depend on the hierarchy.
    """
    least, best = np.inf, 1
    for outer in OUTER:
        if min(bundles.columns, bundles.rows) < BLOCK // outer and outer > 1:
            continue
        cost = SPANNING_COST if outer > 1 else 0.0
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
    closest_hit : the first hits of rays (R, 3), :meth:`Tracer.closest_hit`.
    outer, single_rays : fixed choices; default: the faster ones.

    Raises
    ------
    OpticsError : ``outer`` is none of :data:`OUTER`.
    """

    def __init__(
        self,
        leaf_boxes: np.ndarray,
        closest_hit: Callable,
        *,
        outer: int | None = None,
        single_rays: bool | None = None,
    ):
        if outer is not None and outer not in OUTER:
            raise OpticsError(f"must be one of {OUTER}, not {outer!r}", key="outer")
        self._leaf_boxes, self._closest_hit = leaf_boxes, closest_hit
        self._forced_outer, self._forced_single = outer, single_rays
        self._cache: dict[tuple, int] = {}

    def shape(self, bundles: Bundles, *, grouped: bool = True) -> PacketShape:
        """The shape of these rays' packets.

        ``grouped``: whether the elements' coordinates are known.  Elements can then share packets,
        and on a lattice blocks.
        """
        outer = self.outer(bundles) if grouped else 1
        single = self.single_rays(bundles, outer)
        inner = max(bundles.columns, bundles.rows)
        shape = PacketShape.for_inner(inner, 1 if single else outer, single)
        return shape if grouped else replace(shape, group_side=1)

    def outer(self, bundles: Bundles) -> int:
        """Elements along each axis that a block spans."""
        if bundles.lattice is None:
            return 1
        if self._forced_outer is not None:
            return self._forced_outer
        key = _plan_key(bundles)
        if key not in self._cache:
            self._cache[key] = best_outer(self._closest_hit, bundles)
        return self._cache[key]

    def single_rays(self, bundles: Bundles, outer: int = 1) -> bool:
        """Whether blocks of these rays overlap so many leaves that single rays are faster.

        Never for elements of one ray: such rays may be anywhere, and must not change how their
        neighbours are traced.
        """
        if self._forced_single is not None:
            return self._forced_single
        if bundles.columns * bundles.rows == 1:
            return False
        key = outer, *_plan_key(bundles)
        if key not in self._cache:
            self._cache[key] = (
                mean_leaves_per_ray(self._leaf_boxes, bundles, outer) > SINGLE_RAY_LEAVES
            )
        return bool(self._cache[key])

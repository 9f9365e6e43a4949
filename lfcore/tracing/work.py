"""How rays are cut into beams, and what a worker needs to trace them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.optics.bundles import Bundles

BLOCK = 16


@dataclass(frozen=True)
class BeamShape:
    """A beam: ``group`` x ``group`` outer elements times ``side`` x ``side`` blocks of 256 rays.

    A block is 16 x 16 rays of one element, or ``16 / outer`` along each axis of ``outer`` elements
    (then ``group`` is ``outer``).  ``half`` is half the extent of its inner rays in use, from its
    centre.  ``scattered`` beams follow their rays one by one.  The size was measured: 4096 rays
    amortise a walk through the hierarchy and their depth buffers still fit the second-level cache.
    """

    side: int
    group: int
    half: float = (BLOCK - 1) / 2
    outer: int = 1
    scattered: bool = False

    @classmethod
    def for_inner(cls, size: int, outer: int = 1, scattered: bool = False) -> BeamShape:
        """The shape for an inner grid of ``size`` x ``size`` rays."""
        if outer > 1:
            return cls(4, outer, (BLOCK // outer - 1) / 2, outer, scattered)
        side = min(4, -(-size // BLOCK))
        return cls(side, 4 // side, (min(size, BLOCK) - 1) / 2, 1, scattered)

    @property
    def elements(self) -> int:
        return self.group**2

    @property
    def blocks(self) -> int:
        return self.elements // self.outer**2 * self.side**2

    @property
    def tiles(self) -> int:
        """Tiles of 16 x 16 inner rays along a side of a beam."""
        return self.side // self.outer

    @property
    def defines(self) -> dict[str, object]:
        """What kernels are built with."""
        return {
            "SIDE": self.side,
            "ELEMENTS": self.elements,
            "OUTER": self.outer,
            "HALF": f"{self.half}f",
            "SCATTERED": int(self.scattered),
        }

    def squares(self, columns: int, rows: int) -> int:
        """Beams that one group of elements needs for its inner grid."""
        span = self.tiles * BLOCK
        return -(-columns // span) * -(-rows // span)


@dataclass(frozen=True)
class Groups:
    """Elements by the beams that trace them.

    ``members`` (B, group**2) int32: which elements, -1 where there is none.  ``middles``, (E, 4)
    or, for blocks of several elements, (B, 4) float32: the ray that blocks are counted from.
    """

    members: np.ndarray
    middles: np.ndarray

    @classmethod
    def of(
        cls, shape: BeamShape, bundles: Bundles, coordinates: np.ndarray | None, tall: int = 1
    ) -> Groups:
        """Put ``bundles`` at distinct places ``coordinates`` (E, 2) into cells ``group`` wide.

        Cells lie at multiples of ``group``: which elements are there does not change where a
        block's rays are.  ``tall`` cells one below the other follow each other, also those that
        hold nothing; such strips are sorted by row, then column.
        """
        group = shape.group
        if coordinates is None or group == tall == 1:
            return cls(np.arange(len(bundles.elements), dtype=np.int32)[:, None], bundles.elements)
        size = np.array([group, group * tall])
        strips, slots = np.divmod(np.asarray(coordinates, np.int64), size)
        key, strip = np.unique(strips[:, 1] << 32 | strips[:, 0], return_inverse=True)
        members = np.full((len(key), group * size[1]), -1, np.int32)
        members[strip, slots[:, 1] * group + slots[:, 0]] = np.arange(len(strips), dtype=np.int32)
        members = members.reshape(-1, group**2)
        if shape.outer == 1:
            return cls(members, bundles.elements)
        corners = np.stack([key & 0xFFFFFFFF, key >> 32], axis=1) * size
        corners = corners[:, None] + np.stack([np.zeros(tall), np.arange(tall) * group], axis=1)
        return cls(members, bundles.lattice.middles(corners.reshape(-1, 2) + (group - 1) / 2))


PROBED_BLOCKS = 16


def probed_elements(bundles: Bundles) -> np.ndarray:
    """(up to PROBED_BLOCKS, 4) float32: the elements whose blocks stand for all."""
    last = len(bundles.elements) - 1
    return bundles.elements[np.unique(np.linspace(0, last, PROBED_BLOCKS).astype(int))]


def leaves_a_ray(leaf_boxes: np.ndarray, bundles: Bundles, outer: int = 1) -> float:
    """Leaves, boxes (L, 6), in the way of a mean block of 256 rays or fewer, a ray.

    Counted for PROBED_BLOCKS blocks of ``outer`` x ``outer`` elements, spread evenly over elements
    and inner grid, whatever stands in front of what: the same bundles always give the same number.
    """
    lo, hi = leaf_boxes[:, :3], leaf_boxes[:, 3:]
    depths = np.maximum(np.stack([lo[:, 2], hi[:, 2]]), 0)
    size, inner = np.array([bundles.columns, bundles.rows]), BLOCK // outer
    blocks = -(-size // inner)
    half = ((np.minimum(size, inner) - 1) / 2).astype(np.float32)
    among = 0.0
    if outer > 1:
        lattice = bundles.lattice
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


SPANNING_COST = {"hits": 6.5, "colours": 1.6}
"""What a block of several elements costs beyond one of 16 x 16 rays of one element, as so many more
triangles met: measured for N = 16 to 64, M = 128 and 512 on three scenes."""
PLACES = 4


def probed_blocks(bundles: Bundles, outer: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions of the rays of some blocks of ``outer`` x ``outer`` elements.

    (B, 256, 3) float32 each; PLACES blocks about each element, spread over the inner grid: the
    same for equal bundles.
    """
    inner = BLOCK // outer
    number = np.arange(len(bundles.elements) * PLACES)
    down, across = -(-bundles.rows // inner), -(-bundles.columns // inner)
    place = number * (down * across) // len(number)
    first = np.stack([place % across, place // across], 1) * inner
    middle = first - (np.array([bundles.columns, bundles.rows]) - 1) / 2
    i, u = np.tile(np.arange(inner), outer), np.repeat(np.arange(outer) - (outer - 1) / 2, inner)
    rays = []
    for part, among in enumerate((bundles.lattice.origin, bundles.lattice.direction)):
        element = np.repeat(bundles.elements[:, 2 * part : 2 * part + 2], PLACES, 0)
        out = np.full((len(number), BLOCK, BLOCK, 3), float(part))
        for axis in (0, 1):
            step = bundles.step[2 * part + axis]
            line = (middle[:, axis, None] + i) * step + u * among + element[:, axis, None]
            out[..., axis] = line[:, None, :] if axis == 0 else line[:, :, None]
        rays.append(out.reshape(len(number), -1, 3).astype(np.float32))
    return rays[0], rays[1]


def best_outer(closest_hit, bundles: Bundles, work: str) -> int:
    """Elements along each axis that a block best spans, for ``work`` of SPANNING_COST.

    Decided by how many triangles the rays of some blocks meet, of ``closest_hit``: what can be seen
    decides, and not how it is sorted.
    """
    least, best = np.inf, 1
    for outer in (1, 2, 4):
        if min(bundles.columns, bundles.rows) < BLOCK // outer and outer > 1:
            continue
        cost = SPANNING_COST[work] if outer > 1 else 0.0
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

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
        span = self.side * BLOCK // self.outer
        return -(-columns // span) * -(-rows // span)


@dataclass(frozen=True)
class Groups:
    """Elements by the beams that trace them.

    ``members`` (B, group**2) int32: which elements, -1 where there is none.  ``middles``, (E, 4) or,
    for blocks of several elements, (B, 4) float32: the ray that blocks are counted from.
    """

    members: np.ndarray
    middles: np.ndarray

    @classmethod
    def of(cls, shape: BeamShape, bundles: Bundles, coordinates: np.ndarray | None) -> Groups:
        """Put ``bundles`` at distinct places ``coordinates`` (E, 2) into cells of ``group`` x ``group``.

        Cells are sorted by row, then column, and lie at multiples of ``group``: which elements
        are there does not change where a block's rays are.
        """
        group = shape.group
        if coordinates is None or group == 1:
            return cls(np.arange(len(bundles.elements), dtype=np.int32)[:, None], bundles.elements)
        cells, slots = np.divmod(np.asarray(coordinates, np.int64), group)
        key, beam = np.unique(cells[:, 1] << 32 | cells[:, 0], return_inverse=True)
        members = np.full((len(key), group**2), -1, np.int32)
        members[beam, slots[:, 1] * group + slots[:, 0]] = np.arange(len(cells), dtype=np.int32)
        if shape.outer == 1:
            return cls(members, bundles.elements)
        corners = np.stack([key & 0xFFFFFFFF, key >> 32], axis=1) * group
        return cls(members, bundles.lattice.middles(corners + (group - 1) / 2))


PROBED_BLOCKS = 16


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
    chosen = np.unique(np.linspace(0, len(bundles.elements) - 1, PROBED_BLOCKS).astype(int))
    count = 0
    for number, element in enumerate(bundles.elements[chosen]):
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

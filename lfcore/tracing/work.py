"""How rays are cut into beams, and what a worker needs to trace them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.optics.bundles import Bundles

BLOCK = 16


@dataclass(frozen=True)
class BeamShape:
    """A beam: ``group`` x ``group`` outer elements times ``side`` x ``side`` blocks of 16 x 16.

    ``half`` is half the extent of a block's rays in use, from its centre.  The rule was measured:
    4096 rays amortise a walk through the hierarchy and their depth buffers still fit the
    second-level cache.
    """

    side: int
    group: int
    half: float = (BLOCK - 1) / 2

    @classmethod
    def for_inner(cls, size: int) -> BeamShape:
        """The shape for an inner grid of ``size`` x ``size`` rays."""
        side = min(4, -(-size // BLOCK))
        return cls(side, 4 // side, (min(size, BLOCK) - 1) / 2)

    @property
    def elements(self) -> int:
        return self.group**2

    @property
    def blocks(self) -> int:
        return self.elements * self.side**2

    def squares(self, columns: int, rows: int) -> int:
        """Beams that one group of elements needs for its inner grid."""
        span = self.side * BLOCK
        return -(-columns // span) * -(-rows // span)


def group_elements(coordinates: np.ndarray, group: int, tall: int = 1) -> np.ndarray:
    """(B, group**2) int32: which elements make up each beam, -1 where there is none.

    ``coordinates`` (E, 2) are distinct positions on the outer grid; a beam takes those that fall
    into one cell of ``group`` x ``group``.  ``tall`` cells one below the other follow each other,
    also those that hold nothing; such strips are sorted by row, then column.
    """
    if group == tall == 1:
        return np.arange(len(coordinates), dtype=np.int32)[:, None]
    size = np.array([group, group * tall])
    strips, slots = np.divmod(coordinates.astype(np.int64), size)
    key = strips[:, 1] << 32 | strips[:, 0]
    _, strip = np.unique(key, return_inverse=True)
    out = np.full((int(strip.max(initial=-1)) + 1, group * size[1]), -1, np.int32)
    out[strip, slots[:, 1] * group + slots[:, 0]] = np.arange(len(coordinates), dtype=np.int32)
    return out.reshape(-1, group**2)


PROBED_BLOCKS = 16


def leaves_a_ray(leaf_boxes: np.ndarray, bundles: Bundles) -> float:
    """Leaves, boxes (L, 6), in the way of a mean block of 16 x 16 rays or fewer, a ray.

    Counted for PROBED_BLOCKS blocks spread evenly over elements and inner grid, whatever stands in
    front of what: the same bundles always give the same number.
    """
    lo, hi = leaf_boxes[:, :3], leaf_boxes[:, 3:]
    depths = np.maximum(np.stack([lo[:, 2], hi[:, 2]]), 0)
    size = np.array([bundles.columns, bundles.rows])
    blocks = -(-size // BLOCK)
    half = ((np.minimum(size, BLOCK) - 1) / 2).astype(np.float32)
    chosen = np.unique(np.linspace(0, len(bundles.elements) - 1, PROBED_BLOCKS).astype(int))
    count = 0
    for number, element in enumerate(bundles.elements[chosen]):
        place = number % blocks[0], number // blocks[0] % blocks[1]
        meets = hi[:, 2] > 0
        for axis in (0, 1):
            middle = np.float32(place[axis] * BLOCK + half[axis] - (size[axis] - 1) / 2)
            step, tilt = bundles.step[axis], bundles.step[2 + axis]
            centre = element[axis] + middle * step + depths * (element[2 + axis] + middle * tilt)
            reach = half[axis] * np.abs(step + depths * tilt)
            meets &= lo[:, axis] <= (centre + reach).max(0)
            meets &= hi[:, axis] >= (centre - reach).min(0)
        count += int(meets.sum())
    return count / len(chosen) / float(np.prod(2 * half + 1))

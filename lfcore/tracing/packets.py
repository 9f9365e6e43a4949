"""Packets of rays, which workers trace one by one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.opencl.interface import BLOCK
from lfcore.optics.bundles import Bundles

MOST_SIDE = 4
"""The most blocks along a side of a packet."""
PACKET_ROWS = MOST_SIDE * BLOCK


@dataclass(frozen=True)
class PacketShape:
    """A packet: ``side``² blocks of 256 rays.

    A block is 16 x 16 rays of one element, or ``16 / outer`` along each axis of ``outer`` elements.
    Its inner rays lie within ``half_extent`` steps of its centre.  ``single_rays`` packets trace
    their rays one by one.  4096 rays amortise a walk through the hierarchy, and their depth buffers
    still fit the second-level cache.
    """

    side: int
    half_extent: float = (BLOCK - 1) / 2
    outer: int = 1
    single_rays: bool = False

    @classmethod
    def for_inner(cls, size: int, outer: int = 1, single_rays: bool = False) -> PacketShape:
        """The shape for an inner grid of ``size`` x ``size`` rays."""
        if outer > 1:
            return cls(MOST_SIDE, (BLOCK // outer - 1) / 2, outer, single_rays)
        side = min(MOST_SIDE, -(-size // BLOCK))
        return cls(side, (min(size, BLOCK) - 1) / 2, 1, single_rays)

    @property
    def defines(self) -> dict[str, int]:
        """The macros that kernels are built with; other values are arguments."""
        return {"OUTER": self.outer, "SINGLE_RAYS": int(self.single_rays)}

    def packets_per_group(self, columns: int, rows: int) -> int:
        """Packets that one group of elements needs for its inner grid."""
        span = self.side * BLOCK // self.outer
        return -(-columns // span) * -(-rows // span)


@dataclass(frozen=True)
class Groups:
    """Elements by the packets that trace them: ``outer``² neighbours, or each by itself.

    ``members`` (B, outer**2) int32: the numbers of elements, -1 where there is none.
    ``centre_rays`` (B, 4) float32: offsets are relative to these rays.
    """

    members: np.ndarray
    centre_rays: np.ndarray

    @classmethod
    def of(cls, shape: PacketShape, bundles: Bundles, coordinates: np.ndarray | None) -> Groups:
        """Put ``bundles`` at distinct ``coordinates`` (E, 2) into groups.

        Groups begin at multiples of ``shape.outer``, so that a block's rays do not depend on which
        elements exist.
        """
        side = shape.outer
        if side == 1:
            return cls(np.arange(len(bundles.elements), dtype=np.int32)[:, None], bundles.elements)
        assert coordinates is not None and bundles.lattice is not None  # else no block spans
        u, v = np.asarray(coordinates, np.int64).T
        (column, x), (row, y) = np.divmod(u, side), np.divmod(v, side)
        keys, group = ranks((row - row.min(initial=0)) << 32 | (column - column.min(initial=0)))
        members = np.full((len(keys), side**2), -1, np.int32)
        members[group, y * side + x] = np.arange(len(u), dtype=np.int32)
        some = members.max(axis=1)  # an element per group
        places = np.stack([column[some], row[some]], 1) * side
        return cls(members, bundles.lattice.centre_rays(places + (side - 1) / 2))


def ranks(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """`numpy.unique` with inverse, but faster: only the first of a run of equal keys is sorted."""
    begins = np.append(True, keys[1:] != keys[:-1])[: len(keys)]
    distinct, rank = np.unique(keys[begins], return_inverse=True)
    return distinct, rank[np.cumsum(begins) - 1]

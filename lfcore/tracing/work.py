"""How rays are cut into beams, and what a worker needs to trace them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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


def group_elements(coordinates: np.ndarray, group: int) -> np.ndarray:
    """(B, group**2) int32: which elements make up each beam, -1 where there is none.

    ``coordinates`` (E, 2) are distinct positions on the outer grid; a beam takes those that fall
    into one cell of ``group`` x ``group``.  Cells are sorted by row, then column.
    """
    if group == 1:
        return np.arange(len(coordinates), dtype=np.int32)[:, None]
    cells, slots = np.divmod(coordinates.astype(np.int64), group)
    key = cells[:, 1] << 32 | cells[:, 0]
    _, beam = np.unique(key, return_inverse=True)
    out = np.full((int(beam.max(initial=-1)) + 1, group**2), -1, np.int32)
    out[beam, slots[:, 1] * group + slots[:, 0]] = np.arange(len(coordinates), dtype=np.int32)
    return out

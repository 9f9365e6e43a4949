"""The rays that every method traces: a deterministic, stratified sample of a light slab.

The picture is divided into CELLS x CELLS equal cells.  In each, a square of pixels at a random
position (with a fixed seed) is traced with all N x N rays per pixel.  The squares grow as N falls,
so that every N has about as many rays; squares of four pixels or more begin at multiples of four,
as tiles do.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lfcore.optics.slab import Slab

SCENES = Path(__file__).resolve().parents[1] / "scenes"
CELLS = 8
"""The cells per side of the picture."""
SEED = 2024


@dataclass(frozen=True)
class Sample:
    """Squares of ``side`` pixels; ``corners`` (CELLS**2, 2) int32, the first (u, v) of each."""

    slab: Slab
    side: int
    corners: np.ndarray = field(repr=False)

    @property
    def pixels(self) -> np.ndarray:
        """The pixels (u, v), (P, 2) int32, square after square, row after row."""
        v, u = np.divmod(np.arange(self.side**2, dtype=np.int32), np.int32(self.side))
        return (self.corners[:, None] + np.stack([u, v], axis=1)).reshape(-1, 2)

    @property
    def rays(self) -> int:
        return len(self.corners) * self.side**2 * self.slab.views**2


def sample_slab(slab: Slab, mrays: float = 24.0) -> Sample:
    """Sample about ``mrays`` million rays of ``slab``, but at least one pixel in each cell."""
    cells = min(CELLS, slab.pixels)
    cell = slab.pixels // cells
    wanted = np.sqrt(mrays * 1e6 / cells**2) / slab.views
    side = 1 << max(0, round(float(np.log2(wanted))))
    while side > cell:
        side //= 2
    step = min(side, 4)
    rng = np.random.default_rng(SEED)
    free = (cell - side) // step + 1
    offsets = rng.integers(0, free, (cells, cells, 2)) * step
    grid = np.stack(np.meshgrid(np.arange(cells), np.arange(cells)), axis=-1)
    corners = (grid * cell // step * step + offsets).reshape(-1, 2)
    return Sample(slab, side, corners.astype(np.int32))

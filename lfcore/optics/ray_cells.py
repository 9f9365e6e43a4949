"""The cell of the light field that each ray represents, and views displaced within a pixel.

A ray is one sample of a cell: a part of the lens times a part of a pixel.  The pixel grids of
displaced views differ by fractions of a pixel.  All views together then sample many places of a
pixel in focus; plain views all sample the same places.
"""

import functools
from dataclasses import dataclass

import numpy as np

from lfcore.optics.bundles import Bundles
from lfcore.optics.planes import Aperture
from lfcore.optics.slab import Slab

CELL_POINTS = 512
"""The least number of points per axis of an aperture that measure its cells."""


@dataclass(frozen=True)
class ViewSet:
    """Views through a slab's lens samples, each with its own pixel grid.

    Attributes
    ----------
    slab : Slab
        The lens samples and pixels.
    displacement : ndarray
        (N N, 2) float64: the grids' displacements along u and v, pixels of the slab, i fastest.
    """

    slab: Slab
    displacement: np.ndarray

    @property
    def positions(self) -> np.ndarray:
        """The lens points (s, t), (N N, 2) float64, metres."""
        lens = self.slab.lens_positions()
        return np.stack([np.tile(lens, len(lens)), np.repeat(lens, len(lens))], 1)

    def bundles(
        self, part: slice | np.ndarray = slice(None), *, footprint: float | None = None
    ) -> Bundles:
        """Rays of some views, an element per view.

        Textures are filtered over the tangent ``footprint``, by default a pixel of the slab.
        """
        slab, points = self.slab, self.positions[part]
        pitch = slab.pixel_pitch
        tangents = self.displacement[part] * pitch - points * slab.camera.delta + slab.off_axis()
        return Bundles(
            np.concatenate([points, tangents], 1).astype(np.float32),
            np.array([0.0, 0.0, pitch, pitch], np.float32),
            *slab.size,
            pitch if footprint is None else footprint,
            pitches=(slab.lens_pitch_m, pitch, slab.views),
        )


def plain_views(slab: Slab) -> ViewSet:
    """The slab's own views, with no displacement."""
    return ViewSet(slab, np.zeros((slab.views**2, 2)))


def displaced_views(slab: Slab) -> ViewSet:
    """Views displaced by multiples of 1 / N^2 of a pixel, every multiple once per axis.

    A view's column gives the coarse displacement along v, its row the one along u.  Neighbouring
    views then sample an edge at different places of a pixel, and each row of views alone covers the
    pixel in steps of 1 / N.

    Source: A. Kensler, "Correlated Multi-Jittered Sampling", Pixar Technical Memo 13-01, 2013, with
    the strata of lens and pixel exchanged.
    """
    count = slab.views
    order = radical_order(count) / count
    i, j = np.tile(np.arange(count), count), np.repeat(np.arange(count), count)
    middle = 0.5 - 0.5 / count**2
    along_u = order[j] + order[i] / count - middle
    along_v = order[i] + order[j] / count - middle
    return ViewSet(slab, np.stack([along_u, along_v], 1))


def views_of(slab: Slab, *, displaced: bool) -> ViewSet:
    """:func:`displaced_views` or :func:`plain_views`."""
    return displaced_views(slab) if displaced else plain_views(slab)


def radical_order(count: int) -> np.ndarray:
    """The ranks of 0 ... count - 1 when sorted by reversed bits, (count,) integers."""
    bits = max(1, (count - 1).bit_length())
    reversed_bits = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(count)]
    return np.argsort(np.argsort(reversed_bits))


@dataclass(frozen=True)
class LensCells:
    """The open parts of lens samples' cells, with i fastest.

    Attributes
    ----------
    middle : ndarray
        (N N, 2) centres, metres.
    extent : ndarray
        (N N, 2) sides of the box with the same variance, metres.
    share : ndarray
        (N N,) open share of each cell.
    """

    middle: np.ndarray
    extent: np.ndarray
    share: np.ndarray


def lens_cells(slab: Slab, aperture: Aperture) -> LensCells:
    """Measure the open part of each lens sample's cell by counting points.

    An aperture smaller than a cell is one cell: the picture gets sharper, not black.
    """
    return _lens_cells(slab.views, slab.lens_pitch_m, aperture)


@functools.lru_cache(maxsize=64)
def _lens_cells(count: int, pitch: float, aperture: Aperture) -> LensCells:
    radius = aperture.radius_m
    across = int(np.ceil(2 * radius / pitch))
    each = max(4, -(-CELL_POINTS // across))
    spacing = 2 * radius / (across * each)
    line = (np.arange(across * each) - (across * each - 1) / 2) * spacing
    inside = aperture.contains(line[None, :], line[:, None]).astype(float)
    # The square around a point may belong to two cells: each gets its part.
    edges = (np.arange(count + 1) - count / 2)[:, None] * pitch
    ends = np.maximum(edges[:-1], line - spacing / 2), np.minimum(edges[1:], line + spacing / 2)
    member, part = np.clip((ends[1] - ends[0]) / spacing, 0, 1), (ends[0] + ends[1]) / 2
    # Only each cell's few points, and without BLAS, whose threads spin on a busy machine.
    most = (member > 0).sum(1).max()
    near = np.minimum((member > 0).argmax(1), len(line) - most)[:, None] + np.arange(most)
    powers = [np.take_along_axis(member * part**power, near, 1) for power in range(3)]
    rows = inside[near]

    def sums(across: int, down: int) -> np.ndarray:
        """Moments of each cell's open points, (N N,)."""
        cells = np.einsum("jkp,jk->jp", rows, powers[down])[:, near]
        return np.einsum("jik,ik->ji", cells, powers[across]).ravel()

    area = sums(0, 0)
    filled = np.maximum(area, 1e-300)
    middle, extent = [], []
    for first, second in ((sums(1, 0), sums(2, 0)), (sums(0, 1), sums(0, 2))):
        middle.append(first / filled)
        spread = np.maximum(second / filled - middle[-1] ** 2, 0) + spacing**2 / 12
        extent.append(np.sqrt(12 * spread))
    share = area * (spacing / pitch) ** 2
    return LensCells(np.stack(middle, 1), np.stack(extent, 1), share)

"""The part of a light field that each ray stands for, and views displaced within a pixel.

A ray is one sample of a cell: a part of the lens and a part of a pixel.  Views whose pixel grids
are displaced against one another share out the places within a pixel, so that what is in focus
is sampled by all of them together and not at the same places by each.
"""

import functools
from dataclasses import dataclass

import numpy as np

from lfcore.optics.bundles import Bundles
from lfcore.optics.planes import Aperture
from lfcore.optics.slab import Slab

CELL_POINTS = 512
"""Points along each axis of an aperture, at least, by which its cells are measured."""


@dataclass(frozen=True)
class ViewSet:
    """Views through the lens samples of ``slab``, each with a pixel grid of its own.

    ``displacement`` (N N, 2) float64 is along u and v, in pixels of the slab, with i fastest.
    """

    slab: Slab
    displacement: np.ndarray

    @property
    def positions(self) -> np.ndarray:
        """(N N, 2) float64, metres: the lens points (s, t)."""
        lens = self.slab.lens_positions()
        return np.stack([np.tile(lens, len(lens)), np.repeat(lens, len(lens))], 1)

    def bundles(
        self, part: slice | np.ndarray = slice(None), *, footprint: float | None = None
    ) -> Bundles:
        """Rays of some of the views, an element a view; textures are filtered over the tangent
        ``footprint``, by default a pixel of the slab."""
        slab, at = self.slab, self.positions[part]
        pitch = slab.pixel_pitch
        tangents = self.displacement[part] * pitch - at * slab.camera.delta + slab.off_axis()
        return Bundles(
            np.concatenate([at, tangents], 1).astype(np.float32),
            np.array([0.0, 0.0, pitch, pitch], np.float32),
            *slab.size,
            pitch if footprint is None else footprint,
        )


def plain_views(slab: Slab) -> ViewSet:
    """The slab's own views: no grid is displaced."""
    return ViewSet(slab, np.zeros((slab.views**2, 2)))


def displaced_views(slab: Slab) -> ViewSet:
    """Views displaced by multiples of 1 / N^2 of a pixel, every multiple once along each axis.

    The column of a view decides first how far its grid moves along v, and its row how far along
    u: neighbours along either axis of the lens then see an edge across it at unlike places of a
    pixel, and a row of views by itself already has all places to within 1 / N.  (A lattice of
    correlated multi-jittered kind: A. Kensler, "Correlated Multi-Jittered Sampling", Pixar
    Technical Memo 13-01, 2013, with strata of lens and pixel exchanged.)
    """
    count = slab.views
    order = radical_order(count) / count
    i, j = np.tile(np.arange(count), count), np.repeat(np.arange(count), count)
    middle = 0.5 - 0.5 / count**2
    along_u = order[j] + order[i] / count - middle
    along_v = order[i] + order[j] / count - middle
    return ViewSet(slab, np.stack([along_u, along_v], 1))


def views_of(slab: Slab, *, displaced: bool) -> ViewSet:
    """:func:`displaced_views` where views are displaced, else :func:`plain_views`."""
    return displaced_views(slab) if displaced else plain_views(slab)


def radical_order(count: int) -> np.ndarray:
    """(count,) integers 0 ... count - 1, in the order of their bits reversed."""
    bits = max(1, (count - 1).bit_length())
    reversed_bits = [int(f"{k:0{bits}b}"[::-1], 2) for k in range(count)]
    return np.argsort(np.argsort(reversed_bits))


@dataclass(frozen=True)
class LensCells:
    """Lens samples in one aperture, with i fastest: the centre (N N, 2) of each cell's open part
    and the sides (N N, 2) of the box of equal spread, metres, and the open ``share`` (N N,)."""

    middle: np.ndarray
    extent: np.ndarray
    share: np.ndarray


def lens_cells(slab: Slab, aperture: Aperture) -> LensCells:
    """The cells of ``slab``'s lens samples that ``aperture`` leaves open, by counting points.

    An aperture smaller than a cell is one: the picture is sharper, never black.
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
    # What a point stands for may lie in two cells: each has its part.
    edges = (np.arange(count + 1) - count / 2)[:, None] * pitch
    ends = np.maximum(edges[:-1], line - spacing / 2), np.minimum(edges[1:], line + spacing / 2)
    member, part = np.clip((ends[1] - ends[0]) / spacing, 0, 1), (ends[0] + ends[1]) / 2
    # The few points of each cell: without BLAS, whose threads spin where a machine is busy.
    most = (member > 0).sum(1).max()
    near = np.minimum((member > 0).argmax(1), len(line) - most)[:, None] + np.arange(most)
    powers = [np.take_along_axis(member * part**power, near, 1) for power in range(3)]
    rows = inside[near]

    def sums(across: int, down: int) -> np.ndarray:
        """(N N,) sums over each cell's open points of powers of their places."""
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

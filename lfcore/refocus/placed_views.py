"""Views on one plane: the pixels that their rays hit, weights of rays, and layers of sweeps."""

import math
from collections import defaultdict
from collections.abc import Sequence
from functools import cached_property

import numpy as np

from lfcore.opencl.interface import record
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import LensCells, ViewSet, lens_cells
from lfcore.optics.size import Size
from lfcore.refocus.depth_program import FOCUS_PLANE, MOST_BOUNDS, PLACED_VIEW

IN_FOCUS_PX = 0.5
"""The largest sweep in focus, pixels of the picture."""
WIDE_PX = 2.0
"""The smallest sweep of wide blur, pixels of the picture."""
WIDE_LAYERS = MOST_BOUNDS - 1
"""Layers of wide blur on each side of the plane (measured, docs/decisions.md)."""
LONG_RAY_BITS = 40
"""The bits of a ray in sums of 64 bits; light above white uses bits that few rays leave free, or
drops its last ones."""
SUM_BITS = 29
"""The bits of all rays of a pixel in sums of 32 bits: boxes may add up to eight times as much."""
GOLDEN = 0.6180340
"""The golden ratio's inverse: multiples of it are spread evenly over the dither of views."""


def layer_bounds(widest_px: float) -> tuple[float, ...]:
    """The sweeps between the layers on each side of a plane; infinity has ``widest_px``.

    They double from layer to layer, or grow faster, so that the last layer begins at half the
    widest sweep or above.
    """
    last = WIDE_LAYERS - 1
    ratio = max(2.0, (widest_px / 2 / WIDE_PX) ** (1 / last))
    return (IN_FOCUS_PX, *(WIDE_PX * ratio**number for number in range(WIDE_LAYERS)))


def typical_sweep(bounds_px: Sequence[float], away: int) -> float:
    """A layer's typical sweep, by its number from the plane; 0 for the layers around focus."""
    if away < 2:
        return 0.0
    ends = *bounds_px, 2 * bounds_px[-1]
    return math.sqrt(ends[away - 1] * ends[away])


class PlacedViews:
    """Views on a plane, in a picture whose longer side is ``pixels``.

    Attributes
    ----------
    scale : float
        Pixels of the picture per metre of the lens and dioptre.
    step : float
        Pixels of the picture per pixel of the slab.
    bounds_px : tuple of float
        Sweeps between layers; by default :func:`layer_bounds`.
    long_sums : bool
        Whether sums have 64 bits, for light above white.
    """

    def __init__(
        self, views: ViewSet, plane: SensorPlane, pixels: int,
        bounds_px: Sequence[float] | None = None, *, long_sums: bool = False,
    ):  # fmt: skip
        slab = views.slab
        self.long_sums = long_sums
        self.views, self.plane = views, plane
        left, top, width, height = slab.picture(pixels)
        self.size = Size(width, height)
        self._middle = pixels / 2 - np.array([left, top])  # the axis's position in the picture
        magnified = plane.magnification(slab) * pixels
        self.scale, self.step = magnified / slab.camera.field_width, magnified / slab.pixels
        widest = plane.delta * self.scale * slab.lens_pitch_m
        self.bounds_px = layer_bounds(widest) if bounds_px is None else tuple(bounds_px)

    @cached_property
    def cells(self) -> LensCells:
        """The views' cells in the plane's aperture."""
        return lens_cells(self.views.slab, self.plane.lens_aperture(self.views.slab))

    @cached_property
    def first(self) -> np.ndarray:
        """The pixel that the ray of pixel (0, 0) of each view hits, (K, 2) float64."""
        views = self.views
        corner = np.array(views.slab.held.pixels[:2])
        moved = views.displacement + corner - (views.slab.pixels - 1) / 2
        shift = views.positions * (self.plane.delta - views.slab.camera.delta)
        return moved * self.step + shift * self.scale + self._middle

    @property
    def rays_a_pixel(self) -> float:
        """Rays, by their share, of an even surface in a pixel; sums hold eight times more."""
        return float(self.cells.share.sum()) / self.step**2

    @property
    def unit_weight(self) -> float:
        """The weight, in units of the sums, of a ray whose cell is open."""
        rays = max(1.0, self.rays_a_pixel)
        return 2.0 ** (LONG_RAY_BITS if self.long_sums else SUM_BITS - math.ceil(math.log2(rays)))

    @property
    def view_records(self) -> np.ndarray:
        """(K,) PLACED_VIEW."""
        records = np.zeros(len(self.first), PLACED_VIEW)
        cells, numbers = self.cells, np.arange(len(records))
        values = {"": self.first, "offset_": cells.middle - self.views.positions}
        for name, vectors in {**values, "side_": cells.extent}.items():
            records[f"{name}x"], records[f"{name}y"] = vectors.T
        records["weight"] = cells.share * self.unit_weight
        records["dither"] = numbers * GOLDEN % 1
        return records

    @property
    def plane_record(self) -> np.ndarray:
        """FOCUS_PLANE."""
        bounds = np.full(MOST_BOUNDS, np.inf)
        bounds[: len(self.bounds_px)] = self.bounds_px
        return record(
            FOCUS_PLANE, delta=self.plane.delta, scale=self.scale, step=self.step,
            pitch=self.views.slab.lens_pitch_m, bounds=bounds,
        )  # fmt: skip

    @property
    def nodes(self) -> np.ndarray | None:
        """What a lens from a file does, see NODE; None for perfect lenses alone."""
        return None

    @property
    def illumination(self) -> np.ndarray | None:
        """The factor by which a lens from a file darkens each pixel; None for a perfect lens."""
        return None

    def rooms(self, layers: int) -> tuple[np.ndarray, np.ndarray]:
        """The weight of all rays per pixel, as if each had a layer's typical sweep.

        Returns different rows of weights, (rows, width) float32, and the row of each pixel row,
        (layers, height) int32.  ``layers`` has a bit per layer in use.
        """
        row_of = np.zeros((2 * len(self.bounds_px) + 1, self.size.height), np.int32)
        rooms: list[np.ndarray] = []
        share = self.cells.share[:, None] / self.step**2
        layers_of = defaultdict(list)
        for layer in range(len(row_of)):
            if layers >> layer & 1:
                away = abs(layer - len(self.bounds_px))
                layers_of[typical_sweep(self.bounds_px, away)].append(layer)
        for sweep, same in layers_of.items():
            across, down = self._coverage(sweep)
            # Most rows are inside all views, and equal.
            differs = np.append(True, np.any(np.diff(down, axis=1), axis=0))
            row_of[same] = np.cumsum(differs) - 1 + sum(map(len, rooms))
            rows = down[:, differs] * share
            # Without BLAS: its threads spin, and its order of sums depends on the processor.
            rooms.append(np.einsum("kv,ku->vu", rows, across) * self.unit_weight)
        empty = np.zeros((1, self.size.width))
        return np.concatenate([*rooms, empty]).astype(np.float32), row_of

    def _coverage(self, sweep: float) -> list[np.ndarray]:
        """The share of each column and row that a view's rays cover, (K, width) and (K, height).

        Each ray is spread over its cell's part of ``sweep``.
        """
        slab, coverage = self.views.slab, []
        sides = self.cells.extent / slab.lens_pitch_m * sweep
        for low, side, rays, count in zip(
            (self.first - self.step / 2).T, sides.T, slab.size, self.size, strict=True
        ):
            half = np.maximum(side, 1e-3)[:, None] / 2
            left, ends = np.arange(count), np.stack([low, low + self.step * rays])[..., None]

            def integral(place: np.ndarray, ends: np.ndarray = ends) -> np.ndarray:
                """The second integral of a view's extent up to a place."""
                ramp = np.square(np.maximum(place - ends, 0)) / 2
                return ramp[0] - ramp[1]

            swept = integral(left + 1 + half) - integral(left + half)
            swept -= integral(left + 1 - half) - integral(left - half)
            coverage.append(np.round(swept / (2 * half), 6))  # full coverage is exactly equal
        return coverage

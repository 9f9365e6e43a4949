"""Pinhole views to a requested quality, with as many rays per pixel as it needs.

A view is the mean of one square grid of rays per pixel, or of two, displaced by half a step: an
edge along the pixels then crosses twice as many rows of rays.
"""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import OpticsError
from lfcore.optics.ray_cells import ViewSet
from lfcore.optics.slab import Slab
from lfcore.tracing.tracer import Tracer

Pattern = tuple[int, int]
"""The rays per side of a grid in a pixel, and the number of grids."""
PATTERNS: tuple[Pattern, ...] = ((2, 1), (2, 2), (3, 2), (4, 2), (6, 2), (8, 2), (12, 2))
"""The patterns to choose from, in ascending quality."""
FOOTPRINT = {1: 1.0, 2: 0.7}
"""The width of the texture filter in steps of a grid, by the number of grids."""
MARGIN_DB = 1.0
"""The dB that are subtracted from the difference to the next pattern."""


def rays_per_pixel(pattern: Pattern) -> int:
    side, grids = pattern
    return grids * side**2


def view(tracer: Tracer, slab: Slab, number: int, pattern: Pattern) -> np.ndarray:
    """Trace the view of lens sample ``number``, counted row by row: (H, W, 3) float32, linear."""
    side, grids = pattern
    fine = slab.resized(side * slab.pixels)
    sets = [
        ViewSet(fine, np.full((slab.views**2, 2), (grid + 0.5) / grids - 0.5)).bundles(
            np.array([number]), footprint=fine.pixel_pitch * FOOTPRINT[grids]
        )
        for grid in range(grids)
    ]
    light = tracer.mosaic_radiance(sets, 1)
    height, width = (length // side for length in light.shape[:2])
    rows = light.reshape(height, side, -1)
    rows = sum((rows[:, k] for k in range(1, side)), start=rows[:, 0])
    pixels = rows.reshape(height, width, side, 3)
    total = sum((pixels[:, :, k] for k in range(1, side)), start=pixels[:, :, 0])
    return total * np.float32(1 / rays_per_pixel(pattern))


def chosen(
    tracer: Tracer, slab: Slab, numbers: Sequence[int], quality_db: float
) -> tuple[Pattern, list[float]]:
    """Return the first pattern with the quality, and the expected PSNR of views ``numbers``, sRGB.

    We estimate the error of a view by its difference to the same view with the next pattern.
    """
    pictures = [srgb_encode(view(tracer, slab, number, PATTERNS[0])) for number in numbers]
    expected: list[float] = []
    for pattern, following in pairwise(PATTERNS):
        finer = [srgb_encode(view(tracer, slab, number, following)) for number in numbers]
        errors = [np.square(a - b).mean() for a, b in zip(pictures, finer, strict=True)]
        expected = [round(-10 * math.log10(max(float(e), 1e-12)) - MARGIN_DB, 2) for e in errors]
        if min(expected) >= quality_db:
            return pattern, expected
        pictures = finer
    raise OpticsError(
        f"{quality_db:g} dB needs more than {rays_per_pixel(pattern)} rays per pixel of a view, "
        f"which reach {min(expected):.1f} dB", key="quality_db", remedy="Request fewer dB",
    )  # fmt: skip

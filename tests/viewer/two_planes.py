"""A light field of two textured planes, whose disparities are known."""

import numpy as np

from lfcore import Camera, Slab

VIEWS, PIXELS = 9, 64
NEAR, FAR = 1.25, -0.75
"""Disparities: pixels from one view to the next."""
SLAB = Slab(Camera(0.05, 0.036, 2.0, 0.3), VIEWS, PIXELS)


def two_planes() -> np.ndarray:
    """(N, N, M, M, 3) float32 sRGB, [j, i, v, u]: a near square in the middle of a far wall."""
    middle = (VIEWS - 1) / 2
    j, i, v, u = np.mgrid[0:VIEWS, 0:VIEWS, 0:PIXELS, 0:PIXELS].astype(np.float32)

    def at(disparity):
        # What is in focus at that disparity is at X = u + (i - middle) d in every view.
        return u + (i - middle) * disparity, v + (j - middle) * disparity

    (x, y), (nx, ny) = at(FAR), at(NEAR)
    wall = [0.5 + 0.3 * np.sin(0.6 * x + k / 4) * np.cos(0.5 * y + k / 2) for k in range(3)]
    square = [0.5 + 0.4 * np.cos(0.6 * nx - k / 4) * np.sin(0.7 * ny + k / 4) for k in range(3)]
    inside = (np.abs(nx - 31.5) < 14) & (np.abs(ny - 31.5) < 14)
    return np.where(inside[..., None], np.stack(square, -1), np.stack(wall, -1))

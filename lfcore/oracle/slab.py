"""The rays of a light slab one by one, and their radiance."""

import numpy as np

from lfcore.optics.slab import Slab
from lfcore.oracle.intersect import Hits, closest_hits
from lfcore.oracle.shading import shade
from lfcore.oracle.textures import solid_of
from lfcore.scene.model import Scene

RAYS = 1 << 16
"""The rays that are traced at a time."""


def slab_rays(slab: Slab, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Origins and directions (P, N, N, 3) float32, indexed [pixel, j, i], of ``pixels`` (P, 2):
    ``O = (s_i, t_j, 0)``, ``D = (x_u - s_i delta, y_v - t_j delta, 1)``, rounded once."""
    pixels = np.asarray(pixels).reshape(-1, 2)
    lens, tangent, delta = slab.lens_positions(), slab.pixel_tangents(), slab.camera.delta
    x, y = tangent[pixels[:, 0], None, None], tangent[pixels[:, 1], None, None]
    s, t = lens[None, None, :], lens[None, :, None]
    parts = np.broadcast_arrays(s, t, 0.0, x - s * delta, y - t * delta, 1.0)
    origins, directions = np.stack(parts[:3], -1), np.stack(parts[3:], -1)
    return origins.astype(np.float32), directions.astype(np.float32)


def slab_hits(scene: Scene, slab: Slab, pixels: np.ndarray) -> Hits:
    """The first hits of the slab's rays, (P N N) in the order of :func:`slab_rays`; t is depth."""
    origins, directions = (a.reshape(-1, 3) for a in slab_rays(slab, pixels))
    return closest_hits(scene.triangles, origins, directions, solid=solid_of(scene))


def trace(scene: Scene, slab: Slab, pixels: np.ndarray) -> np.ndarray:
    """(P, N, N, 3) float64 linear RGB in [0, 1] of all rays through ``pixels`` (P, 2)."""
    pixels = np.asarray(pixels).reshape(-1, 2)
    colours = np.empty((len(pixels), slab.views, slab.views, 3))
    step = max(1, RAYS // slab.views**2)
    for first in range(0, len(pixels), step):
        part = pixels[first : first + step]
        directions = slab_rays(slab, part)[1].reshape(-1, 3)
        light = shade(scene, directions, slab_hits(scene, slab, part))
        colours[first : first + step] = light.reshape(len(part), slab.views, slab.views, 3)
    return colours


def all_pixels(slab: Slab) -> np.ndarray:
    """(H W, 2) columns and rows of every existing pixel, row by row."""
    left, top, width, height = slab.held.pixels
    v, u = np.mgrid[top : top + height, left : left + width]
    return np.stack([u.ravel(), v.ravel()], 1)

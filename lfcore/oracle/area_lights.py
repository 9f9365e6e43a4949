"""Closed forms of a floor's irradiance below an emitter, over the emitter's radiance.

The emitter is 1 m across and hangs 1 m above the floor, its middle above the origin: ``x`` and
``z``, arrays of one shape in metres, are points of the floor.
"""

import numpy as np

RADIUS = 0.5


def sphere(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """That of a point in the middle with the sphere's intensity."""
    return np.pi * RADIUS**2 / (x**2 + z**2 + 1) ** 1.5


def disk(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """P. D. Foote, "Illumination from circular disk sources", 1915."""
    s, r = x**2 + z**2, RADIUS**2
    return np.pi / 2 * (1 - (s + 1 - r) / np.sqrt((s + 1 + r) ** 2 - 4 * s * r))


def square(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Lambert's formula over the four sides."""
    corners = ((-RADIUS, -RADIUS), (RADIUS, -RADIUS), (RADIUS, RADIUS), (-RADIUS, RADIUS))
    rays = np.stack([np.stack([a - x, np.ones_like(x), b - z], -1) for a, b in corners])
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    after = np.roll(rays, -1, axis=0)
    normal = np.cross(rays, after)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.abs((np.arccos((rays * after).sum(-1)) * normal[..., 1]).sum(0)) / 2

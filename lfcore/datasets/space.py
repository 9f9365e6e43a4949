"""The space of objects: what the camera sees, before a wall."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np


class Space(NamedTuple):
    """Where objects may be.

    Attributes
    ----------
    to_camera : ndarray
        (4, 4) from the world to the camera.
    field : ndarray
        (2,) width and height of what the camera sees at a distance of 1 m.
    nearest_m, wall_m : float
        The least depth, and the wall's distance behind the origin.
    """

    to_camera: np.ndarray
    field: np.ndarray
    nearest_m: float
    wall_m: float

    def fits(
        self, middle: np.ndarray, radius: float, others: Sequence[tuple[np.ndarray, float]]
    ) -> bool:
        """Return whether a sphere is visible, not too near, before the wall, and meets none of
        other spheres."""
        x, y, z = (self.to_camera @ (*middle, 1))[:3]
        seen = (np.abs((x, y)) <= self.field * z / 2).all()
        room = z - radius >= self.nearest_m and -middle[2] + radius <= self.wall_m
        return bool(seen and room) and all(
            np.linalg.norm(middle - other) >= radius + size for other, size in others
        )

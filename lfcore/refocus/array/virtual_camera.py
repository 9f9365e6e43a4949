"""The virtual camera of a synthetic picture: a thin lens at any position and angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lfcore.errors import OpticsError
from lfcore.scene.transforms import rotate

FLIP = np.diag([1.0, -1.0, 1.0])
"""The change from pbrt's camera space, y up, to ours, y down, and back."""


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """A thin lens in the space of a camera array, whose cameras are in z = 0, x right, y down.

    Parameters
    ----------
    position_m : array_like
        (3,) centre of the lens, metres.
    rotation : array_like
        (3, 3); its columns are the camera's right, down and forward directions.
    fov_deg : float
        Full field of view over the shorter side of the picture, degrees.
    size : (int, int)
        Width and height of the picture.
    lens_radius_m : float
        Radius of the lens, metres; 0 is a pinhole.
    """

    position_m: np.ndarray
    rotation: np.ndarray
    fov_deg: float
    size: tuple[int, int]
    lens_radius_m: float = 0.0

    def __post_init__(self) -> None:
        position = np.asarray(self.position_m, np.float64)
        rotation = np.asarray(self.rotation, np.float64)
        if position.shape != (3,) or not np.isfinite(position).all():
            raise OpticsError("needs three finite numbers", key="position_m")
        if rotation.shape != (3, 3) or not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-9):
            raise OpticsError("is not a rotation", key="rotation")
        if not 0 < self.fov_deg < 180:
            raise OpticsError(f"must be between 0 and 180, not {self.fov_deg}", key="fov_deg")
        if len(self.size) != 2 or min(self.size) < 1:
            raise OpticsError(f"{self.size} pixels are no picture", key="size")
        if not (self.lens_radius_m >= 0 and math.isfinite(self.lens_radius_m)):
            problem = f"must be finite and not negative, not {self.lens_radius_m}"
            raise OpticsError(problem, key="lens_radius_m")
        object.__setattr__(self, "position_m", position)
        object.__setattr__(self, "rotation", rotation)

    @classmethod
    def from_pbrt(
        cls,
        position: tuple[float, float, float],
        rotation_deg: tuple[float, float, float],
        fov_deg: float,
        size: tuple[int, int],
        lens_radius_m: float = 0.0,
    ) -> VirtualCamera:
        """Make a camera from the assignment's options, in a left-handed space with y up.

        The camera is rotated about z, then y, then x (``Rx Ry Rz``), as by pbrt's RotateX, RotateY
        and RotateZ, and then moved to ``position``.
        """
        x, y, z = (
            rotate(axis, angle)[:3, :3] for axis, angle in zip("xyz", rotation_deg, strict=True)
        )
        place = FLIP @ np.asarray(position, np.float64)
        return cls(place, FLIP @ x @ y @ z @ FLIP, fov_deg, (size[0], size[1]), lens_radius_m)

    @property
    def pixel_pitch(self) -> float:
        """The tangent between neighbouring pixels."""
        return 2.0 * math.tan(math.radians(self.fov_deg) / 2.0) / min(self.size)

    def film_tangents(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The tangents of film positions in pixels (0 ... width, 0 ... height), float64."""
        width, height = self.size
        pitch = self.pixel_pitch
        return (np.asarray(u) - width / 2) * pitch, (np.asarray(v) - height / 2) * pitch

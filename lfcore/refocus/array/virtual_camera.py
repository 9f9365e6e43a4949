"""The camera that a picture is synthesised for: a thin lens anywhere, at any angle."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lfcore.errors import OpticsError
from lfcore.scene.transforms import rotate

# pbrt's camera space has y up, ours y down.
FLIP = np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True, eq=False)
class VirtualCamera:
    """A thin lens of ``lens_radius_m`` (0: a pinhole) in the space of the camera array, whose
    cameras are in z = 0, x right, y down.

    ``position_m`` (3,) is the lens centre; columns of ``rotation`` (3, 3) are the camera's right,
    down and forward; ``fov_deg`` is the full field over the shorter side of the picture.
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
            raise OpticsError(f"must lie between 0 and 180, not {self.fov_deg}", key="fov_deg")
        if len(self.size) != 2 or min(self.size) < 1:
            raise OpticsError(f"{self.size} pixels are no picture", key="size")
        if not (self.lens_radius_m >= 0 and math.isfinite(self.lens_radius_m)):
            raise OpticsError(f"must not be {self.lens_radius_m}", key="lens_radius_m")
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
        """As the assignment's command line puts it: y up, left-handed.

        The camera is turned about z first, then y, then x (``Rx Ry Rz``), each by pbrt's own
        RotateX, RotateY, RotateZ, and then moved to ``position``.
        """
        x, y, z = (
            rotate(axis, angle)[:3, :3] for axis, angle in zip("xyz", rotation_deg, strict=True)
        )
        place = FLIP @ np.asarray(position, np.float64)
        return cls(place, FLIP @ x @ y @ z @ FLIP, fov_deg, (size[0], size[1]), lens_radius_m)

    @property
    def pixel_pitch(self) -> float:
        """Tangent between neighbouring pixels."""
        return 2.0 * math.tan(math.radians(self.fov_deg) / 2.0) / min(self.size)

    def film_tangents(self, u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Tangents of film positions in pixels (0 ... width, 0 ... height), float64."""
        width, height = self.size
        pitch = self.pixel_pitch
        return (np.asarray(u) - width / 2) * pitch, (np.asarray(v) - height / 2) * pitch

"""The thin lens camera, in dioptres.

``delta = 1 / focus distance`` throughout, so that focus at infinity is ``delta = 0`` and no special
case.  ``1 / (1/f - 1/u)`` is not used: it loses all digits near ``u = f``.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import OpticsError, suggest_keywords

PINHOLE_F_NUMBER = 1e6
"""The f-number of a camera that a matrix describes: its lens is 50 nm wide."""
OFF_PX = 1.0
"""The greatest distance of a principal point from the middle of the picture, in pixels: programs
count pixels from their edges or from their middles."""
RIGID = 1e-4
"""The greatest deviation of a rotation times its transpose from the identity."""


@dataclass(frozen=True)
class Camera:
    """A thin lens before a square sensor.

    Parameters
    ----------
    focal_length_m : float
        Focal length, metres.
    sensor_width_m : float
        Side of the sensor, metres.
    f_number : float
        Focal length over the diameter of the lens.
    focus_m : float
        Distance from the lens to the plane in focus, metres, ``math.inf`` included.
    pose : array_like, optional
        (4, 4) camera to world, rigid: the camera looks along its own -z with +y up, as in glTF,
        Blender and nerfstudio.  It is for the functions that make a scene; a scene's own camera
        has none, as the scene is in camera space.

    Raises
    ------
    OpticsError
        A value is not positive, the focus is within the focal length, or the pose has a scale.

    Examples
    --------
    >>> camera = lfcore.Camera(focal_length_m=0.05, sensor_width_m=0.036, f_number=2.0, focus_m=3.0)
    >>> camera.lens_radius_m
    0.0125
    """

    focal_length_m: float
    sensor_width_m: float
    f_number: float
    focus_m: float
    pose: Any = None

    def __post_init__(self) -> None:
        for key in ("focal_length_m", "sensor_width_m", "f_number"):
            value = getattr(self, key)
            if not (isinstance(value, Real) and math.isfinite(value) and float(value) > 0):
                raise OpticsError(f"must be positive and finite, not {value}", key=key)
        check_focus(self.focus_m, self.focal_length_m, key="focus_m")
        if self.pose is not None:
            rows = _matrix("pose", self.pose, (4, 4))
            turn = rows[:3, :3]
            rigid = np.abs(turn @ turn.T - np.eye(3)).max() <= RIGID and np.linalg.det(turn) > 0
            if not rigid or rows[3].tolist() != [0, 0, 0, 1]:
                remedy = "Give camera to world, without scale or mirroring, last row 0 0 0 1"
                raise OpticsError("is no rigid motion", key="pose", remedy=remedy)
            object.__setattr__(self, "pose", tuple(map(tuple, rows.tolist())))

    @classmethod
    @suggest_keywords
    def from_matrix(
        cls,
        K: ArrayLike,
        pose: ArrayLike | None = None,
        *,
        pixels: tuple[int, int] | None = None,
        focus_m: float = math.inf,
        f_number: float = PINHOLE_F_NUMBER,
        focal_length_m: float = 0.05,
    ) -> Camera:
        """Make a camera from a calibrated camera's matrix, as in OpenCV and COLMAP.

        Parameters
        ----------
        K : array_like
            (3, 3) intrinsics in pixels, f 0 cx, 0 f cy, 0 0 1.
        pose : array_like, optional
            As in the class.  A world-to-camera matrix M with x right, y down and z forward
            (OpenCV, COLMAP) gives ``numpy.linalg.inv(M) @ numpy.diag([1, -1, -1, 1])``.
        pixels : (int, int), optional
            Width and height of the calibrated pictures.  Default: twice the principal point.
        focus_m, f_number, focal_length_m : float, optional
            The lens, which a matrix lacks.  Default: a pinhole, for which :func:`lfcore.record`
            fits a lens.

        Returns
        -------
        Camera
            For :func:`lfcore.load_scene` and :meth:`lfcore.Scene.from_triangles`.

        Raises
        ------
        OpticsError
            Pixels are not square, or the principal point is not the middle of the picture.
        """
        from lfcore.optics.size import Size  # it knows cameras

        matrix = _matrix("K", K, (3, 3))
        (f, skew, cx), (zero, fy, cy), last = matrix.tolist()
        if not (f > 0 and abs(fy - f) <= 1e-3 * f) or skew or zero or last != [0, 0, 1]:
            remedy = "Give f 0 cx, 0 f cy, 0 0 1, and undistort and resample the pictures"
            raise OpticsError(f"{matrix.tolist()} has no square pixels", key="K", remedy=remedy)
        width, height = (2 * cx, 2 * cy) if pixels is None else Size.of(pixels)
        off = max(abs(cx - width / 2), abs(cy - height / 2))
        if not off <= OFF_PX or not min(width, height) > 0:
            problem = f"the principal point ({cx:g}, {cy:g}) is not the middle of a picture"
            remedy = "Give pixels=(width, height), and crop or pad the pictures about it"
            raise OpticsError(problem, key="K", remedy=remedy)
        check_focus(focus_m, focal_length_m, key="focus_m")
        sensor = min(width, height) / f * image_distance(focal_length_m, focus_m)
        return cls(focal_length_m, sensor, f_number, focus_m, pose)

    @property
    def delta(self) -> float:
        """Inverse focus distance, dioptres."""
        return 1.0 / self.focus_m

    @property
    def lens_radius_m(self) -> float:
        return self.focal_length_m / (2.0 * self.f_number)

    @property
    def image_distance_m(self) -> float:
        """The distance from the lens to the sensor, v in 1/f = 1/v + delta."""
        return image_distance(self.focal_length_m, self.focus_m)

    @property
    def field_width(self) -> float:
        """The tangent extent W / v of the field of view through the lens centre."""
        return self.sensor_width_m / self.image_distance_m

    def to_json(self) -> dict:
        """The four numbers by the keys of the file format."""
        data = asdict(self)
        del data["pose"]
        return data | {"focus_distance_m": data.pop("focus_m")}

    @classmethod
    def from_json(cls, data: dict) -> Camera:
        """Inverse of :meth:`to_json`.  Raises ``KeyError`` or ``TypeError`` for other keys."""
        rest = dict(data)
        return cls(focus_m=float(rest.pop("focus_distance_m")), **rest)


def _matrix(key: str, values: ArrayLike, shape: tuple[int, int]) -> np.ndarray:
    try:
        matrix = np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError):
        matrix = np.empty(0)
    if matrix.shape != shape or not np.isfinite(matrix).all():
        raise OpticsError(f"must be {shape[0]} x {shape[1]} finite numbers", key=key)
    return matrix


def image_distance(focal_length_m: float, focus_m: float) -> float:
    """The image distance ``v = f u / (u - f)``; ``f`` at infinity.

    By Sterbenz's lemma the subtraction is exact for ``u`` near ``f``.  There, ``1 / (1/f - 1/u)``
    loses all digits, and ``f / (1 - f/u)`` those of the quotient.
    """
    if math.isinf(focus_m):
        return focal_length_m
    return focal_length_m * (focus_m / (focus_m - focal_length_m))


def check_focus(focus_m: float, focal_length_m: float, *, key: str) -> None:
    """Raise :class:`OpticsError` unless the lens can focus at this distance."""
    if not isinstance(focus_m, Real):
        raise OpticsError(f"must be a number, not {focus_m!r}", key=key)
    if not focus_m > focal_length_m:
        problem = f"focus at {focus_m} m is inside the focal length of {focal_length_m} m"
        remedy = "Focus farther than the focal length, or shorten the focal length"
        raise OpticsError(problem, key=key, remedy=remedy)

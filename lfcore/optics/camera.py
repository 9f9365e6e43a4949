"""The thin lens camera, in dioptres.

``delta = 1 / focus distance`` throughout: focus at infinity is ``delta = 0`` and no special
case, and nothing is formed from ``1 / (1/f - 1/u)``, which loses every digit near ``u = f``.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass

from lfcore.errors import OpticsError


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
        Distance from the lens to the plane in focus, metres; ``math.inf`` is allowed.

    Raises
    ------
    OpticsError
        A value that is not positive, or a focus inside the focal length.
    """

    focal_length_m: float
    sensor_width_m: float
    f_number: float
    focus_m: float

    def __post_init__(self) -> None:
        for key in ("focal_length_m", "sensor_width_m", "f_number"):
            value = getattr(self, key)
            if not (value > 0 and math.isfinite(value)):
                raise OpticsError(f"must be positive and finite, not {value}", key=key)
        check_focus(self.focus_m, self.focal_length_m, key="focus_m")

    @property
    def delta(self) -> float:
        """Inverse focus distance, dioptres."""
        return 1.0 / self.focus_m

    @property
    def lens_radius_m(self) -> float:
        return self.focal_length_m / (2.0 * self.f_number)

    @property
    def image_distance_m(self) -> float:
        """From the lens to the sensor (v of 1/f = 1/v + delta)."""
        return image_distance(self.focal_length_m, self.focus_m)

    @property
    def field_width(self) -> float:
        """Tangent extent W / v of the field seen through the lens centre."""
        return self.sensor_width_m / self.image_distance_m

    def to_json(self) -> dict:
        """The four numbers, named as files name them."""
        data = asdict(self)
        return data | {"focus_distance_m": data.pop("focus_m")}

    @classmethod
    def from_json(cls, data: dict) -> Camera:
        """Inverse of :meth:`to_json`.  Raises ``KeyError`` or ``TypeError`` for other names."""
        rest = dict(data)
        return cls(focus_m=float(rest.pop("focus_distance_m")), **rest)


def image_distance(focal_length_m: float, focus_m: float) -> float:
    """Image distance ``v = f u / (u - f)``; ``f`` at infinity.

    By Sterbenz the subtraction is exact when ``u`` is near ``f``, which is where
    ``1 / (1/f - 1/u)`` loses all digits, and ``f / (1 - f/u)`` those of the quotient.
    """
    if math.isinf(focus_m):
        return focal_length_m
    return focal_length_m * (focus_m / (focus_m - focal_length_m))


def check_focus(focus_m: float, focal_length_m: float, *, key: str) -> None:
    """Raise :class:`OpticsError` unless the lens can focus at this distance."""
    if not focus_m > focal_length_m:
        problem = f"focus at {focus_m} m lies inside the focal length of {focal_length_m} m"
        remedy = "Focus farther than the focal length, or shorten the focal length"
        raise OpticsError(problem, key=key, remedy=remedy)

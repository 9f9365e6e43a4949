"""The geometry of a grid of views, perhaps incomplete, and its slab."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from lfcore.optics.array import SENSOR_WIDTH_M
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Extent, Slab

NOMINAL_PITCH_M = 1.0
"""The lens pitch of a slab with unknown geometry: only its disparities have a meaning."""
NOMINAL_FIELD = 1.0
"""The field width of a slab with unknown geometry."""
NOMINAL_DELTA = 1.0
"""The inverse focus of a slab with unknown geometry, 1/m: disparities begin at -M pixels."""
GIVE_GEOMETRY = "Import it again with its baseline, field of view and focus"
"""The remedy for a file of unknown geometry."""


@dataclass(frozen=True)
class Geometry:
    """The cameras' positions and lens; unknown values are None.

    Parameters
    ----------
    pitch_m : float, optional
        Distance between neighbouring cameras, metres, along rows and columns.
    pixel_pitch : float, optional
        Tangent between neighbouring pixels.
    delta : float, optional
        Inverse distance, 1/m, at which the views coincide; 0 for parallel, unshifted cameras.
    sensor_m : float, optional
        Width of the sensor behind the longer side, metres, if the camera was modelled.
    """

    pitch_m: float | None = None
    pixel_pitch: float | None = None
    delta: float | None = None
    sensor_m: float | None = None

    @property
    def missing(self) -> list[str]:
        """The names of the unknown values that a slab needs."""
        return [name for name in ("pitch_m", "pixel_pitch", "delta") if getattr(self, name) is None]

    def or_else(self, other: Geometry) -> Geometry:
        """This geometry, with unknown values from ``other``."""
        known = {key: value for key, value in vars(self).items() if value is not None}
        return replace(other, **known)

    def slab(self, columns: int, rows: int, width: int, height: int) -> Slab:
        """The slab of a grid with this geometry; its lengths are nominal if a value is unknown."""
        views, pixels = max(columns, rows), max(width, height)
        extent = Extent.centred(columns, rows, width, height)
        square = columns == rows and width == height
        pitch, pixel, delta = self.pitch_m, self.pixel_pitch, self.delta
        if pitch is None or pixel is None or delta is None:
            pitch, pixel, delta = NOMINAL_PITCH_M, NOMINAL_FIELD / pixels, NOMINAL_DELTA
        sensor = SENSOR_WIDTH_M if self.missing or not self.sensor_m else self.sensor_m
        distance = sensor / (pixel * pixels)
        focal = distance / (1 + distance * delta)
        camera = Camera(
            focal, sensor, focal / (views * pitch), 1 / delta if delta else math.inf
        )  # fmt: skip
        return Slab(camera, views, pixels, None if square else extent)


@dataclass(frozen=True)
class KnownGeometry(Geometry):
    """A geometry without unknown values."""

    pitch_m: float
    pixel_pitch: float
    delta: float
    sensor_m: float

    @classmethod
    def of_slab(cls, slab: Slab) -> KnownGeometry:
        camera = slab.camera
        return cls(slab.lens_pitch_m, slab.pixel_pitch, camera.delta, camera.sensor_width_m)

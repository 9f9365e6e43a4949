"""The light slab: every ray from N x N lens samples through M x M pixels.

The ray of lens point ``s`` and pixel tangent ``x_f`` is at depth z (y alike)

    x(z) = s (1 - z delta) + z x_f

that is ``O + z D`` with ``O = (s, t, 0)`` and ``D = (x_f - s delta, y_f - t delta, 1)``: its
parameter is depth.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera


@dataclass(frozen=True)
class Slab:
    """A light slab recorded by ``camera`` with ``views`` (N) and ``pixels`` (M) a side.

    Lens samples are the centres of an N x N grid over the square that encloses the lens; index
    ``i`` runs along +x (s), ``j`` along +y (t).  Pixel ``u`` is the column, ``v`` the row.
    """

    camera: Camera
    views: int
    pixels: int

    def __post_init__(self) -> None:
        for key, low, high in (("views", 1, 4096), ("pixels", 1, 65536)):
            value = getattr(self, key)
            if not (isinstance(value, int) and low <= value <= high):
                raise OpticsError(f"must be an integer from {low} to {high}, not {value}", key=key)

    @property
    def rays(self) -> int:
        return self.views**2 * self.pixels**2

    @property
    def lens_pitch_m(self) -> float:
        return 2.0 * self.camera.lens_radius_m / self.views

    @property
    def pixel_pitch(self) -> float:
        """Tangent between neighbouring pixels."""
        return self.camera.field_width / self.pixels

    def lens_positions(self) -> np.ndarray:
        """(N,) float64, metres: s of column i, and t of row j."""
        return (np.arange(self.views) - (self.views - 1) / 2.0) * self.lens_pitch_m

    def pixel_tangents(self) -> np.ndarray:
        """(M,) float64: x_f of column u, and y_f of row v."""
        return (np.arange(self.pixels) - (self.pixels - 1) / 2.0) * self.pixel_pitch

    def to_json(self) -> dict:
        return {"camera": asdict(self.camera), "views": self.views, "pixels": self.pixels}

    @classmethod
    def from_json(cls, data: dict) -> Slab:
        return cls(Camera(**data["camera"]), int(data["views"]), int(data["pixels"]))

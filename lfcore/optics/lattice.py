"""Lattices of rays: lens samples by rays per pixel."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lfcore.errors import OpticsError
from lfcore.optics.size import Pixels, Size, whole_number

MOST_SUBPIXELS = 64


@dataclass(frozen=True)
class Lattice:
    """The rays of a picture: lens samples, and rays per pixel of each.

    Wherever ``views`` is a parameter, a lattice may be given instead of a number.

    Parameters
    ----------
    views : int
        Lens samples per side, 1 to 4096.
    subpixels : float
        Rays per pixel of the picture and lens sample, per side: above 0 and at most 64.
    displaced : bool
        Displace each view within a pixel against all others, so that together they sample more
        places of a pixel: 2 dB better pictures by depth.

    Raises
    ------
    OpticsError
        A number is out of range.
    """

    views: int
    subpixels: float = 2.0
    displaced: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "views", whole_number("views", self.views, 4096))
        if not (math.isfinite(self.subpixels) and 0 < self.subpixels <= MOST_SUBPIXELS):
            what = f"must be above 0 and at most {MOST_SUBPIXELS}, not {self.subpixels:g}"
            raise OpticsError(what, key="subpixels")

    def side(self, pixels: int) -> int:
        """Pixels of each view's side, for pictures of ``pixels``."""
        return max(1, round(self.subpixels * pixels))

    def rays(self, pixels: Pixels) -> int:
        """Rays of a picture."""
        size = Size.of(pixels)
        width, height = size.scaled(self.side(size.longer))
        return self.views**2 * width * height

    @property
    def rays_per_pixel(self) -> float:
        return (self.views * self.subpixels) ** 2

    def __str__(self) -> str:
        return f"{self.views} x {self.subpixels:.3g}"

"""Lenses of posed pictures, and the pinhole to which their pictures are resampled.

Distortion is OpenCV's ("Camera Calibration and 3D Reconstruction"; fisheye: J. Kannala and S. S.
Brandt, "A Generic Camera Model", PAMI 2006), which COLMAP and nerfstudio share.  Pixels are counted
from the corner of the top left one, so that its middle is (0.5, 0.5).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from lfcore.exchange import pictures
from lfcore.exchange.reading import ExchangeError

EQUAL = 1e-3
"""The relative difference below which focal lengths are one."""
MOST_RESAMPLED = 4.0
"""The largest ratio of two focal lengths of one light field."""


@dataclass(frozen=True)
class Lens:
    """Focal lengths and principal point, pixels, of a picture of ``size``, None if unknown.

    ``radial`` and ``below`` are the factors of even powers of the radius above and below the
    fraction; a ``fisheye`` has ``radial`` in its angle.
    """

    focal: tuple[float, float]
    centre: tuple[float, float]
    size: tuple[float, float] | None = None
    radial: tuple[float, ...] = ()
    below: tuple[float, ...] = ()
    tangential: tuple[float, float] = (0.0, 0.0)
    fisheye: bool = False

    @classmethod
    def of(
        cls, numbers: Mapping[str, float], size: tuple[float, float] | None, fisheye: bool = False
    ) -> Lens:
        """The lens of COLMAP's names: f or fx and fy, cx, cy, k1 to k4, d1 to d3, p1, p2.

        Raises ValueError for numbers that are not finite, or a focal length that is not positive.
        """
        if not np.isfinite([*numbers.values(), *(size or ())]).all():
            raise ValueError("numbers that are not finite")
        across = numbers.get("fx", numbers.get("f", 0.0))
        focal = across, numbers.get("fy", across)
        if min(*focal, *(size or focal)) <= 0:
            raise ValueError("a length that is not positive")
        radial, below, tangential = (
            tuple(numbers.get(f"{letter}{k}", 0.0) for k in range(1, count + 1))
            for letter, count in (("k", 4), ("d", 3), ("p", 2))
        )
        centre = numbers["cx"], numbers["cy"]
        return cls(focal, centre, size, radial, below, tangential, fisheye)  # type: ignore[arg-type]

    @property
    def distorted(self) -> bool:
        return self.fisheye or any((*self.radial, *self.below, *self.tangential))

    def scaled(self, size: tuple[int, int], file: Path) -> Lens:
        """The lens of a smaller or larger copy of the picture; :class:`ExchangeError` if none."""
        if self.size is None or self.size == size:
            return replace(self, size=size)
        across, down = size[0] / self.size[0], size[1] / self.size[1]
        # Scaled sides were rounded to whole pixels: one of the ratios may not fit the other side.
        fits = [
            scale for scale in (across, down)
            if abs(self.size[0] * scale - size[0]) <= 1 and abs(self.size[1] * scale - size[1]) <= 1
        ]  # fmt: skip
        if not fits:
            problem = "is {} x {} pixels, no scaled copy of the {:g} x {:g} that are described"
            raise ExchangeError(problem.format(*size, *self.size), file=file)
        focal = self.focal[0] * fits[0], self.focal[1] * fits[0]
        return replace(
            self, focal=focal, centre=(self.centre[0] * across, self.centre[1] * down), size=size
        )

    def seen(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pixels at which directions of tangents ``x`` and ``y`` are seen; nan beyond the radius
        from which the lens's polynomials turn back."""
        squared = x * x + y * y
        if self.fisheye:
            radius = np.sqrt(squared)
            factor = np.arctan(radius) / np.maximum(radius, 1e-12)
            squared = np.arctan(radius) ** 2
        else:
            factor = 1.0
        ahead = squared * 1.0001
        ratio = [
            _series(self.radial, at) / _series(self.below, at) * np.sqrt(at)
            for at in (squared, ahead)
        ]
        factor = factor * _series(self.radial, squared) / _series(self.below, squared)
        factor = np.where((ratio[1] < ratio[0]) | (factor <= 0), np.nan, factor)
        p, q = self.tangential
        across = x * factor + 2 * p * x * y + q * (squared + 2 * x * x)
        down = y * factor + p * (squared + 2 * y * y) + 2 * q * x * y
        return self.focal[0] * across + self.centre[0], self.focal[1] * down + self.centre[1]


def _series(factors: tuple[float, ...], squared: np.ndarray) -> np.ndarray:
    """1 + k1 r^2 + k2 r^4 + ..."""
    total = np.zeros_like(squared)
    for factor in reversed(factors):
        total = (total + factor) * squared
    return 1 + total


@dataclass(frozen=True)
class Pinholes:
    """Undistorted pictures of square pixels and one focal length.

    ``centres`` (K, 2) are principal points, ``read(k)`` a picture, ``notes`` what was done.
    """

    focal: float
    centres: np.ndarray
    size: tuple[int, int]
    read: Callable[[int], np.ndarray]
    notes: tuple[str, ...]


def as_pinholes(lenses: list[Lens], files: list[Path], described: Path) -> Pinholes:
    """Pictures of lenses (K,) as those of pinholes, resampled only where they have to be."""
    size = pictures.size_of(files[0])
    scaled = [lens.scaled(size, file) for lens, file in zip(lenses, files, strict=True)]
    notes, focal = [], np.array([lens.focal for lens in scaled])
    if any(lens.size not in (None, size) for lens in lenses):
        other = next(lens.size for lens in lenses if lens.size not in (None, size))
        text = "pictures are {} x {} pixels, described {:g} x {:g}: focal lengths were scaled"
        notes.append(text.format(*size, *other))
    centres, longest = np.array([lens.centre for lens in scaled]), float(focal.max())
    if longest > MOST_RESAMPLED * focal.min():
        raise ExchangeError("focal lengths differ too much for one light field", file=described)
    apart = [np.ptp(focal, axis).max() > EQUAL * longest for axis in (1, 0)]
    reasons = {
        "a lens's distortion was undone": any(lens.distorted for lens in scaled),
        "pixels are not square": apart[0],
        "focal lengths differ from camera to camera": apart[1],
    }
    if not any(reasons.values()):
        mean = float(focal.mean())
        return Pinholes(mean, centres, size, lambda k: pictures.read(files[k], size), tuple(notes))
    why = ", ".join(reason for reason, holds in reasons.items() if holds)
    notes.append(f"views were resampled to a focal length of {longest:.6g} pixels, cropped: {why}")
    middle = np.array(size) / 2
    centres = middle + (centres - middle) * longest / focal

    @lru_cache(maxsize=1)
    def places(lens: Lens, centre: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        x, y = np.meshgrid(*(np.arange(side) + 0.5 for side in size))
        with np.errstate(over="ignore", invalid="ignore"):
            places_seen = lens.seen((x - centre[0]) / longest, (y - centre[1]) / longest)
            u, v = (np.nan_to_num(np.clip(at - 0.5, -2, 1e6), nan=-2) for at in places_seen)
        return u.astype(np.float32), v.astype(np.float32)

    def read(k: int) -> np.ndarray:
        import cv2

        picture = pictures.read(files[k], size)
        at = places(scaled[k], tuple(centres[k].tolist()))
        out = cv2.remap(picture, *at, cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
        return out.clip(0, 1) if out.dtype == np.float32 else out

    return Pinholes(longest, centres, size, read, tuple(notes))

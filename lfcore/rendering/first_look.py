"""Prediction of a lattice's error from one view through the lens centre.

Errors occur where light changes.  The mean squared difference of a view's pixels to their
neighbours, in sRGB, bounds them.  The share of it that becomes an error depends on the blur and on
the lattice: in focus on the distance between the rays of all views, in wide blur on the number of
views.  So the mean squared error is a sum over bands of blur: the differences in a band, times a
power of the views and a power of a view's rays (fitted, docs/decisions.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import plain_views
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Slab
from lfcore.refocus.two_parts import placed_parts
from lfcore.rendering.by_depth import traced_views
from lfcore.tracing.tracer import Tracer

BANDS_PX = 1.0, 16.0
"""The blur diameters between bands, in pixels."""
STRAIGHT = 17
"""The least length, in pixels, of straight edges along the pixel grid: in focus all views have the
same error there."""
SHARE = np.array([0.0993, 0.0125, 0.0061, 0.6])
"""The share of the differences that becomes an error with one view and one ray per pixel: per band,
and of straight edges in focus.  In the last band it grows in proportion to the blur, because a
blurred edge errs over its whole width."""
BY_VIEWS = np.array([2.01, 1.28, 2.93, 2.0])
"""The exponents, per band, with which the share falls with the views per side."""
BY_SUBPIXELS = np.array([2.79, 2.26, 0.0, 2.0])
"""The exponents, per band, with which the share falls with a view's rays per pixel side."""
MARGIN_DB = 2.3
"""The safety margin: with it, nine of ten pictures are as good as expected or better."""
BRIGHTEST = 4.0
"""The radiance, in units of white, at which light is cut: brighter light saturates its pixels."""
BORDER = 0.08
"""The omitted margin, as a share of the side: parts of the lens do not see it."""


@dataclass(frozen=True)
class FirstLook:
    """Contrast and blur of pictures, from one view.

    Attributes
    ----------
    contrast : (H, W) mean squared difference of a pixel to its neighbours, sRGB.
    straight : (H, W) the part of the contrast along straight edges of the pixel grid.
    blur_px : (P, H, W) the diameter of blur on each plane, in pixels.
    narrower : (P,) the plane's aperture as a share of the traced lens, per side.
    """

    contrast: np.ndarray = field(repr=False)
    straight: np.ndarray = field(repr=False)
    blur_px: np.ndarray = field(repr=False)
    narrower: np.ndarray

    @classmethod
    def at(
        cls, tracer: Tracer, camera: Camera, planes: Sequence[SensorPlane], pixels: Pixels
    ) -> FirstLook:
        """Trace one view of ``camera``, whose lens contains the apertures of all ``planes``."""
        slab = Slab.of(camera, 1, pixels)
        views = plain_views(slab)
        _, _, parts = next(traced_views(tracer, views, Size.of(pixels).longer))
        light, depth = placed_parts(parts)[0]
        inverse = 1.0 / depth[0].astype(float)
        blur, narrower = [], []
        for plane in planes:
            scale = plane.magnification(slab) / slab.pixel_pitch
            lens = 2 * plane.lens_aperture(slab).radius_m
            blur.append(np.abs(plane.delta - inverse) * lens * scale)
            narrower.append(min(1.0, lens / (2 * camera.lens_radius_m)))
        most = min(BRIGHTEST, 2.0**tracer.needs.stops)
        return cls(*_contrast(light[0], most), np.stack(blur), np.array(narrower))

    def expected_db(self, views: np.ndarray | int, subpixels: np.ndarray | float) -> np.ndarray:
        """(P, ...) expected PSNR in dB, sRGB, of pictures of lattices."""
        views, subpixels = np.asarray(views, float), np.asarray(subpixels, float)
        per_band = (slice(None), *[None] * views.ndim)
        open_views = np.maximum(np.multiply.outer(self.narrower, views), 1.0)[:, None]
        # (P, bands, ...): the share of the differences in a band that becomes an error.
        share = (
            SHARE[per_band]
            * open_views ** -BY_VIEWS[per_band]
            * subpixels ** -BY_SUBPIXELS[per_band]
        )
        error = np.einsum("pb,pb...->p...", self._differences, share)
        return -10 * np.log10(np.maximum(error, 1e-12)) - MARGIN_DB

    @property
    def _parts(self) -> np.ndarray:
        """(P, bands + 1, H, W): the differences per band, and those of straight edges in focus.

        In the last band they are multiplied by the growth with blur.
        """
        bands = np.arange(len(BANDS_PX) + 1)[:, None, None]
        band = np.searchsorted(BANDS_PX, self.blur_px)
        grown = self.contrast * np.maximum(self.blur_px / BANDS_PX[-1], 1)
        parts = np.where(band[:, None] == bands, grown[:, None], 0.0)
        straight = np.where(band == 0, self.straight, 0.0)
        parts[:, 0] -= straight
        return np.concatenate([parts, straight[:, None]], axis=1)

    @cached_property
    def _differences(self) -> np.ndarray:
        """(P, bands + 1) the parts' means without the margin."""
        return np.stack([inner(part).mean(axis=(1, 2)) for part in self._parts])


def inner(pictures: np.ndarray) -> np.ndarray:
    """Pictures (P, H, W, ...) without the margin that parts of the lens do not see."""
    rows, columns = (
        slice(int(BORDER * side), side - int(BORDER * side)) for side in pictures.shape[1:3]
    )
    return pictures[:, rows, columns]


def _contrast(light: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) differences to neighbours, and the part of them along straight edges; light
    is cut at ``most``."""
    from scipy.ndimage import minimum_filter  # slow to import

    shown = srgb_encode(np.clip(light, 0, 1)) + np.clip(light, 1, most) ** (1 / 2.4) - 1
    total, straight = np.zeros((2, *shown.shape[:2]))
    for axis in range(2):
        squares = np.square(np.diff(shown, axis=axis)).mean(axis=-1) / 2
        along = minimum_filter(squares, [(STRAIGHT, 1), (1, STRAIGHT)][1 - axis])
        for before in ((0, 1), (1, 0)):
            sides = [before if side == axis else (0, 0) for side in range(2)]
            total += np.pad(squares, sides)
            straight += np.pad(along, sides)
    return total, straight

"""The error that a lattice of rays will have, predicted from one view through the lens's middle.

Rays err where light changes.  What a view's pixels differ from their neighbours, in mean squares
of sRGB, is the light that can go wrong.  How much of it does depends on the blur there and on the
lattice: in focus on the distance between the rays of all views, in wide blur on the number of
views.  So the mean squared error is a sum over bands of blur: the differences in a band, times a
power of the views and one of a view's rays (fitted, docs/decisions.md).
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
from lfcore.rendering.by_depth import traced_views
from lfcore.tracing.tracer import Tracer

BANDS_PX = 1.0, 16.0
"""Diameters of blur that part the bands, in pixels."""
STRAIGHT = 17
"""The length of edges along the pixel grid, in pixels, that all views blur alike in focus."""
SHARE = np.array([0.0993, 0.0125, 0.0061, 0.6])
"""The share of the differences that one view with one ray per pixel lacks: per band, and of
straight edges in focus.  In the last band it grows in proportion to the blur, because a blurred
edge errs over its whole width."""
BY_VIEWS = np.array([2.01, 1.28, 2.93, 2.0])
"""The power of the views per side by which the share falls."""
BY_SUBPIXELS = np.array([2.79, 2.26, 0.0, 2.0])
"""The power of a view's rays per pixel and side."""
MARGIN_DB = 2.3
"""What is subtracted, so that nine of ten pictures are as good as expected or better."""
BRIGHTEST = 4.0
"""Light above so many times white counts as that: it saturates its pixels anyway."""
BORDER = 0.08
"""The margin, as a share of the side, that is left out: not all of the lens sees it."""


@dataclass(frozen=True)
class FirstLook:
    """What one view shows of pictures.

    Attributes
    ----------
    contrast : (H, W) mean squared difference of a pixel to its neighbours, sRGB.
    straight : (H, W) the part of it along straight edges of the pixel grid.
    blur_px : (P, H, W) the diameter of its blur on each plane, in pixels.
    narrower : (P,) the plane's aperture as a share of the lens that is traced, per side.
    """

    contrast: np.ndarray = field(repr=False)
    straight: np.ndarray = field(repr=False)
    blur_px: np.ndarray = field(repr=False)
    narrower: np.ndarray

    @classmethod
    def at(
        cls, tracer: Tracer, camera: Camera, planes: Sequence[SensorPlane], pixels: Pixels
    ) -> FirstLook:
        """Trace one view of ``camera``, whose lens all ``planes`` are within."""
        slab = Slab.of(camera, 1, pixels)
        views = plain_views(slab)
        _, _, light, depth = next(traced_views(tracer, views, Size.of(pixels).longer))
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
        """(P, ...) PSNR in dB, sRGB, to expect of pictures of lattices."""
        views, subpixels = np.asarray(views, float), np.asarray(subpixels, float)
        each = (slice(None), *[None] * views.ndim)
        seen = np.maximum(np.multiply.outer(self.narrower, views), 1.0)[:, None]
        # (P, bands, ...): the share of the differences in a band that pictures lack.
        lacking = SHARE[each] * seen ** -BY_VIEWS[each] * subpixels ** -BY_SUBPIXELS[each]
        error = np.einsum("pb,pb...->p...", self._differences, lacking)
        return -10 * np.log10(np.maximum(error, 1e-12)) - MARGIN_DB

    @property
    def _parts(self) -> np.ndarray:
        """(P, bands + 1, H, W): the differences of each band, multiplied in the last by the growth
        with blur, and those of straight edges in focus."""
        bands = np.arange(len(BANDS_PX) + 1)[:, None, None]
        band = np.searchsorted(BANDS_PX, self.blur_px)
        grown = self.contrast * np.maximum(self.blur_px / BANDS_PX[-1], 1)
        parts = np.where(band[:, None] == bands, grown[:, None], 0.0)
        straight = np.where(band == 0, self.straight, 0.0)
        parts[:, 0] -= straight
        return np.concatenate([parts, straight[:, None]], axis=1)

    @cached_property
    def _differences(self) -> np.ndarray:
        """(P, bands + 1) their means without the margin."""
        return np.stack([inner(each).mean(axis=(1, 2)) for each in self._parts])


def inner(pictures: np.ndarray) -> np.ndarray:
    """Pictures (P, H, W, ...) without the margin that not all of the lens sees."""
    rows, columns = (
        slice(int(BORDER * side), side - int(BORDER * side)) for side in pictures.shape[1:3]
    )
    return pictures[:, rows, columns]


def _contrast(light: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) differences to neighbours, and the part of them along straight edges; light above
    white counts up to ``most``."""
    from scipy.ndimage import minimum_filter  # slow to import

    shown = srgb_encode(np.clip(light, 0, 1)) + np.clip(light, 1, most) ** (1 / 2.4) - 1
    total, straight = np.zeros((2, *shown.shape[:2]))
    for axis in range(2):
        apart = np.square(np.diff(shown, axis=axis)).mean(axis=-1) / 2
        along = minimum_filter(apart, [(STRAIGHT, 1), (1, STRAIGHT)][1 - axis])
        for before in ((0, 1), (1, 0)):
            sides = [before if each == axis else (0, 0) for each in range(2)]
            total += np.pad(apart, sides)
            straight += np.pad(along, sides)
    return total, straight

"""The plenoptic camera: a main lens, an array of microlenses, a photosensor at their focus.

Thesis section 3.2 and Algorithm 2.  The main lens is at z = 0, the microlenses at z = -v where the
main lens forms its image, the photosensor one microlens focal length behind them.  A photosensor
pixel sees one point of the main lens: the line from the middle of the pixel through the middle of
its microlens hits it.

**Approximation.**  That is one ray per pixel.  A real pixel gathers a bundle as wide as its
microlens.  Its rays are parallel outside the microlens, because the sensor is at its focus: a blur
of one microlens in the picture, and of one microlens pitch on the main lens.  The latter must be
small relative to a pixel's spot on the main lens, so the main lens must be beyond the microlenses'
hyperfocal distance; :class:`PlenopticCamera` refuses less.  Diffraction is left out.
"""

from dataclasses import dataclass

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab


@dataclass(frozen=True)
class PlenopticCamera:
    """A main lens with microlenses in the place of its sensor.

    Parameters
    ----------
    camera : Camera
        The main lens.
    lenses : int
        M: microlenses per side.
    samples : int
        N: photosensor pixels per side in the image of the main lens behind each microlens.

    Raises
    ------
    OpticsError
        The microlenses are wider than the main lens, or their hyperfocal distance is beyond it.
    """

    camera: Camera
    lenses: int
    samples: int

    def __post_init__(self) -> None:
        slab = self.slab()  # refuses impossible counts
        if self.lens_diameter_m <= self.pitch_m:
            problem = f"microlenses of {1e3 * self.pitch_m:.3g} mm are wider than the main lens"
            remedy = "Use more microlenses, or a wider main lens"
            raise OpticsError(problem, key="lenses", remedy=remedy)
        away, least = slab.camera.image_distance_m, self.hyperfocal_distance_m
        if not away > least:
            raise OpticsError(
                f"the main lens, {1e3 * away:.4g} mm away, is nearer than the microlenses' "
                f"hyperfocal distance of {1e3 * least:.4g} mm", key="samples",
                remedy="Use more microlenses, fewer samples, or a wider main lens",
            )  # fmt: skip

    @property
    def pitch_m(self) -> float:
        """The distance between microlenses."""
        return self.camera.sensor_width_m / self.lenses

    @property
    def lens_diameter_m(self) -> float:
        """The diameter of the main lens."""
        return 2.0 * self.camera.lens_radius_m

    @property
    def microlens_focal_length_m(self) -> float:
        """The focal length p v / (D - p), with which neighbouring images of the main lens touch.

        The images are p (1 + f / v) apart, and D f / v wide.
        """
        distance, pitch = self.camera.image_distance_m, self.pitch_m
        return pitch * distance / (self.lens_diameter_m - pitch)

    @property
    def image_pitch_m(self) -> float:
        """The distance between neighbouring images of the main lens on the photosensor."""
        return self.pitch_m * (1 + self.microlens_focal_length_m / self.camera.image_distance_m)

    @property
    def pixel_pitch_m(self) -> float:
        """The distance between pixels of the photosensor."""
        return self.image_pitch_m / self.samples

    @property
    def hyperfocal_distance_m(self) -> float:
        """A microlens's f^2 / (N c) + f, with a photosensor pixel as circle of confusion c."""
        focal = self.microlens_focal_length_m
        return focal * self.pitch_m / self.pixel_pitch_m + focal

    @property
    def photograph_side(self) -> int:
        """The side M N, pixels."""
        return self.lenses * self.samples

    def slab(self) -> Slab:
        """The light slab with the same rays (thesis section 3.3).

        Its pixels are the microlenses, its lens samples the photosensor pixels.
        """
        return Slab(self.camera, self.samples, self.lenses)


def sub_aperture(photograph: np.ndarray, samples: int, i: int, j: int) -> np.ndarray:
    """The pixel in column i and row j of every microlens's image, (M, M, 3) (section 3.2.1)."""
    views = sub_apertures(photograph, samples)
    if not (0 <= i < samples and 0 <= j < samples):
        raise OpticsError(f"pixels are from 0 to {samples - 1}, not ({i}, {j})")
    return views[j, i]


def sub_apertures(photograph: np.ndarray, samples: int) -> np.ndarray:
    """A photograph (M N, M N, 3) as (N, N, M, M, 3), indexed [j, i, v, u], without a copy."""
    side = len(photograph)
    if photograph.shape != (side, side, 3) or side % samples:
        problem = f"{photograph.shape} is no mosaic of {samples} x {samples} pixels"
        raise OpticsError(problem, key="samples")
    lenses = side // samples
    mosaic = photograph.reshape(lenses, samples, lenses, samples, 3)
    return mosaic.transpose(1, 3, 0, 2, 4)

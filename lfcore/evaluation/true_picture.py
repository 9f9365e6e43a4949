"""The true picture of a plane, averaged over pixels and lens, and its error."""

from collections.abc import Sequence
from dataclasses import dataclass
from operator import itemgetter
from pathlib import Path

import numpy as np

from lfcore.colour import display_values
from lfcore.errors import OpticsError
from lfcore.evaluation.metrics import psnr
from lfcore.files import read_arrays
from lfcore.optics.plane_pictures import load_stack, save_stack
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.first_look import BORDER
from lfcore.tracing.tracer import Tracer

BELOW_DB = 10.0
"""The least distance, dB, of a reference's error below the errors that it measures.  Independent
mean squares add up, so measured errors are then right to 0.5 dB."""


@dataclass(frozen=True)
class Reference:
    """True pictures of ``planes``: (P, H, W, 3) float32, linear light, and their own error.

    ``known_db`` (P,) is the PSNR of the mean of two different lattices, estimated from their
    difference; right to 1.5 dB in checks (docs/decisions.md).
    """

    planes: list[SensorPlane]
    pictures: np.ndarray
    known_db: np.ndarray

    @property
    def size(self) -> Size:
        """Width and height of the pictures."""
        return Size(*self.pictures.shape[2:0:-1])

    def psnr(self, pictures: np.ndarray) -> list[float]:
        """dB of ``pictures`` (P, H, W, 3) of the planes, linear light, as :func:`inner_psnr`."""
        return [inner_psnr(*pair) for pair in zip(pictures, self.pictures, strict=True)]


def inner_psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    """dB of sRGB pictures (H, W, 3) without the border that parts of the lens do not see."""
    border = int(np.ceil(BORDER * max(truth.shape[:2])))
    rows, columns = (slice(border, side - border) for side in truth.shape[:2])
    values, true_values = (display_values(image[rows, columns]) for image in (picture, truth))
    return psnr(values, true_values, peak=255)


def true_pictures(
    tracer: Tracer, planes: Sequence[SensorPlane], pixels: Pixels, lattices: Sequence[Lattice]
) -> Reference:
    """Trace all planes from the same rays, by each of two lattices.

    Raises :class:`OpticsError` if the lattices' views or sub-pixels are equal: their difference
    would not show their errors.
    """
    first, second = lattices
    if first.views == second.views or first.subpixels == second.subpixels:
        raise OpticsError(
            f"{first} and {second} are too similar to estimate their errors",
            key="truth",
            remedy="Give lattices with different lens samples and different rays per pixel",
        )
    camera, weights = tracer.scene.camera, [lattice.rays_per_pixel for lattice in lattices]
    pair = [pictures_by_depth(tracer, camera, planes, pixels, lattice) for lattice in lattices]
    pictures = np.average(pair, axis=0, weights=weights).astype(np.float32)
    # If both pictures have independent mean squared errors e, their difference has 2 e, and their
    # mean has e / 2.  We measured that errors which both have in common are about e / 2, too.
    known_db = [inner_psnr(*images) + 10 * np.log10(2) for images in zip(*pair, strict=True)]
    return Reference(list(planes), pictures, np.array(known_db))


def save_reference(path: str | Path, reference: Reference) -> None:
    """Write the reference as npz: a stack of planes, and its error."""
    save_stack(path, reference.pictures, reference.planes, known_db=reference.known_db)


def load_reference(path: str | Path) -> Reference:
    """Read a file of :func:`save_reference`; raises :class:`LfcoreError` for any other file."""
    pictures, planes = load_stack(path)
    return Reference(planes, pictures, read_arrays(path, "reference", itemgetter("known_db")))

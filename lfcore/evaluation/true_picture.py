"""The true picture of a plane: averaged over its pixels and the lens, and how well it is known."""

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
"""How far a reference's own error must be below an error that it judges.  Independent mean squares
add up, so the measured error is then right to 0.5 dB."""


@dataclass(frozen=True)
class Reference:
    """True pictures of ``planes``: (P, H, W, 3) float32, linear light, and their own error.

    ``known_db`` is (P,): the PSNR to which the mean of two unlike lattices is known, estimated by
    their difference; right to 1.5 dB where it was checked (docs/decisions.md).
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
    """dB of sRGB pictures (H, W, 3) without the border that not all of the lens sees."""
    border = int(np.ceil(BORDER * max(truth.shape[:2])))
    rows, columns = (slice(border, side - border) for side in truth.shape[:2])
    one, two = (display_values(each[rows, columns]) for each in (picture, truth))
    return psnr(one, two, peak=255)


def true_pictures(
    tracer: Tracer, planes: Sequence[SensorPlane], pixels: Pixels, lattices: Sequence[Lattice]
) -> Reference:
    """Trace all planes from the same rays, by each of two lattices.

    Raises :class:`OpticsError` for lattices too alike to tell each other's error: views and
    sub-pixels must both differ.
    """
    one, two = lattices
    if one.views == two.views or one.subpixels == two.subpixels:
        raise OpticsError(
            f"{one} and {two} are too alike to tell each other's error",
            key="truth",
            remedy="Give lattices of unlike lens samples and unlike rays per pixel",
        )
    camera, weights = tracer.scene.camera, [lattice.rays_per_pixel for lattice in lattices]
    pair = [pictures_by_depth(tracer, camera, planes, pixels, each) for each in lattices]
    pictures = np.average(pair, axis=0, weights=weights).astype(np.float32)
    # Two independent errors e differ by 2 e in mean squares, and their mean errs by e / 2.
    # Errors that both have alike do not differ; they were found to be as large again.
    known = [inner_psnr(*both) + 10 * np.log10(2) for both in zip(*pair, strict=True)]
    return Reference(list(planes), pictures, np.array(known))


def save_reference(path: str | Path, reference: Reference) -> None:
    """Write it as npz: a stack of planes, and its error."""
    save_stack(path, reference.pictures, reference.planes, known_db=reference.known_db)


def load_reference(path: str | Path) -> Reference:
    """Read a file of :func:`save_reference`; raises :class:`LfcoreError` for any other file."""
    pictures, planes = load_stack(path)
    return Reference(planes, pictures, read_arrays(path, "reference", itemgetter("known_db")))

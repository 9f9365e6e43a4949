"""Pictures of a wanted quality: a pilot's two lattices say how many rays it takes.

Two lattices of unlike views and displacements err independently, by mean squares that fall as
their rays rise.  So what they disagree by tells the error of either, and of more rays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.by_depth import RayCount, pictures_by_depth
from lfcore.tracing.tracer import Tracer

PILOT = (RayCount(4, 1), RayCount(4, 1.5))
PILOT_FOOTPRINT_PX = 0.125
LATTICES = (
    (RayCount(4, 1), 1.5),
    (RayCount(4, 1.5), 1.5),
    (RayCount(4, 2), 1.0),
    (RayCount(5, 2), 1.0),
    (RayCount(6, 2), 1.0),
    (RayCount(8, 2), 1.2),
    (RayCount(8, 3), 2.0),
    (RayCount(8, 4), 3.0),
    (RayCount(12, 4), 4.0),
    (RayCount(16, 4), 5.0),
)
"""What to choose from, fewest rays first, and by how many dB the pilot promises too much: what few
lens samples get wrong alike is no disagreement.  Measured, docs/notebook/true-picture.md."""
BORDER = 0.08
"""Of a picture's side: what not all of the lens sees is not judged."""


@dataclass(frozen=True)
class Rendering:
    """Pictures, and what is expected of them.

    Attributes
    ----------
    pictures : (P, M, M, 3) float32, linear light.
    count : the rays of a pixel that they were made of.
    expected_db : (P,) PSNR of each, sRGB, against the average over pixel and lens.
    """

    pictures: np.ndarray
    count: RayCount
    expected_db: np.ndarray


def pictures_of_quality(
    tracer: Tracer,
    camera: Camera,
    planes: Sequence[SensorPlane],
    pixels: int,
    quality_db: float,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> Rendering:
    """As :func:`pictures_by_depth`, with the fewest rays that give the worst plane ``quality_db``.

    Raises :class:`OpticsError` for a quality that no lattice is expected to reach.
    """
    made = pilot_pictures(tracer, camera, planes, pixels)
    expected = expectations(*made)
    reached = [(count, db) for count, db in expected if db.min() >= quality_db]
    if not reached:
        best, db = expected[-1]
        raise OpticsError(
            f"{quality_db:g} dB takes more than {best.rays_a_pixel:,.0f} rays a pixel",
            key="quality",
            remedy=f"Ask for at most {db.min():.1f} dB, or for fewer planes",
        )
    count, db = reached[0]
    if count in PILOT:
        return Rendering(made[PILOT.index(count)], count, db)
    pictures = pictures_by_depth(tracer, camera, planes, pixels, count, progress=progress)
    return Rendering(pictures, count, db)


def pilot_pictures(
    tracer: Tracer, camera: Camera, planes: Sequence[SensorPlane], pixels: int
) -> list[np.ndarray]:
    """The pictures (P, M, M, 3) that :func:`expectations` compares.

    Their textures are filtered as those of many rays are: what aliases there must be seen here.
    """
    return [
        pictures_by_depth(tracer, camera, planes, pixels, count, footprint_px=PILOT_FOOTPRINT_PX)
        for count in PILOT
    ]


def expectations(one: np.ndarray, two: np.ndarray) -> list[tuple[RayCount, np.ndarray]]:
    """PSNR in dB of each plane to be expected of every lattice, (P,) each.

    ``one`` and ``two`` are the pilot's pictures (P, M, M, 3), linear light.
    """
    border = int(BORDER * one.shape[1])
    inner = np.s_[:, border : one.shape[1] - border, border : one.shape[1] - border]
    off = np.square(srgb_encode(one[inner].astype(float)) - srgb_encode(two[inner].astype(float)))
    apart = np.maximum(off.mean(axis=(1, 2, 3)), 1e-12)
    of_one_ray = apart / sum(1 / count.rays_a_pixel for count in PILOT)
    return [
        (count, -10 * np.log10(of_one_ray / count.rays_a_pixel) - too_much)
        for count, too_much in LATTICES
    ]

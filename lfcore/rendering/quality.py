"""Pictures of a wanted quality: rounds of rays, until their disagreement says it is reached.

Two lattices of unlike views and sub-pixels err independently, by mean squares that fall as their
rays rise.  So what they disagree by tells their error, and how many more rays a quality takes.  The
mean of all rounds, weighted by their rays, is as good as one lattice of as many: no ray of the
pilot is lost (docs/notebook/true-picture.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.by_depth import FOOTPRINT, RayCount, pictures_by_depth
from lfcore.tracing.tracer import Tracer

PILOT = (RayCount(2, 1), RayCount(3, 0.75))
FOOTPRINT_PX = 0.0625
"""The widest tangent, in pixels, that a round's textures are filtered over.  A round of few rays
must see the detail that many rays see, or it would say that they agree."""
SHARED_DB = 2.0
"""Both lattices of a pair get something wrong alike, which their disagreement does not tell: this
is taken off (measured, docs/notebook/true-picture.md)."""
MOST_RAYS = 4096
"""Rays of a pixel that a quality may take where no budget is given."""
GROWTH, LAST_GROWTH = 8.0, 0.6
"""A pair of rounds adds up to GROWTH times the rays so far.  Where no more than LAST_GROWTH times
the rays so far are missing, one lattice ends it."""
PAIR_SHARE = 0.7
"""Share of the missing rays that a pair traces; its disagreement then says better how many miss."""
PILOT_SHARE, PLANNED_DB, PLANNED_PLANES = 0.1, 1.5, 5
"""Where rays are planned and not traced: the pilot's share of them, what is taken off for its
uncertainty (measured, docs/notebook/true-picture.md), and how many planes stand for a range."""
BORDER = 0.08
"""Share of a picture's side that is left out at each rim, which not all of the lens sees."""


@dataclass(frozen=True)
class Rendering:
    """Pictures, and what is expected of them.

    Attributes
    ----------
    pictures : (P, M, M, 3) float32, linear light.
    counts : the lattices of rays that they are the mean of.
    expected_db : (P,) PSNR of each, sRGB, against the average over pixel and lens.
    error : (P, M, M) float32: the error of each pixel to be expected, sRGB in [0, 1], root mean
        square over channels.  Of one pixel it is itself as uncertain; smooth it to compare places.
    """

    pictures: np.ndarray
    counts: tuple[RayCount, ...]
    expected_db: np.ndarray
    error: np.ndarray

    @property
    def rays_a_pixel(self) -> float:
        return sum(count.rays_a_pixel for count in self.counts)


def pictures_of_quality(
    tracer: Tracer,
    camera: Camera,
    planes: Sequence[SensorPlane],
    pixels: int,
    quality_db: float,
    *,
    most_rays: float = MOST_RAYS,
    progress: Callable[[int, int], None] | None = None,
) -> Rendering:
    """As :func:`pictures_by_depth`, with about as few rays as give the worst plane ``quality_db``.

    ``most_rays`` is the budget, a pixel.  ``progress`` is called with (rays a pixel done, of those
    wanted as far as is known).

    Raises :class:`OpticsError` for a quality that is expected to take more.
    """

    trace = _tracing(tracer, camera, planes, pixels)
    rounds = _Rounds([(count, trace(count)) for count in PILOT])
    while True:
        missing = rounds.missing_rays(quality_db)
        if missing <= 0:
            return rounds.rendering()
        wanted = rounds.rays + missing
        if wanted > most_rays:
            raise _too_much(quality_db, wanted, most_rays, rounds)
        if progress:
            progress(round(rounds.rays), round(wanted))
        if missing <= LAST_GROWTH * rounds.rays:
            count = one_lattice(missing)
            rounds.add(count, trace(count))
        else:
            rays = min(PAIR_SHARE * missing, GROWTH * rounds.rays)
            pair = unlike_lattices(rays / 2)
            rounds.add_pair([(count, trace(count)) for count in pair])


@dataclass(frozen=True)
class PlannedRays:
    """A lattice for pictures between two distances, and the PSNR in dB to be expected of the worst.

    ``pilot_rays`` are the rays of a pixel that said so.
    """

    count: RayCount
    expected_db: float
    pilot_rays: float


def rays_of_quality(
    tracer: Tracer,
    camera: Camera,
    planes: Sequence[SensorPlane],
    pixels: int,
    quality_db: float,
    *,
    most_rays: float = MOST_RAYS,
) -> PlannedRays:
    """The lattice that is to give the worst plane ``quality_db``, without tracing it.

    A pilot of a tenth of its rays, but of 9 a pixel at least, says how many it takes.  Views are
    of a multiple of 8 pixels, as encoders like them.

    Raises :class:`OpticsError` for a quality that is expected to take more than ``most_rays``.
    """
    trace = _tracing(tracer, camera, planes, pixels)
    rounds = _Rounds([(count, trace(count)) for count in PILOT])
    while True:
        wanted = rounds.wanted_rays(quality_db + PLANNED_DB)
        if wanted > most_rays:
            raise _too_much(quality_db, wanted, most_rays, rounds, PLANNED_DB)
        lacking = PILOT_SHARE * wanted - rounds.rays
        if lacking < 1:
            break
        pair = unlike_lattices(min(lacking, GROWTH * rounds.rays) / 2)
        rounds.add_pair([(count, trace(count)) for count in pair])
    count = one_lattice(wanted)
    side = 8 * math.ceil(count.subpixels * pixels / 8)
    count = RayCount(count.views, side / pixels)
    expected = float(rounds.expected_db(count.rays_a_pixel).min()) - PLANNED_DB
    return PlannedRays(count, expected, rounds.rays)


def planes_between(camera: Camera, near_m: float, far_m: float) -> list[SensorPlane]:
    """Planes of the whole lens from the nearest to the farthest focus, evenly in dioptres.

    Raises :class:`OpticsError` for distances that are none, or in the wrong order.
    """
    if not 0 < near_m <= far_m:
        raise OpticsError(
            f"must be two distances, the nearer first, not {near_m:g} and {far_m:g}",
            key="focus_range_m",
        )
    focus = np.linspace(1 / near_m, 1 / far_m, PLANNED_PLANES)
    return [SensorPlane(1 / d if d else math.inf, camera.f_number) for d in focus.tolist()]


def _tracing(
    tracer: Tracer, camera: Camera, planes: Sequence[SensorPlane], pixels: int
) -> Callable[[RayCount], np.ndarray]:
    """What makes the pictures of a round."""

    def trace(count: RayCount) -> np.ndarray:
        own = FOOTPRINT * pixels / (count.views * count.side(pixels))
        footprint = min(FOOTPRINT_PX, own)
        return pictures_by_depth(tracer, camera, planes, pixels, count, footprint_px=footprint)

    return trace


def _too_much(
    quality_db: float, wanted: float, most: float, rounds: _Rounds, margin_db: float = 0.0
) -> OpticsError:
    reachable = rounds.expected_db(most).min() - margin_db
    return OpticsError(
        f"{quality_db:g} dB takes about {wanted:,.0f} rays a pixel, and the budget is {most:,.0f}",
        key="quality",
        remedy=f"Ask for at most {reachable:.1f} dB, for fewer planes, or give a larger budget",
    )


def one_lattice(rays: float) -> RayCount:
    """A lattice of so many rays a pixel, about as many views as its sub-pixels want."""
    side = math.sqrt(rays)
    views = max(1, round(2 * math.sqrt(side)))
    return RayCount(views, side / views)


def unlike_lattices(rays: float) -> tuple[RayCount, RayCount]:
    """Two lattices of so many rays a pixel each; their numbers of views, and of sub-pixels, are a
    third or more apart."""
    side = math.sqrt(rays)
    few = max(1, round(1.7 * math.sqrt(side)))
    many = max(few + 1, round(2.4 * math.sqrt(side)))
    return RayCount(few, side / few), RayCount(many, side / many)


Round = tuple[RayCount, np.ndarray]


class _Rounds:
    """What was traced: the last pair of lattices tells the error of all together."""

    def __init__(self, pilot: Sequence[Round]):
        self.counts: list[RayCount] = []
        self._sum = np.zeros_like(pilot[0][1], np.float64)
        self.add_pair(pilot)

    @property
    def rays(self) -> float:
        """Rays of a pixel that were traced."""
        return sum(count.rays_a_pixel for count in self.counts)

    def add(self, count: RayCount, pictures: np.ndarray) -> None:
        self.counts.append(count)
        self._sum += count.rays_a_pixel * pictures

    def add_pair(self, pair: Sequence[Round]) -> None:
        """Add two rounds, whose disagreement replaces what was known of the error."""
        for count, pictures in pair:
            self.add(count, pictures)
        encoded = [srgb_encode(pictures.astype(np.float64)) for _, pictures in pair]
        # Errors of k / n each are apart by k (1 / n1 + 1 / n2) in mean squares.
        apart = np.square(encoded[0] - encoded[1]).mean(axis=-1)
        self._of_one_ray = apart / sum(1 / count.rays_a_pixel for count, _ in pair)

    def expected_db(self, rays: float) -> np.ndarray:
        """(P,) PSNR in dB to be expected of pictures of so many rays a pixel."""
        side = self._of_one_ray.shape[1]
        inner = slice(int(BORDER * side), side - int(BORDER * side))
        found = self._of_one_ray[:, inner, inner].mean(axis=(1, 2)) / rays
        return -10 * np.log10(np.maximum(found, 1e-12)) - SHARED_DB

    def wanted_rays(self, quality_db: float) -> float:
        """Rays of a pixel that the quality takes in all."""
        lacking = quality_db - float(self.expected_db(self.rays).min())
        return self.rays * 10 ** (min(lacking, 200.0) / 10)

    def missing_rays(self, quality_db: float) -> float:
        """Rays of a pixel that the quality still takes; 0 where it is reached."""
        missing = self.wanted_rays(quality_db) - self.rays
        return missing if missing > 1e-6 * self.rays else 0.0

    def rendering(self) -> Rendering:
        error = np.sqrt(self._of_one_ray / self.rays).astype(np.float32)
        pictures = (self._sum / self.rays).astype(np.float32)
        return Rendering(pictures, tuple(self.counts), self.expected_db(self.rays), error)

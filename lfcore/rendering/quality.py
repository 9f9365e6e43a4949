"""Pictures of a requested quality: rounds of rays, until their difference shows that it is reached.

Two lattices with unlike views and sub-pixels have independent errors, whose mean squares fall as
the number of rays rises.  So their difference gives the error, and the rays that a quality needs.
The picture is the mean of all rounds.  The weights grow faster than the number of rays, so the mean
is about as good as one lattice with as many rays (docs/notebook/true-picture.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import OpticsError, answers_typos
from lfcore.optics.camera import Camera
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.refocus.depth_slicing import LEAST_OF_RAY
from lfcore.rendering.by_depth import FOOTPRINT, pictures_by_depth
from lfcore.tracing.tracer import Tracer

PILOT = (Lattice(2, 1), Lattice(3, 0.75))
FOOTPRINT_PX = 0.0625
"""The widest filter of a round's textures, in pixels.  Rounds of few rays must see the detail that
many rays see; else they would agree wrongly."""
SHARED_DB = 1.5
"""The error in dB that both lattices of a pair share, so that their disagreement does not show it;
it is subtracted (measured, docs/notebook/true-picture.md)."""
WEIGHT = 1.5
"""The exponent of a round's number of rays in its weight.  Errors fall faster than rays rise: with
exponent 1 the pilot would spoil the mean (measured there)."""
MOST_RAYS = 4096
"""The default budget of a quality, in rays per pixel."""
GROWTH, LAST_GROWTH = 8.0, 0.6
"""A pair of rounds adds at most GROWTH times the rays so far.  When at most LAST_GROWTH times the
rays so far are missing, one lattice ends the search."""
PAIR_SHARE = 0.7
"""The share of the missing rays that a pair traces; its disagreement improves the prediction."""
PILOT_SHARE, PLANNED_PLANES = 0.1, 5
"""Of a plan: the pilot's share of the rays, and the number of planes that represent a range."""
BORDER = 0.08
"""The margin, as a share of the side, that is left out: not all of the lens sees it."""


@answers_typos
@dataclass(frozen=True)
class Quality:
    """A quality of pictures, for which the rays are chosen.

    Parameters
    ----------
    quality_db : float
        PSNR in dB of the worst picture against the average over pixel and lens, sRGB.
    most_rays : float
        The budget, in rays per pixel.
    focus_range_m : (float, float), optional
        Nearest and farthest focus of the pictures of a light field, metres; default what is seen.

    Raises
    ------
    OpticsError
        A number that is not positive, or distances in the wrong order.
    """

    quality_db: float
    most_rays: float = MOST_RAYS
    focus_range_m: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.quality_db) and self.quality_db > 0):
            problem = f"must be a positive number of dB, not {self.quality_db}"
            raise OpticsError(problem, key="quality_db")
        if not self.most_rays > 0:
            raise OpticsError(f"must be positive, not {self.most_rays:g}", key="most_rays")
        if self.focus_range_m is not None:
            near, far = self.focus_range_m
            if not 0 < near <= far:
                problem = f"must be two distances, the nearer first, not {near:g} and {far:g}"
                raise OpticsError(problem, key="focus_range_m")


@dataclass(frozen=True)
class Rendering:
    """Pictures, and their expected errors.

    Attributes
    ----------
    pictures : ndarray
        (P, M, M, 3) float32, linear light.
    lattices : tuple of Lattice
        The lattices of rays that they are the mean of.
    expected_db : ndarray
        (P,) PSNR of each, sRGB, against the average over pixel and lens.
    error : ndarray
        (P, M, M) float32: the expected error of each pixel, sRGB in [0, 1], root mean square over
        channels.  It is uncertain itself; smooth it to compare places.
    """

    pictures: np.ndarray = field(repr=False)
    lattices: tuple[Lattice, ...]
    expected_db: np.ndarray
    error: np.ndarray = field(repr=False)

    @property
    def rays_per_pixel(self) -> float:
        return sum(lattice.rays_per_pixel for lattice in self.lattices)


@dataclass(frozen=True)
class PlannedRays:
    """A lattice for pictures between two distances, and the expected PSNR in dB of the worst.

    ``pilot_rays`` are the rays per pixel of the pilot.
    """

    lattice: Lattice
    expected_db: float
    pilot_rays: float


@dataclass(frozen=True)
class QualitySearch:
    """The search for the rays that pictures need for a quality.

    Attributes
    ----------
    quality : its ``quality_db`` and ``most_rays``.
    """

    tracer: Tracer
    camera: Camera
    planes: Sequence[SensorPlane]
    pixels: Pixels
    quality: Quality

    def pictures(self, progress: Callable[[int, int], None] | None = None) -> Rendering:
        """Trace the pictures with about as few rays as the quality needs.

        ``progress`` is called with (rays per pixel done, of those expected to be needed).
        Raises :class:`OpticsError` for a quality that needs more than the budget.
        """
        rounds = self._pilot()
        while True:
            missing = rounds.missing_rays(self.quality.quality_db)
            if missing <= 0:
                return rounds.rendering()
            wanted = rounds.rays + missing
            if wanted > self.quality.most_rays:
                raise self._too_much(wanted, rounds.reachable_db(self.quality.most_rays))
            if progress:
                progress(round(rounds.rays), round(wanted))
            if missing <= LAST_GROWTH * rounds.rays:
                lattice = one_lattice(missing)
                rounds.add(lattice, self._trace(lattice))
            else:
                self._add_pair(rounds, min(PAIR_SHARE * missing, GROWTH * rounds.rays))

    def plan(self, spare_db: float = 0.0) -> PlannedRays:
        """Predict the lattice that reaches the quality and ``spare_db`` more, without tracing it.

        The pilot traces a tenth of its rays, at least 9 per pixel.  The longer side of a view
        is a multiple of 8 pixels, for encoders.
        Raises :class:`OpticsError` for a quality that needs more than the budget.
        """
        rounds = self._pilot()
        while True:
            wanted = rounds.rays_of_one(self.quality.quality_db + spare_db)
            if wanted > self.quality.most_rays:
                reachable = rounds.db_of_one(self.quality.most_rays) - spare_db
                raise self._too_much(wanted, reachable)
            lacking = PILOT_SHARE * wanted - rounds.rays
            if lacking < 1:
                break
            self._add_pair(rounds, min(lacking, GROWTH * rounds.rays))
        lattice = one_lattice(wanted)
        pixels = Size.of(self.pixels).longer
        lattice = Lattice(lattice.views, 8 * math.ceil(lattice.subpixels * pixels / 8) / pixels)
        return PlannedRays(lattice, rounds.db_of_one(lattice.rays_per_pixel), rounds.rays)

    def _pilot(self) -> _Rounds:
        return _Rounds([(lattice, self._trace(lattice)) for lattice in PILOT])

    def _add_pair(self, rounds: _Rounds, rays: float) -> None:
        """Two unlike lattices of ``rays`` together."""
        rounds.add_pair([(lattice, self._trace(lattice)) for lattice in unlike_lattices(rays / 2)])

    def _trace(self, lattice: Lattice) -> np.ndarray:
        """The pictures of one round."""
        pixels = Size.of(self.pixels).longer
        between = pixels / (lattice.views * lattice.side(pixels))
        return pictures_by_depth(
            self.tracer, self.camera, self.planes, self.pixels, lattice,
            footprint_px=min(FOOTPRINT_PX, FOOTPRINT * between),
            least_px=min(1.0, lattice.views * LEAST_OF_RAY) * between,
        )  # fmt: skip

    def _too_much(self, wanted: float, reachable_db: float) -> OpticsError:
        takes = f"{self.quality.quality_db:g} dB takes about {wanted:,.0f} rays per pixel"
        return OpticsError(
            f"{takes}, and the budget is {self.quality.most_rays:,.0f}",
            key="quality_db",
            remedy=f"Ask for at most {reachable_db:.1f} dB, for fewer planes, or give a larger "
            "budget",
        )


def inner(pictures: np.ndarray) -> np.ndarray:
    """Pictures (P, H, W, ...) without the margin that not all of the lens sees."""
    rows, columns = (
        slice(int(BORDER * side), side - int(BORDER * side)) for side in pictures.shape[1:3]
    )
    return pictures[:, rows, columns]


def planes_between(camera: Camera, near_m: float, far_m: float) -> list[SensorPlane]:
    """Planes of the whole lens from the nearest to the farthest focus, evenly in dioptres."""
    focus = np.linspace(1 / near_m, 1 / far_m, PLANNED_PLANES)
    return [SensorPlane(1 / d if d else math.inf, camera.f_number) for d in focus.tolist()]


def one_lattice(rays: float) -> Lattice:
    """A lattice of ``rays`` per pixel with balanced views and sub-pixels."""
    side = math.sqrt(rays)
    views = max(1, round(2 * math.sqrt(side)))
    return Lattice(views, side / views)


def unlike_lattices(rays: float) -> tuple[Lattice, Lattice]:
    """Two lattices of ``rays`` per pixel each, whose views and sub-pixels differ by a third or
    more."""
    side = math.sqrt(rays)
    few = max(1, round(1.7 * math.sqrt(side)))
    many = max(few + 1, round(2.4 * math.sqrt(side)))
    return Lattice(few, side / few), Lattice(many, side / many)


Round = tuple[Lattice, np.ndarray]


class _Rounds:
    """The rounds so far; the disagreement of the last pair predicts the error of their mean."""

    def __init__(self, pilot: Sequence[Round]):
        self.lattices: list[Lattice] = []
        self._sum = np.zeros_like(pilot[0][1], np.float64)
        self._weight = self._spread = 0.0
        self.add_pair(pilot)

    @property
    def rays(self) -> float:
        """Rays per pixel so far."""
        return sum(lattice.rays_per_pixel for lattice in self.lattices)

    def add(self, lattice: Lattice, pictures: np.ndarray) -> None:
        weight, spread = _weight_and_spread(lattice.rays_per_pixel)
        self.lattices.append(lattice)
        self._sum += weight * pictures
        self._weight += weight
        self._spread += spread

    def add_pair(self, pair: Sequence[Round]) -> None:
        """Add two rounds, whose disagreement replaces the estimate of the error."""
        for lattice, pictures in pair:
            self.add(lattice, pictures)
        encoded = [srgb_encode(pictures.astype(np.float64)) for _, pictures in pair]
        # Errors of k / n1 and k / n2 differ by k (1 / n1 + 1 / n2) in mean squares.
        apart = np.square(encoded[0] - encoded[1]).mean(axis=-1)
        self._of_one_ray = apart / sum(1 / lattice.rays_per_pixel for lattice, _ in pair)

    def _worth(self, more: float = 0.0) -> float:
        """The rays per pixel of one lattice with the error of the mean, with a round of ``more``
        rays added."""
        weight, spread = _weight_and_spread(more)
        return (self._weight + weight) ** 2 / (self._spread + spread)

    def expected_db(self, rays: float | None = None) -> np.ndarray:
        """(P,) expected PSNR in dB of the mean of the rounds, or of one lattice of ``rays``."""
        found = inner(self._of_one_ray).mean(axis=(1, 2)) / (rays or self._worth())
        return -10 * np.log10(np.maximum(found, 1e-12)) - SHARED_DB

    def db_of_one(self, rays: float) -> float:
        """Expected PSNR of the worst plane with one lattice of ``rays`` per pixel."""
        return float(self.expected_db(rays).min())

    def rays_of_one(self, quality_db: float) -> float:
        """Rays per pixel that one lattice needs for the quality."""
        return 10 ** (min(quality_db - self.db_of_one(1.0), 200.0) / 10)

    def reachable_db(self, rays: float) -> float:
        """Expected PSNR of the worst plane with ``rays`` per pixel in all."""
        return self.db_of_one(self._worth(max(rays - self.rays, 0.0)))

    def missing_rays(self, quality_db: float) -> float:
        """Rays per pixel of one more lattice that reaches the quality; 0 where it is reached."""
        wanted = self.rays_of_one(quality_db)
        if wanted <= self._worth() * (1 + 1e-6):
            return 0.0
        low, high = 0.0, wanted  # enough alone
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self._worth(middle) < wanted else (low, middle)
        return high

    def rendering(self) -> Rendering:
        error = np.sqrt(self._of_one_ray / self._worth()).astype(np.float32)
        pictures = (self._sum / self._weight).astype(np.float32)
        return Rendering(pictures, tuple(self.lattices), self.expected_db(), error)


def _weight_and_spread(rays: float) -> tuple[float, float]:
    """The weight of a round in the mean, and its part of the mean's error, weight^2 / rays."""
    return rays**WEIGHT, rays ** (2 * WEIGHT - 1)

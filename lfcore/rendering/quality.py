"""Pictures of a requested quality: one view predicts the cheapest lattice that reaches it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lfcore.errors import OpticsError, suggest_keywords
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice
from lfcore.progress import Progress
from lfcore.rendering.by_depth import pictures_by_depth, traced_camera
from lfcore.rendering.first_look import FirstLook
from lfcore.tracing.tracer import Tracer

VIEWS = range(1, 65)
"""The choices of views per side."""
SUBPIXELS = [k / 8 for k in range(8, 65)]
"""The choices of a view's rays per pixel side; at most the number of views."""
VIEW_COST = 2.5
"""The fixed cost of a view, in rays per pixel (bike, bedroom and a mesh, M = 128)."""
MOST_RAYS = 4096
"""The default budget of a quality, in rays per pixel."""
PLANNED_PLANES = 5
"""The number of planes that represent a range."""


@suggest_keywords
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
        Nearest and farthest focus of the pictures of a light field, metres; default the visible
        depths.

    Raises
    ------
    OpticsError
        A number that is not positive, or distances in the wrong order.

    Examples
    --------
    >>> lfcore.Quality(40, most_rays=256).quality_db
    40
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
        (P, height, width, 3) float32, linear light.
    lattice : Lattice
        The rays.
    expected_db : ndarray
        (P,) PSNR of each, sRGB, against the average over pixel and lens.
    """

    pictures: np.ndarray = field(repr=False)
    lattice: Lattice
    expected_db: np.ndarray

    @property
    def rays_per_pixel(self) -> float:
        return self.lattice.rays_per_pixel


@dataclass(frozen=True)
class QualitySearch:
    """The search for the rays that pictures need for a quality."""

    tracer: Tracer
    camera: Camera
    planes: Sequence[SensorPlane]
    pixels: Pixels
    quality: Quality

    @cached_property
    def look(self) -> FirstLook:
        """Contrast and blur of the pictures, from one view."""
        planes = list(self.planes)
        camera = traced_camera(self.camera, planes)
        return FirstLook.at(self.tracer, camera, planes, self.pixels)

    def pictures(self, progress: Progress | None = None) -> Rendering:
        """Trace the pictures with about as few rays as the quality needs."""
        lattice = self.lattice()
        pictures = pictures_by_depth(
            self.tracer, self.camera, self.planes, self.pixels, lattice, progress=progress
        )
        expected = self.look.expected_db(lattice.views, lattice.subpixels)
        return Rendering(pictures, lattice, expected)

    def plan(self, spare_db: float = 0.0) -> Lattice:
        """As :meth:`lattice`, with a multiple of 8 pixels on a view's longer side, for encoders."""
        lattice, pixels = self.lattice(spare_db), Size.of(self.pixels).longer
        return Lattice(lattice.views, 8 * math.ceil(lattice.subpixels * pixels / 8) / pixels)

    def lattice(self, spare_db: float = 0.0) -> Lattice:
        """The cheapest lattice that is expected to reach the quality and ``spare_db`` more.

        Raises :class:`OpticsError` for a quality that needs more than the budget.
        """
        target_db, budget = self.quality.quality_db + spare_db, self.quality.most_rays
        views, subpixels = (values.ravel() for values in np.meshgrid(VIEWS, SUBPIXELS))
        fewer = subpixels <= views
        views, subpixels = views[fewer], subpixels[fewer]
        db = self.look.expected_db(views, subpixels).min(axis=0)
        rays = (views * subpixels) ** 2
        fits = np.flatnonzero((db >= target_db) & (rays <= budget))
        if not len(fits):
            raise self._too_much(rays, db - spare_db)
        best = fits[np.argmin(views[fits] ** 2 * (subpixels[fits] ** 2 + VIEW_COST))]
        return Lattice(int(views[best]), float(subpixels[best]))

    def _too_much(self, rays: np.ndarray, db: np.ndarray) -> OpticsError:
        reached, most = db >= self.quality.quality_db, self.quality.most_rays
        takes = f"about {rays[reached].min():,.0f}" if reached.any() else f"over {rays.max():,.0f}"
        within = db[rays <= most].max(initial=-np.inf)
        ask = f"for at most {within:.1f} dB, " if math.isfinite(within) else ""
        return OpticsError(
            f"{self.quality.quality_db:g} dB needs {takes} rays per pixel, and most_rays is "
            f"{most:,.0f}",
            key="quality_db",
            remedy=f"Ask {ask}for fewer planes, or allow more rays (most_rays)",
        )


def planes_between(camera: Camera, near_m: float, far_m: float) -> list[SensorPlane]:
    """Planes of the whole lens from the nearest to the farthest focus, evenly in dioptres."""
    focus = np.linspace(1 / near_m, 1 / far_m, PLANNED_PLANES)
    return [SensorPlane(1 / d if d else math.inf, camera.f_number) for d in focus.tolist()]

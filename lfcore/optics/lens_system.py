"""A realistic lens: a list of surfaces, traced one after the other in float64.

Lens space has the film in z = 0 and the scene at +z, x and y as in camera space; metres.  The file
format is pbrt's: one surface per line from the front (scene side) to the back, ``curvature radius,
thickness to the next surface, index behind it, aperture diameter`` in millimetres.  A radius of 0
is the aperture stop, and a positive radius bulges towards the scene.  The last thickness is the
distance to the film.  A fifth column may have the Abbe number behind the surface, 0 for none.  An
aspheric surface has its conic constant in a sixth column, and in further ones the coefficients of
r^4, r^6 and so on to r^16, in millimetres to the powers -3, -5, ...: its depth at a height r is

    z(r) = c r^2 / (1 + sqrt(1 - (1 + k) c^2 r^2)) + a2 r^2 + a4 r^4 + ...        c = 1 / radius

Source: Kolb, Mitchell, Hanrahan, "A Realistic Camera Model for Computer Graphics", SIGGRAPH 1995;
pbrt 6.4.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError

_PUPIL_BINS = 32
"""The number of film radii for which the exit pupil is bounded."""
_PUPIL_GRID = 48
"""The rays per side that search the exit pupil of a film point."""
_AXIAL_GRID = 256
"""The rays per side that measure the exit pupil's area on the axis."""
_REAR_REACH = 1.5
"""The half width of the search for the exit pupil, in radii of the last surface."""
LINES_UM = {"C": 0.65627, "d": 0.58756, "F": 0.48613}
"""The wavelengths of the Fraunhofer lines of an Abbe number, micrometres."""
NEWTON_STEPS = 20
"""The most steps to a hit with an aspheric surface: five are enough but for grazing rays."""
NEWTON_M = 1e-12
"""The distance to the surface, metres, at which a ray hits it."""
MOST_COLUMNS = 13
"""Columns of a table with coefficients up to r^16."""
_FOCUS_STEPS = 60
"""The most steps of the fixed point for the film's place; far from the lens, ten are enough."""


@dataclass(frozen=True, eq=False)
class LensSystem:
    """The surfaces from front to back; arrays (K,) float64, metres.

    ``index`` is the refractive index behind each surface.  ``aperture_m`` are radii.  ``radius_m``
    is 0 at the stop.  ``abbe`` are the Abbe numbers behind each surface, 0 without dispersion.
    ``conic`` are the conic constants, ``even`` (K, n) the coefficients of r^2, r^4, ..., metres to
    the powers -1, -3, ...; None of spheres alone.
    """

    radius_m: np.ndarray
    thickness_m: np.ndarray
    index: np.ndarray
    aperture_m: np.ndarray
    abbe: np.ndarray | None = None
    conic: np.ndarray | None = None
    even: np.ndarray | None = None

    @classmethod
    def read(cls, path: str | Path) -> LensSystem:
        """Read pbrt's lens file."""
        try:
            lines = Path(path).read_text(encoding="utf-8").splitlines()
            lines = [line for line in lines if line.split("#")[0].strip()]
            rows = np.loadtxt(lines, ndmin=2) if lines else np.zeros((0, 4))
            if not 4 <= rows.shape[1] <= MOST_COLUMNS or not np.isfinite(rows).all():
                raise ValueError(f"its lines are not four to {MOST_COLUMNS} finite numbers")
        except (OSError, ValueError) as error:
            remedy = "Write radius, thickness, index, aperture diameter in mm, Abbe number if known"
            problem = f"lens file cannot be read: {error}"
            raise OpticsError(problem, file=path, remedy=remedy) from None
        if not len(rows):
            raise OpticsError("the lens file holds no surface", file=path)
        radius, thickness, index, diameter = rows.T[:4] * np.array([[1e-3, 1e-3, 1, 1e-3]]).T
        abbe = rows.T[4] if rows.shape[1] > 4 else None
        conic = even = None
        if rows[:, 5:].any():
            powers = 1 - 2 * np.arange(1, rows.shape[1] - 4)  # of metres, from r^2 on
            conic, even = rows.T[5], np.pad(rows[:, 6:], ((0, 0), (1, 0))) * 1e-3**powers
        index = np.where(index == 0, 1.0, index)
        behind = np.append(thickness[:-1], 0)  # the film may be anywhere: it is focused
        for wrong, problem in (
            (diameter <= 0, "the aperture diameter is not positive"),
            (behind < 0, "the thickness is negative: surfaces overlap"),
            (index < 1, "the index is less than 1"),
            (np.zeros(1) if abbe is None else abbe < 0, "the Abbe number is negative"),
        ):
            if wrong.any():
                row = f"surface {np.flatnonzero(wrong)[0] + 1}"
                raise OpticsError(problem, file=path, key=row, remedy="Correct this line")
        return cls(radius, thickness, index, diameter / 2, abbe, conic, even)

    def at_wavelength(self, wavelength_um: float) -> LensSystem:
        """The lens for another colour than d, by Cauchy's n = A + B / wavelength^2."""
        if self.abbe is None or not self.abbe.any():
            return self
        powers = {line: wavelength**-2 for line, wavelength in LINES_UM.items()}
        abbe = np.where(self.abbe > 0, self.abbe, np.inf)
        slope = (self.index - 1) / abbe / (powers["F"] - powers["C"])
        return replace(self, index=self.index + slope * (wavelength_um**-2 - powers["d"]))

    def reversed(self, start_m: float) -> LensSystem:
        """The lens for rays from the scene; they start ``start_m`` behind the front vertex."""
        thickness = np.append(self.thickness_m[-2::-1], -start_m)
        index = np.append(self.index[-2::-1], 1.0)
        return LensSystem(
            -self.radius_m[::-1], thickness, index, self.aperture_m[::-1],
            conic=None if self.conic is None else self.conic[::-1],
            even=None if self.even is None else -self.even[::-1],
        )  # fmt: skip

    def is_asphere(self, k: int) -> bool:
        """Whether surface k is no sphere or plane."""
        conic, even = self.conic, self.even
        return (conic is not None and conic[k] != 0) or (even is not None and bool(even[k].any()))

    def _bend(self, k: int) -> float:
        """(1 + k) c^2 of surface k."""
        radius, conic = self.radius_m[k], 0.0 if self.conic is None else self.conic[k]
        return float((1 + conic) / radius**2) if radius else 0.0

    def reach(self, k: int) -> float:
        """The largest height on surface k, metres."""
        bend = self._bend(k)
        return bend**-0.5 if bend > 0 else math.inf

    def sag(self, k: int, squares: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """The depth of surface k behind its vertex at squared heights, metres^2, and its
        derivative by these; NaN beyond the surface."""
        squares = np.asarray(squares, np.float64)
        curvature = 1 / self.radius_m[k] if self.radius_m[k] else 0.0
        with np.errstate(invalid="ignore"):
            root = np.sqrt(1 - self._bend(k) * squares)
        depth, slope = curvature * squares / (1 + root), curvature / 2 / np.maximum(root, 1e-12)
        for power, term in enumerate([] if self.even is None else self.even[k], 1):
            depth, slope = (
                depth + term * squares**power,
                slope + power * term * squares ** (power - 1),
            )
        return depth, slope

    @property
    def film_distance_m(self) -> float:
        """The distance from the last surface to the film."""
        return float(self.thickness_m[-1])

    @property
    def positions_m(self) -> np.ndarray:
        """(K,) z of each surface's vertex; the film is at 0."""
        return np.cumsum(self.thickness_m[::-1])[::-1]

    def stopped_down(self, diameter_m: float) -> LensSystem:
        """The lens with another stop, at most as wide as its own."""
        stop = self.radius_m == 0
        if not stop.any():
            raise OpticsError("this lens has no aperture stop")
        if not diameter_m > 0:
            raise OpticsError(f"a stop of {diameter_m} m is not positive")
        if not diameter_m / 2 <= self.aperture_m[stop].max() * (1 + 1e-9):
            raise OpticsError(f"a stop of {diameter_m} m is wider than the lens's own")
        return replace(self, aperture_m=np.where(stop, diameter_m / 2, self.aperture_m))

    def focused(self, distance_m: float) -> LensSystem:
        """The lens with its film at the paraxial image of the distance ``distance_m``.

        The distance is measured from the film, so that moving the film moves the object, too.
        """
        length = float(self.thickness_m[:-1].sum())
        film = self.paraxial_image(math.inf)
        if math.isfinite(distance_m):
            for _ in range(_FOCUS_STEPS):  # a contraction far from the lens
                before, film = film, self.paraxial_image(distance_m - length - film)
                if not film > 0 or not math.isfinite(film):
                    break
                if abs(film - before) <= 1e-15 + 1e-13 * film:
                    break
            else:
                film = math.nan
        if not (film > 0 and math.isfinite(film)):
            raise OpticsError(
                f"the lens cannot focus at {distance_m} m", remedy="Focus farther away"
            )
        return replace(self, thickness_m=np.append(self.thickness_m[:-1], film))

    def paraxial_image(self, distance_m: float) -> float:
        """The distance of the paraxial image behind the last surface; negative if virtual.

        The axial object is ``distance_m`` before the front vertex.
        """
        start = (1.0, 0.0) if math.isinf(distance_m) else (distance_m, 1.0)
        height, angle = self.paraxial(*start)
        return -height / angle if angle else math.inf

    def paraxial(self, height: float, angle: float, last: int | None = None) -> tuple[float, float]:
        """The height at surface ``last``, and the angle behind it, of a paraxial ray.

        The ray is given by its height at the front vertex and its angle before it.
        """
        before, last = 1.0, len(self.radius_m) - 1 if last is None else last
        for k, radius in enumerate(self.radius_m[: last + 1]):
            curvature = 1 / radius if radius else 0.0
            curvature += 0.0 if self.even is None else 2 * self.even[k, 0]
            power = (self.index[k] - before) * curvature
            angle = (before * angle - height * power) / self.index[k]
            before = self.index[k]
            if k < last:
                height += angle * self.thickness_m[k]
        return height, angle

    @property
    def focal_length_m(self) -> float:
        """The effective paraxial focal length."""
        _, angle = self.paraxial(1.0, 0.0)
        return -1.0 / angle if angle else math.inf

    @property
    def image_distance_m(self) -> float:
        """The paraxial distance from the rear principal plane to the film."""
        return self.focal_length_m + self.film_distance_m - self.paraxial_image(math.inf)

    @property
    def working_f_number(self) -> float:
        """The f-number of the light cone through the open stop at the middle of the film."""
        radius = math.sqrt(self.axial_pupil_area() / math.pi)
        return 1 / (2 * math.sin(math.atan(radius / self.film_distance_m)))

    def trace(
        self, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Trace rays (R, 3) in lens space from the film, towards +z, through all surfaces.

        Returns origins on the front surface, unit directions, and an (R,) bool mask of the rays
        that pass.
        """
        o, d = (np.array(each, np.float64) for each in (origins, directions))
        alive = d[:, 2] > 0
        for step in self.steps(o, d):
            k, hit, _, passed = step
            alive &= passed & ((hit[:, :2] ** 2).sum(1) <= self.aperture_m[k] ** 2)
        _, hit, bent, _ = step
        whole = alive[:, None]
        return np.where(whole, hit, o), np.where(whole, bent, d), alive

    def steps(
        self, o: np.ndarray, d: np.ndarray
    ) -> Iterator[tuple[int, np.ndarray, np.ndarray, np.ndarray]]:
        """Yield each surface that rays (R, 3) meet, whatever its aperture.

        Its number, the hits, unit directions behind it, and an (R,) bool mask of rays that hit it
        and are refracted.
        """
        d = d / np.linalg.norm(d, axis=1, keepdims=True)
        for k in range(len(self.radius_m) - 1, -1, -1):
            o, normal, passed = self._hit(k, o, d)
            if normal is not None:
                next_index = 1.0 if k == 0 else self.index[k - 1]
                d, refracted = _refract(d, normal, self.index[k] / next_index)
                passed &= refracted
            yield k, o, d, passed

    def _hit(
        self, k: int, o: np.ndarray, d: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """The hits on surface k, unit normals against the rays, and an (R,) bool mask of hits."""
        vertex, radius = self.positions_m[k], self.radius_m[k]
        if radius == 0:
            t = (vertex - o[:, 2]) / np.where(d[:, 2] > 0, d[:, 2], 1.0)
            return o + t[:, None] * d, None, d[:, 2] > 0
        if self.is_asphere(k):
            return self._hit_asphere(k, o, d)
        offset = o - np.array([0.0, 0.0, vertex - radius])
        b = (offset * d).sum(1)
        # |offset|^2 - r^2, factored: otherwise flat surfaces lose digits.
        c = (offset[:, :2] ** 2).sum(1) + (offset[:, 2] - radius) * (offset[:, 2] + radius)
        root = b * b - c
        is_hit = root >= 0
        root = np.sqrt(np.maximum(root, 0.0))
        # The ray leaves a surface that bulges towards the scene at the far root.
        if radius > 0:
            t = np.where(b > 0, -c / np.where(b + root != 0, b + root, 1.0), root - b)
        else:
            t = np.where(b < 0, c / np.where(root - b != 0, root - b, 1.0), -b - root)
        hit = o + t[:, None] * d
        normal = (hit - np.array([0.0, 0.0, vertex - radius])) / radius
        normal = np.where((normal * d).sum(1, keepdims=True) > 0, -normal, normal)
        return hit, normal, is_hit

    def _hit_asphere(
        self, k: int, o: np.ndarray, d: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As :meth:`_hit`, by Newton's steps from the plane of the vertex."""
        vertex = self.positions_m[k]
        t = (vertex - o[:, 2]) / np.where(d[:, 2] > 0, d[:, 2], 1.0)
        for _ in range(NEWTON_STEPS):
            hit = o + t[:, None] * d
            depth, slope = self.sag(k, (hit[:, :2] ** 2).sum(1))
            off = hit[:, 2] - vertex + depth  # the surface is before the vertex, towards the film
            change = d[:, 2] + 2 * slope * (hit[:, :2] * d[:, :2]).sum(1)
            if (np.abs(off) <= NEWTON_M).all():
                break
            t = t - off / np.where(change, change, 1.0)
        normal = np.concatenate([2 * slope[:, None] * hit[:, :2], np.ones_like(t)[:, None]], 1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where((normal * d).sum(1, keepdims=True) > 0, -normal, normal)
        passed = (np.abs(off) <= NEWTON_M) & (d[:, 2] > 0)  # NaN misses
        miss = ~passed[:, None]
        return np.where(miss, o, hit), np.where(miss, -d, normal), passed

    def pupil_bounds(self, film_radius_m: float) -> np.ndarray:
        """The exit pupil's bounds on the plane of the rear vertex, per bin of film radii.

        (bins, 4) float64 x low, x high, y low, y high for film points (r, 0); bins divide
        ``film_radius_m`` into equal parts.
        """
        reach, grid = _REAR_REACH * float(self.aperture_m[-1]), _PUPIL_GRID
        cell = 2 * reach / grid
        axis = (np.arange(grid) + 0.5) * cell - reach
        x, y = (plane.ravel() for plane in np.meshgrid(axis, axis))
        bounds = np.tile([-reach, reach, -reach, reach], (_PUPIL_BINS, 1))
        for index in range(_PUPIL_BINS):
            low, high = (film_radius_m * (index + n) / _PUPIL_BINS for n in (0, 1))
            open_x, open_y = [], []
            for r in np.linspace(low, high, 3):
                passed = self._passes(r, x, y)
                open_x.append(x[passed])
                open_y.append(y[passed])
            xs, ys = np.concatenate(open_x), np.concatenate(open_y)
            if len(xs):
                bounds[index] = xs.min() - cell, xs.max() + cell, ys.min() - cell, ys.max() + cell
        return bounds

    def axial_pupil_area(self) -> float:
        """The exit pupil's open area on the rear plane, from the middle of the film."""
        reach = _REAR_REACH * float(self.aperture_m[-1])
        axis = ((np.arange(_AXIAL_GRID) + 0.5) / _AXIAL_GRID * 2 - 1) * reach
        x, y = (plane.ravel() for plane in np.meshgrid(axis, axis))
        return float(self._passes(0.0, x, y).mean()) * (2 * reach) ** 2

    def _passes(self, r: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        film = np.broadcast_to([r, 0.0, 0.0], (len(x), 3))
        rear = np.stack([x, y, np.full_like(x, self.film_distance_m)], 1)
        return self.trace(film, rear - film)[2]


@dataclass(frozen=True, eq=False)
class LensSampler:
    """Draws rays from film points through a lens's exit pupil.

    A ray's weight is ``cos^4`` of its angle at the film times the sampled area over the open area
    on the axis (pbrt's simple weighting).
    """

    lens: LensSystem
    film_radius_m: float

    @cached_property
    def _bounds(self) -> np.ndarray:
        return self.lens.pupil_bounds(self.film_radius_m)

    @cached_property
    def _area(self) -> float:
        area = self.lens.axial_pupil_area()
        if not area > 0:
            raise OpticsError("no light passes this lens", remedy="Check the lens file")
        return area

    def rays(
        self, film_xy: np.ndarray, samples: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Trace a ray from each film point (R, 2), metres, by samples (R, 2) in [0, 1).

        Returns origins and directions (R, 3) in lens space, and weights (R,), 0 for blocked rays.
        """
        r = np.hypot(film_xy[:, 0], film_xy[:, 1])
        share = r / self.film_radius_m * _PUPIL_BINS
        box = self._bounds[np.minimum(share.astype(np.int64), _PUPIL_BINS - 1)]
        x = box[:, 0] + samples[:, 0] * (box[:, 1] - box[:, 0])
        y = box[:, 2] + samples[:, 1] * (box[:, 3] - box[:, 2])
        area = (box[:, 1] - box[:, 0]) * (box[:, 3] - box[:, 2])
        safe = np.where(r > 0, r, 1.0)
        cosine = np.where(r > 0, film_xy[:, 0] / safe, 1.0)
        sine = np.where(r > 0, film_xy[:, 1] / safe, 0.0)
        turned = np.stack([cosine * x - sine * y, sine * x + cosine * y], 1)
        film = np.pad(film_xy, ((0, 0), (0, 1)))
        towards = np.pad(turned, ((0, 0), (0, 1)), constant_values=self.lens.film_distance_m) - film
        slope = towards[:, 2] / np.linalg.norm(towards, axis=1)
        origins, directions, alive = self.lens.trace(film, towards)
        return origins, directions, np.where(alive, slope**4 * area / self._area, 0.0)


def _refract(d: np.ndarray, normal: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Refract unit vectors by Snell's law, ``normal`` against ``d``.

    Returns directions, and a bool mask that is False for total reflection.
    """
    cosine = -(d * normal).sum(1)
    square = 1.0 - ratio * ratio * (1.0 - cosine * cosine)
    root = np.sqrt(np.maximum(square, 0.0))
    bent = ratio * d + (ratio * cosine - root)[:, None] * normal
    return bent / np.linalg.norm(bent, axis=1, keepdims=True), square > 0

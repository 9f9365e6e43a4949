"""A lens from a file: where it takes each ray, compared with a perfect thin lens.

The slab's lens plane is the lens's paraxial entrance pupil.  A ray that passes it at p and meets
the plane in focus at the tangents x lands on the film at h(p, x); a perfect lens takes it to S x,
with the paraxial scale S.  The ray's *displacement* is h / S - x: the transverse aberration.  It
depends on the ray alone, not on the depth at which the ray began, so one table of real rays holds
for all depths.  A lens is scaled to the focal length of the camera; its f-number stays.

Real rays are traced once per lens, on a grid of pupil points and field angles.  As the lens is
rotationally symmetric, the field is a radius.  The table holds each ray's departure from the
paraxial one behind the lens, so that it serves films at any distance.

Source: Welford, "Aberrations of Optical Systems", 1986 (transverse ray aberration).
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfcore.errors import OpticsError, check_kind
from lfcore.optics.lens_system import LensSystem

COLOURS_UM = (0.6114, 0.5491, 0.4642)
"""The dominant wavelengths of sRGB's red, green and blue, micrometres."""
PUPIL_NODES = 97
"""The table's pupil points per axis: spots are right to 1%, behind aspheres too."""
FIELD_NODES = 17
"""The table's field angles."""
FIELD_STEP = 0.125
"""The fields of tables are multiples of this tangent, so that pictures share tables."""
PUPIL_REACH = 1.1
"""The table's pupil, in radii of the paraxial one: the real pupil is displaced off the axis."""
RIM = 0.99
"""The part of a surface's aperture at which neighbours may not overlap."""


class Landing(NamedTuple):
    """What a lens makes of rays; arrays of the rays' shape.

    Attributes
    ----------
    displacement : ndarray
        (..., 2) tangents, from the place that a perfect lens takes the ray to.
    iris : ndarray
        (..., 2) metres: where the ray passes the stop, scaled to the entrance pupil.
    clearance : ndarray
        Positive for rays that pass all other apertures.
    """

    displacement: np.ndarray
    iris: np.ndarray
    clearance: np.ndarray


@dataclass(frozen=True, eq=False)
class Lens:
    """A lens of spheres and even aspheres, from a file; for :meth:`Scene.plane` and
    :meth:`LightField.plane`.

    Parameters
    ----------
    path : str
        The file, for errors.
    systems : sequence of LensSystem
        The surfaces for red, green and blue, or for all light alike.
    colour : int, optional
        Trace only this one of them; all focus by the green one.  Default: all light.

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("singlet.dat").write_text("50 4 1.5 20\\n-50 2 1 20\\n0 45 0 12\\n")
    >>> lens = lfcore.Lens.read("singlet.dat")
    >>> round(1e3 * lens.focal_length_m, 1), round(lens.f_number, 1)
    (50.7, 3.9)
    """

    path: str
    systems: Sequence[LensSystem]
    colour: int | None = None

    @classmethod
    def read(cls, path: str | Path) -> Lens:
        """Read a lens: pbrt's table of surfaces (.dat), or Zemax text (.zmx).

        A table has a line per surface from the front: radius, thickness, index and aperture
        diameter, in millimetres; a fifth column may have the Abbe number, without which the lens
        has no colour error; a sixth the conic constant of an asphere, and further ones the
        coefficients of r^4, r^6 and so on.  Zemax text needs package ``lfcore[lenses]``.

        Raises
        ------
        OpticsError
            No table of surfaces, surfaces that overlap, or a lens that no ray passes.
        """
        path = Path(path)
        if path.suffix.lower() == ".zmx":
            from lfcore.optics.zemax import read_zemax  # which imports a large package

            systems = read_zemax(path, COLOURS_UM)
        else:
            system = LensSystem.read(path)
            systems = [system.at_wavelength(each) for each in COLOURS_UM]
            if systems[0] is system:
                systems = [system]
        lens = cls(str(path), systems)
        lens._check()
        return lens

    @classmethod
    def of(cls, lens: Lens | str | Path | None) -> Lens | None:
        """The lens of a file, which is read once; lenses and None are returned."""
        if isinstance(lens, str | Path):
            try:
                return _read_once(str(lens), Path(lens).stat().st_mtime_ns)
            except OSError:
                return cls.read(lens)  # which raises an error that names the file
        check_kind(lens, Lens | None, "lens", "a Lens or its file")
        return lens

    @property
    def _green(self) -> LensSystem:
        return self.systems[len(self.systems) // 2]

    @cached_property
    def colours(self) -> tuple[Lens, ...]:
        """A lens for red, green and blue each; or this one, of one colour or without colour
        error."""
        if len(self.systems) == 1 or self.colour is not None:
            return (self,)
        return tuple(replace(self, colour=number) for number in range(len(self.systems)))

    @property
    def focal_length_m(self) -> float:
        """The focal length in the file."""
        return float(self._green.focal_length_m)

    @cached_property
    def _apertures(self) -> np.ndarray:
        """The radii of the surfaces' apertures, seen as those of a beam from infinity, metres."""
        system = self._green
        heights = [system.paraxial(1.0, 0.0, k)[0] for k in range(len(system.radius_m))]
        return system.aperture_m / np.maximum(np.abs(heights), 1e-12)

    @cached_property
    def stop(self) -> int:
        """The aperture stop's surface: the one of radius 0, or without one, the narrowest."""
        flat = np.flatnonzero(self._green.radius_m == 0)
        chosen = flat if len(flat) else np.arange(len(self._apertures))
        return int(chosen[np.argmin(self._apertures[chosen])])

    @property
    def f_number(self) -> float:
        """The focal length over the widest beam on the axis."""
        return float(self.focal_length_m / (2 * self._apertures.min()))

    @cached_property
    def pupil_m(self) -> float:
        """The entrance pupil's distance behind the front vertex, metres."""
        of_angle, of_height = (self._green.paraxial(*ray, self.stop)[0] for ray in ((0, 1), (1, 0)))
        return of_angle / of_height

    def film(self, focus_m: float, focal_length_m: float) -> tuple[float, float]:
        """The film's distance behind the last surface, and its metres per tangent; unscaled.

        Parameters are as for :meth:`landing`.  Raises :class:`OpticsError` for a distance at which
        the lens cannot focus.
        """
        system, scale = self._green, focal_length_m / self.focal_length_m
        front = focus_m / scale - self.pupil_m
        film = system.paraxial_image(front) if front > 0 else math.nan
        if not 0 < film < math.inf:
            focus = -system.paraxial(0.0, 1.0)[1] / system.paraxial(1.0, 0.0)[1]  # the front one
            nearest = scale * (self.pupil_m + max(focus, 0))
            raise OpticsError(
                f"this lens cannot focus at {focus_m:.4g} m", file=self.path, key="focus_m",
                remedy=f"Focus farther away than {nearest:.4g} m, or shorten the focal length",
            )  # fmt: skip
        height, angle = system.paraxial(self.pupil_m, -1.0)
        return film, height + film * angle

    def check_f_number(self, f_number: float) -> None:
        """Raise :class:`OpticsError` for an aperture wider than this lens."""
        if f_number < self.f_number * (1 - 1e-9):
            problem = f"aperture f/{f_number:g} is wider than this lens, f/{self.f_number:.4g}"
            remedy = f"Use f/{math.ceil(100 * self.f_number) / 100:g} or a larger number"
            raise OpticsError(problem, file=self.path, key="f_number", remedy=remedy)

    def landing(
        self, points: np.ndarray, tangents: np.ndarray, focus_m: float, focal_length_m: float
    ) -> Landing:
        """Where rays land.

        Parameters
        ----------
        points : ndarray
            (..., 2) in the entrance pupil, metres.
        tangents : ndarray
            (..., 2) of the rays' places on the plane in focus.
        focus_m, focal_length_m : float
            Focus distance, and the focal length to which the lens is scaled, metres.
        """
        scale = focal_length_m / self.focal_length_m
        film, across = self.film(focus_m, focal_length_m)
        p, field = points / scale, tangents - points / focus_m
        radius = np.hypot(field[..., 0], field[..., 1])
        axis = np.stack([field[..., 0], field[..., 1]]) / np.where(radius > 0, radius, 1.0)
        axis[0] = np.where(radius > 0, axis[0], 1.0)
        along = p[..., 0] * axis[0] + p[..., 1] * axis[1]
        beside = p[..., 1] * axis[0] - p[..., 0] * axis[1]
        reach = math.ceil(max(float(radius.max()), 1e-6) / FIELD_STEP) * FIELD_STEP
        rays = _table(self, reach).at(radius, along, np.abs(beside))
        side = np.sign(beside)
        moved = (rays[0] + film * rays[2]) / across, (rays[1] + film * rays[3]) / across * side
        iris = along + rays[4], beside + rays[5] * side
        displacement, place = (
            np.stack([x * axis[0] - y * axis[1], x * axis[1] + y * axis[0]], -1)
            for x, y in (moved, iris)
        )
        return Landing(displacement, place * scale, rays[6])

    def _check(self) -> None:
        system = self._green
        for k in range(len(system.radius_m) - 1):
            if not system.radius_m[k : k + 2].all():
                continue  # a stop may be between the rims of its neighbours
            height = min(system.aperture_m[k : k + 2].min(), system.reach(k), system.reach(k + 1))
            before, behind = (system.sag(each, (RIM * height) ** 2)[0] for each in (k, k + 1))
            if system.thickness_m[k] + behind - before < 0:
                raise OpticsError(
                    f"surfaces {k + 1} and {k + 2} overlap at their rims", file=self.path,
                    key=f"surface {k + 1}", remedy="Correct thickness, radius or diameter",
                )  # fmt: skip
        if not 0 < self.focal_length_m < math.inf:
            problem = f"its focal length of {self.focal_length_m:.4g} m makes no real image"
            raise OpticsError(problem, file=self.path, remedy="Give a lens that collects light")
        self.film(math.inf, self.focal_length_m)
        if not (_table(self.colours[-1], FIELD_STEP).rays[6, 0] > 0).any():
            problem = "no ray passes this lens"
            raise OpticsError(problem, file=self.path, remedy="Correct its aperture diameters")


@functools.lru_cache(maxsize=16)
def _read_once(path: str, changed: int) -> Lens:
    return Lens.read(path)


@dataclass(frozen=True, eq=False)
class _Table:
    """Real rays behind a lens, on a grid of fields and pupil points.

    ``rays`` (7, fields, x, y): departures from the paraxial ray, in the frame whose x is the
    field's direction and whose y is positive: x and y on the last vertex's plane, metres; slopes x
    and y; x and y in the pupil of the place on the stop; and the clearance, which is negative for a
    ray that an aperture stops, and -1 for one that a surface cannot refract.
    """

    rays: np.ndarray
    steps: np.ndarray
    """Nodes per tangent of the field, and per metre of the pupil along both axes."""

    def at(self, field: np.ndarray, along: np.ndarray, beside: np.ndarray) -> list[np.ndarray]:
        """Interpolate the table's seven quantities, linearly."""
        from scipy.ndimage import map_coordinates  # seldom needed, slow to import

        middle = (PUPIL_NODES - 1) / 2
        places = np.stack([
            field * self.steps[0], along * self.steps[1] + middle, beside * self.steps[2]
        ])  # fmt: skip
        return [map_coordinates(each, places, order=1, mode="nearest") for each in self.rays]


@functools.lru_cache(maxsize=32)
def _table(lens: Lens, reach: float) -> _Table:
    """Trace real rays of fields up to the tangent ``reach``."""
    green, system = lens._green, lens.systems[lens.colour or 0].reversed(lens.pupil_m)
    radius = PUPIL_REACH * lens._apertures[lens.stop]
    nodes = [(0.0, reach, FIELD_NODES), (-radius, radius, PUPIL_NODES),
             (0.0, radius, PUPIL_NODES // 2 + 1)]  # fmt: skip
    axes = [np.linspace(*each) for each in nodes]
    q, x, y = (each.ravel() for each in np.meshgrid(*axes, indexing="ij"))
    points, field = np.stack([x, y], 1), np.stack([q, 0 * q], 1)
    origins, directions = np.pad(points, ((0, 0), (0, 1))), np.stack([-q, 0 * q, 0 * q + 1], 1)
    passes, clearance = np.ones(len(q), bool), np.ones(len(q))
    for number, hit, direction, passed in system.steps(origins, directions):
        slope = direction[:, :2] / direction[:, 2:]
        passes &= passed
        surface = len(green.radius_m) - 1 - number
        if surface == lens.stop:
            iris = hit[:, :2] / green.paraxial(1.0, 0.0, surface)[0] - points
        else:
            height = (hit[:, :2] ** 2).sum(1) / system.aperture_m[number] ** 2
            clearance = np.minimum(clearance, 1 - height)
    place = hit[:, :2] + (system.positions_m[0] - hit[:, 2:]) * slope
    parts = []
    for real, of_height, of_angle in zip(
        (place, slope), green.paraxial(1.0, 0.0), green.paraxial(0.0, 1.0), strict=True
    ):
        parts.append(real - of_height * (points + field * lens.pupil_m) + of_angle * field)
    rays = np.concatenate([*parts, iris, clearance[:, None]], 1)
    rays[~passes] = [0, 0, 0, 0, 0, 0, -1]
    steps = np.array([(count - 1) / (last - first) for first, last, count in nodes])
    return _Table(np.ascontiguousarray(rays.T).reshape(7, *map(len, axes)), steps)

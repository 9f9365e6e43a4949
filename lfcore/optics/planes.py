"""Sensor planes: the pictures that a light slab can give.

Refocusing from ``delta`` to ``delta'`` moves the ray of lens point ``s`` and tangent ``x_f`` to

    x_f' = x_f + s (delta' - delta)

On a recorded pixel grid it is a shift by ``s (delta' - delta) / pixel_pitch`` pixels.  If the
sensor's magnification is kept, tangents are then multiplied by v'/v about the centre.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from numbers import Real
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError, check_kind, check_known, suggest_keywords
from lfcore.optics.camera import Camera, check_focus, image_distance
from lfcore.optics.lens import Lens
from lfcore.optics.size import MOST_PIXELS, whole_number
from lfcore.optics.slab import Slab

MOST_BLADES = 1000
"""The most corners of a polygon: it then looks like a circle."""
EDGE = 1e-12
"""The tolerance of a polygon's edges, relative to the radius: the last bits of their cosines
differ between machines."""
MOST_PLANES = 100
"""The most pictures of one pass over a file or over rays: their sums are in memory together."""
SHAPES = ("circle", "square", "diamond", "polygon")
HALVES = {"left": (-1, 0), "right": (1, 0), "top": (0, -1), "bottom": (0, 1)}
"""The halves of an aperture, as directions from the axis, seen from the sensor."""
NORMALISATIONS = ("aperture", "lens")


@dataclass(frozen=True)
class Aperture:
    """An aperture in the lens plane.

    Parameters
    ----------
    shape : str
        ``circle``; ``diamond`` or ``polygon``, inscribed in that circle; or ``square`` with the
        radius as half side, so that the whole lens grid is a possible aperture.
    radius_m : float
        Metres.
    blades : int
        Corners of a polygon.
    rotation_deg : float
        The angle of a polygon's first corner from +x, degrees.
    half : str, optional
        ``left``, ``right``, ``top`` or ``bottom``: the half of the outline that is open.
    """

    shape: str
    radius_m: float
    blades: int = 6
    rotation_deg: float = 0.0
    half: str | None = None

    def __post_init__(self) -> None:
        check_known(OpticsError, "aperture", self.shape, SHAPES)
        if self.half is not None:
            check_known(OpticsError, "half", self.half, HALVES)
        if self.shape == "polygon" and not 3 <= self.blades <= MOST_BLADES:
            raise OpticsError(
                f"a polygon has from 3 to {MOST_BLADES} blades, not {self.blades}", key="blades"
            )
        if not math.isfinite(self.rotation_deg):
            raise OpticsError(f"must be finite, not {self.rotation_deg}", key="rotation_deg")

    def contains(self, s: np.ndarray, t: np.ndarray) -> np.ndarray:
        """The bool mask of open lens points (s, t), metres, float64."""
        if self.half is not None:
            across, down = HALVES[self.half]
            return (across * s + down * t > 0) & replace(self, half=None).contains(s, t)
        radius = self.radius_m
        if self.shape == "square":
            return (np.abs(s) <= radius) & (np.abs(t) <= radius)
        if self.shape == "diamond":
            return np.abs(s) + np.abs(t) <= radius
        if self.shape == "circle":
            return s * s + t * t <= radius * radius
        inside = np.ones(np.broadcast(s, t).shape, bool)
        apothem = radius * math.cos(math.pi / self.blades)
        for blade in range(self.blades):
            angle = math.radians(self.rotation_deg) + (2 * blade + 1) * math.pi / self.blades
            inside &= s * math.cos(angle) + t * math.sin(angle) <= apothem + EDGE * radius
        return inside


@suggest_keywords
@dataclass(frozen=True)
class SensorPlane:
    """One picture: its focus, its aperture and its normalisation.

    Parameters
    ----------
    focus_m : float
        Focus distance, metres.
    f_number : float
        Focal length over the diameter of the aperture.
    aperture : str
        ``circle``, ``square``, ``diamond`` or ``polygon``.
    blades : int
        Corners of a polygon.
    rotation_deg : float
        Rotation of a polygon, degrees.
    normalise : str
        ``aperture`` divides by the open lens samples (thesis figure 4.4); ``lens`` by all N^2, so
        that the picture dims as the lens stops down (figure 4.3).
    keep_magnification : bool
        Keep the magnification v'/v of a physical sensor, which moves when it is focused.
    pixels : int, optional
        The longer side of a picture coarser than the slab; rays are added by their exact position.
        Default: the slab's.
    half : str, optional
        ``left``, ``right``, ``top`` or ``bottom``: one half of the aperture, as one of the two
        pixels under a microlens of a dual-pixel sensor sees it.
    lens : Lens, optional
        A lens from a file, with its aberrations and vignetting, scaled to the camera's focal
        length.  Default: a perfect thin lens.

    Examples
    --------
    >>> lfcore.SensorPlane(focus_m=3.2, f_number=2.8, aperture="polygon", blades=5).normalise
    'aperture'
    """

    focus_m: float
    f_number: float
    aperture: str = "circle"
    blades: int = 6
    rotation_deg: float = 0.0
    normalise: str = "aperture"
    keep_magnification: bool = False
    pixels: int | None = None
    half: str | None = None
    lens: Lens | None = None

    def __post_init__(self) -> None:
        check_known(OpticsError, "normalise", self.normalise, NORMALISATIONS, "normalisation")
        if self.half is not None:
            check_known(OpticsError, "half", self.half, HALVES)
        object.__setattr__(self, "lens", Lens.of(self.lens))
        if self.pixels is not None:
            object.__setattr__(self, "pixels", whole_number("pixels", self.pixels, MOST_PIXELS))

    @classmethod
    def of(
        cls,
        camera: Camera,
        focus_m: float | None = None,
        f_number: float | None = None,
        aperture: str = "circle",
        *,
        blades: int = 6,
        rotation_deg: float = 0.0,
        normalise: str = "aperture",
        keep_magnification: bool = False,
        half: str | None = None,
        lens: Lens | str | Path | None = None,
    ) -> SensorPlane:
        """Make a plane whose focus and f-number are the camera's by default.

        Parameters are the fields; a lens may be its file, and is stopped down to its own widest
        f-number if none is given.  :meth:`check` compares the plane with the camera.
        """
        lens = Lens.of(lens)
        for key, value in (("focus_m", focus_m), ("f_number", f_number)):
            check_kind(value, Real | None, key, "a number")
        return cls(
            camera.focus_m if focus_m is None else float(focus_m),
            max(camera.f_number, lens.f_number if lens else 0)
            if f_number is None else float(f_number),
            aperture, blades, rotation_deg, normalise, keep_magnification, half=half, lens=lens,
        )  # fmt: skip

    @property
    def delta(self) -> float:
        return 1.0 / self.focus_m

    def halves(self, first: str = "left") -> tuple[SensorPlane, SensorPlane]:
        """The planes of both halves of the aperture: a dual-pixel pair, whose mean is the picture.
        :func:`lfcore.dual_pixel_disparity` is what lies between them.

        By depth each half orders surfaces by itself, so that at their edges the mean differs from
        the picture of the whole aperture, by 1.5% of white at most.  With nearest pixels, the
        middle of an odd number of lens samples is in neither half.

        Parameters
        ----------
        first : str
            ``left`` or ``top``.

        Raises
        ------
        OpticsError
            ``first`` is another half.
        """
        second = {"left": "right", "top": "bottom"}
        check_known(OpticsError, "first", first, second)
        return replace(self, half=first), replace(self, half=second[first])

    def lens_aperture(self, slab: Slab) -> Aperture:
        """The aperture in metres for this slab's lens."""
        radius = slab.camera.focal_length_m / (2.0 * self.f_number)
        return Aperture(self.aperture, radius, self.blades, self.rotation_deg, self.half)

    def check(self, slab: Slab) -> None:
        """Raise :class:`OpticsError` if the slab lacks this plane's rays."""
        camera = slab.camera
        check_focus(self.focus_m, camera.focal_length_m, key="focus_m")
        if self.lens is not None:
            self.lens.film(self.focus_m, camera.focal_length_m)
            self.lens.check_f_number(self.f_number)
        if not self.f_number >= camera.f_number * (1 - 1e-9):
            lens = f"f/{camera.f_number:g}"
            problem = f"aperture f/{self.f_number:g} is wider than the lens, {lens}"
            remedy = f"Use {lens} or a larger number, or trace a wider lens"
            raise OpticsError(problem, key="f_number", remedy=remedy)
        if self.side(slab) > slab.pixels:
            problem = f"a picture of {self.pixels} pixels is finer than the slab's {slab.pixels}"
            remedy = f"Give at most {slab.pixels}, or use the filter depth"
            raise OpticsError(problem, key="pixels", remedy=remedy)

    def side(self, slab: Slab) -> int:
        """The pixels of the picture's longer side."""
        return slab.pixels if self.pixels is None else self.pixels

    def check_pixels(self, pixels: int) -> None:
        """Raise :class:`OpticsError` for a method that can only form pictures of ``pixels``."""
        if self.pixels not in (None, pixels):
            problem = f"only slicing makes pictures of {self.pixels} from views of {pixels} pixels"
            remedy = "Use the method slicing, or leave pixels out"
            raise OpticsError(problem, key="pixels", remedy=remedy)

    def mask(self, slab: Slab) -> np.ndarray:
        """The mask of lens samples inside the aperture, (N, N) bool, indexed [j, i].

        An aperture without any sample opens the one, two or four samples nearest to the axis: a
        pinhole is the middle view, never a black picture.
        """
        s = slab.lens_positions()
        mask = self.lens_aperture(slab).contains(s[None, :], s[:, None])
        if slab.extent is not None:
            mask &= slab.views_held()
        if not mask.any():
            radius = np.hypot(s[None, :], s[:, None])
            if slab.extent is not None:
                radius = np.where(slab.views_held(), radius, np.inf)
            mask = radius <= radius.min() * (1 + 1e-9) + 1e-30
        return mask

    def magnification(self, slab: Slab) -> float:
        """v'/v if the sensor's magnification is kept, else 1."""
        if not self.keep_magnification:
            return 1.0
        focal = slab.camera.focal_length_m
        return image_distance(focal, self.focus_m) / slab.camera.image_distance_m

    def shifts(self, slab: Slab) -> np.ndarray:
        """The shift of lens column i, before magnification: (N,) float64 pixels; rows alike."""
        return slab.lens_positions() * ((self.delta - slab.camera.delta) / slab.pixel_pitch)

    def to_json(self) -> dict:
        """The fields by key, without ``lens``."""
        data = asdict(replace(self, lens=None))
        del data["lens"]
        return data


def refuse_lens(planes: Sequence[SensorPlane], what: str, remedy: str) -> None:
    """Raise :class:`OpticsError` for a method that can only form pictures of a perfect lens."""
    for plane in planes:
        if plane.lens is not None:
            problem = f"{what} has no lenses from files"
            raise OpticsError(problem, file=plane.lens.path, key="lens", remedy=remedy)

"""The light slab: all rays from N x N lens samples through M x M pixels.

The ray of lens point ``s`` and pixel tangent ``x_f`` has at depth z the position (y alike)

    x(z) = s (1 - z delta) + z x_f

It is ``O + z D`` with ``O = (s, t, 0)`` and ``D = (x_f - s delta, y_f - t delta, 1)``, so its
parameter is depth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from numbers import Real

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.size import MOST_PIXELS, Pixels, Size, whole_number

Ends = tuple[int, int, int, int]
"""The first column and row, and the column and row after the last."""
Rectangle = tuple[int, int, int, int]
"""First column, first row, columns, rows."""
MOST_SUBPIXELS = 64
"""The most rays per side of a pixel and lens sample."""


@dataclass(frozen=True)
class Lattice:
    """The rays of a picture: lens samples, and rays per pixel and lens sample.

    Every parameter ``views`` takes a lattice instead of a number.

    Parameters
    ----------
    views : int
        Lens samples per side, 1 to 4096.
    subpixels : float
        Rays per pixel of the picture and lens sample, per side: above 0 and at most 64.
    displaced : bool
        Displace each view within a pixel against all others, so that the views together sample
        more places of a pixel.  Pictures by depth get 2 dB better.

    Raises
    ------
    OpticsError
        A number is out of range.

    Examples
    --------
    >>> lattice = lfcore.Lattice(views=4, subpixels=2)
    >>> lattice.rays_per_pixel, lattice.rays(256)
    (64, 4194304)
    """

    views: int
    subpixels: float = 2.0
    displaced: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "views", whole_number("views", self.views, 4096))
        if not (isinstance(self.subpixels, Real) and 0 < self.subpixels <= MOST_SUBPIXELS):
            problem = f"must be above 0 and at most {MOST_SUBPIXELS}, not {self.subpixels!r}"
            raise OpticsError(problem, key="subpixels")

    def side(self, pixels: int) -> int:
        """The pixels of a view's side, for pictures with a side of ``pixels``."""
        return max(1, round(self.subpixels * pixels))

    def rays(self, pixels: Pixels) -> int:
        """The rays of a picture of this size."""
        size = Size.of(pixels)
        width, height = size.scaled(self.side(size.longer))
        return self.views**2 * width * height

    @property
    def rays_per_pixel(self) -> float:
        return (self.views * self.subpixels) ** 2

    def __str__(self) -> str:
        return f"{self.views} x {self.subpixels:.3g}"


@dataclass(frozen=True)
class Extent:
    """The used rectangles of a slab's two square grids.

    Wide pictures have fewer rows of pixels than columns; imported light fields often have fewer
    rows of views, too.

    Parameters
    ----------
    views, pixels : (int, int, int, int)
        The first column and row, and the number of columns and rows.
    """

    views: Rectangle
    pixels: Rectangle

    @classmethod
    def centred(cls, columns: int, rows: int, width: int, height: int) -> Extent:
        """Rectangles in the middle of the smallest squares around them.

        The middles differ by half a step if one side is even and the other odd.
        """
        rectangles = []
        for across, down in ((columns, rows), (width, height)):
            side = max(across, down)
            rectangles.append(((side - across + 1) // 2, (side - down + 1) // 2, across, down))
        return cls(*rectangles)


@dataclass(frozen=True)
class Slab:
    """A light slab: the rays from N x N lens samples through M x M pixels.

    Lens samples are the centres of an N x N grid over the square around the lens; index ``i`` runs
    along +x (s), ``j`` along +y (t).  Pixel ``u`` is the column, ``v`` the row.

    Parameters
    ----------
    camera : Camera
        The lens and sensor.
    views, pixels : int
        N and M.
    extent : Extent, optional
        The used views and pixels.  Default: all.

    Examples
    --------
    >>> camera = lfcore.Camera(focal_length_m=0.05, sensor_width_m=0.036, f_number=2.0, focus_m=3.0)
    >>> slab = lfcore.Slab(camera, views=16, pixels=256)
    >>> round(1e3 * slab.lens_pitch_m, 4)
    1.5625
    """

    camera: Camera
    views: int
    pixels: int
    extent: Extent | None = None

    def __post_init__(self) -> None:
        for key, most in (("views", 4096), ("pixels", MOST_PIXELS)):
            object.__setattr__(self, key, whole_number(key, getattr(self, key), most))
        if self.extent is not None:
            for key, side in (("views", self.views), ("pixels", self.pixels)):
                column, row, columns, rows = getattr(self.extent, key)
                inside = 0 <= column < column + columns <= side
                if not (inside and 0 <= row < row + rows <= side):
                    raise OpticsError(f"is not within {side} x {side}", key=f"extent.{key}")

    @classmethod
    def of(cls, camera: Camera, views: int | Lattice, pixels: Pixels) -> Slab:
        """The slab of a picture's rays: one per pixel and lens sample, or a lattice.

        The field of view of ``camera`` is that of the picture's shorter side.
        """
        size = Size.of(pixels)
        lattice = views if isinstance(views, Lattice) else Lattice(views, 1)
        side, count = lattice.side(size.longer), lattice.views
        extent = None
        if size.width != size.height:
            extent = Extent.centred(count, count, *size.scaled(side))
        return cls(size.camera(camera), count, side, extent)

    @property
    def held(self) -> Extent:
        """The used views and pixels: ``extent``, or all."""
        whole = Extent((0, 0, self.views, self.views), (0, 0, self.pixels, self.pixels))
        return self.extent or whole

    @property
    def rays(self) -> int:
        (*_, columns, rows), (*_, width, height) = self.held.views, self.held.pixels
        return columns * rows * width * height

    @property
    def size(self) -> Size:
        """Width and height of a view, in pixels."""
        return Size(*self.held.pixels[2:])

    def picture(self, side: int) -> Rectangle:
        """The slab's picture within a square grid of ``side`` x ``side`` pixels.

        It has the same field of view as the slab's views.
        """
        if side == self.pixels:
            return self.held.pixels
        width, height = (max(1, round(count * side / self.pixels)) for count in self.size)
        return (side - width + 1) // 2, (side - height + 1) // 2, width, height

    def resized(self, side: int) -> Slab:
        """The slab whose views have ``side`` pixels on the longer side."""
        extent = self.extent and Extent(self.extent.views, self.picture(side))
        return Slab(self.camera, self.views, side, extent)

    def off_axis(self) -> np.ndarray:
        """The tangents of the middle of the used pixels, (2,) float64."""
        left, top, width, height = self.held.pixels
        middle = np.array([left + width / 2, top + height / 2])
        return (middle - self.pixels / 2) * self.pixel_pitch

    def views_held(self) -> np.ndarray:
        """The mask of used views, (N, N) bool, indexed [j, i]."""
        column, row, columns, rows = self.held.views
        mask = np.zeros((self.views, self.views), bool)
        mask[row : row + rows, column : column + columns] = True
        return mask

    @property
    def lens_pitch_m(self) -> float:
        return 2.0 * self.camera.lens_radius_m / self.views

    @property
    def pixel_pitch(self) -> float:
        """The tangent between neighbouring pixels."""
        return self.camera.field_width / self.pixels

    def lens_positions(self) -> np.ndarray:
        """The positions s of column i, and t of row j: (N,) float64, metres."""
        return (np.arange(self.views) - (self.views - 1) / 2.0) * self.lens_pitch_m

    def pixel_tangents(self) -> np.ndarray:
        """The tangents x_f of column u, and y_f of row v: (M,) float64."""
        return (np.arange(self.pixels) - (self.pixels - 1) / 2.0) * self.pixel_pitch

    def to_json(self) -> dict:
        """The fields by key; ``extent`` only if not all views and pixels are used."""
        data = {"camera": self.camera.to_json(), "views": self.views, "pixels": self.pixels}
        return data | ({"extent": asdict(self.extent)} if self.extent else {})

    @classmethod
    def from_json(cls, data: dict) -> Slab:
        extent = data.get("extent")
        if extent is not None:
            extent = Extent(_rectangle(extent["views"]), _rectangle(extent["pixels"]))
        return cls(
            Camera.from_json(data["camera"]), int(data["views"]), int(data["pixels"]), extent
        )


def all_samples(slab: Slab) -> np.ndarray:
    """The lens samples (i, j), row by row: (N N, 2) int32."""
    j, i = np.divmod(np.arange(slab.views**2, dtype=np.int32), np.int32(slab.views))
    return np.stack([i, j], 1)


def _rectangle(numbers: Sequence[float]) -> Rectangle:
    column, row, columns, rows = (int(number) for number in numbers)
    return column, row, columns, rows

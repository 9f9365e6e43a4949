"""A camera array: parallel pinholes on a grid, the assignment's "data cameras".

The pinholes are in the plane z = 0 of camera space and look along +z.  Column ``i`` of the grid is
at ``columns_m[i]``, row ``j`` at ``rows_m[j]``, and its picture is tile (j, i) of one image.  The
top left tile belongs to the top left camera, seen from behind the array.  The rays form a light
slab: ``delta`` is 0 for the assignment's cameras, and not 0 for the views of a focused slab.

Source: CS348b assignment 3, step 2; Isaksen, McMillan, Gortler, "Dynamically Reparameterized Light
Fields", SIGGRAPH 2000.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from lfcore.errors import OpticsError, check_known
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab

SPACINGS = ("ends", "cells")
SENSOR_WIDTH_M = 0.036
"""The sensor of a camera that has only a field of view: just its ratio to the image distance
counts."""
PINHOLE_RADIUS_M = 1e-9
"""The radius of a pinhole's lens: :class:`Camera` needs one above 0."""
_ON_GRID = 1e-6
"""The greatest offset of a camera from a slab's grid, in pitches."""


@dataclass(frozen=True)
class CameraArray:
    """Parallel pinholes on a grid, Nx x Ny of equal field and resolution.

    Parameters
    ----------
    columns_m, rows_m : tuple of float
        Strictly increasing x and y of the cameras, metres, camera space.
    fov_deg : float
        Full field of view over the shorter side of a tile, as in pbrt, degrees.
    tile : (int, int)
        Width and height of each camera's picture, pixels.
    margin_m : (float, float)
        The reach of the array beyond the outermost cameras, in x and y: half a spacing if the
        cameras are in the middle of cells, else 0.
    delta : float
        Inverse distance at which the pictures coincide, dioptres; 0 for parallel axes.

    Raises
    ------
    OpticsError
        Positions are not finite or not increasing, the field of view is outside (0, 180), or a
        tile is empty.

    Examples
    --------
    >>> array = lfcore.CameraArray.on_grid((5, 5), (-0.1, 0.1, -0.1, 0.1), 40.0, (64, 64))
    >>> array.cameras
    (5, 5)
    """

    columns_m: tuple[float, ...]
    rows_m: tuple[float, ...]
    fov_deg: float
    tile: tuple[int, int]
    margin_m: tuple[float, float] = (0.0, 0.0)
    delta: float = 0.0

    def __post_init__(self) -> None:
        for key in ("columns_m", "rows_m"):
            try:
                axis = np.asarray(getattr(self, key), np.float64)
            except (TypeError, ValueError, OverflowError):
                axis = np.zeros(0)
            if axis.ndim != 1 or not len(axis) or not np.isfinite(axis).all():
                raise OpticsError("needs one finite position or more", key=key)
            if (np.diff(axis) <= 0).any():
                remedy = "Give a grid with different bounds, or a single camera"
                raise OpticsError("positions must increase strictly", key=key, remedy=remedy)
            object.__setattr__(self, key, tuple(axis.tolist()))
        if not 0 < self.fov_deg < 180:
            raise OpticsError(f"must be between 0 and 180, not {self.fov_deg}", key="fov_deg")
        if len(self.tile) != 2 or min(self.tile) < 1:
            raise OpticsError(f"{self.tile} pixels are no picture", key="tile")

    @classmethod
    def on_grid(
        cls,
        cameras: Sequence[int],
        bounds: Sequence[float],
        fov_deg: float,
        tile: Sequence[int],
        spacing: str = "ends",
    ) -> CameraArray:
        """Place cameras at equal distances within the assignment's bounds.

        Parameters
        ----------
        cameras : (int, int)
            Nx and Ny.
        bounds : (float, float, float, float)
            minX maxX minY maxY, metres, **y up** as in pbrt's camera space.
        fov_deg : float
            Full field of view over the shorter side of a tile, degrees.
        tile : (int, int)
            Width and height of each camera's picture, pixels.
        spacing : str
            ``ends`` puts the outermost cameras on the bounds (n - 1 gaps), ``cells`` puts each
            camera in the middle of one of n cells.

        Returns
        -------
        CameraArray
            The cameras.
        """
        check_known(OpticsError, "spacing", spacing, SPACINGS)
        low_x, high_x, low_y, high_y = (float(bound) for bound in bounds)
        columns, margin_x = _axis(int(cameras[0]), low_x, high_x, spacing, "x")
        rows, margin_y = _axis(int(cameras[1]), -high_y, -low_y, spacing, "y")
        size = (int(tile[0]), int(tile[1]))
        return cls(columns, rows, float(fov_deg), size, (margin_x, margin_y))

    @classmethod
    def single(cls, fov_deg: float, tile: Sequence[int]) -> CameraArray:
        """One pinhole at the origin."""
        return cls((0.0,), (0.0,), float(fov_deg), (int(tile[0]), int(tile[1])))

    @classmethod
    def from_slab(cls, slab: Slab) -> CameraArray:
        """Make an array of a slab's views: the same rays, sheared by the slab's focus."""
        positions = tuple(slab.lens_positions().tolist())
        column, row, columns, rows = slab.held.views
        size = slab.held.pixels[2:]
        share = min(size) / slab.pixels
        fov_deg = math.degrees(2 * math.atan(slab.camera.field_width * share / 2))
        margin = slab.lens_pitch_m / 2
        return cls(
            positions[column : column + columns], positions[row : row + rows], fov_deg, size,
            (margin, margin), slab.camera.delta,
        )  # fmt: skip

    def as_slab(self) -> Slab | None:
        """The light slab with the same rays, the inverse of :meth:`from_slab`; None without one.

        A slab needs square pictures, and as many columns as rows, at equal distances about the
        origin.  Its lens is as wide as the grid plus half a pitch on each side.
        """
        (count, rows), (width, height) = self.cameras, self.tile
        if count != rows or width != height:
            return None
        x, y = np.array(self.columns_m), np.array(self.rows_m)
        pitch = (x[-1] - x[0]) / (count - 1) if count > 1 else 2 * self.margin_m[0]
        place = (np.arange(count) - (count - 1) / 2.0) * pitch
        if np.abs(np.stack([x, y]) - place).max() > _ON_GRID * pitch:
            return None
        focus = 1.0 / self.delta if self.delta else math.inf
        if not focus > 0:
            return None
        return Slab(thin_lens(self.field_width, count * pitch / 2, focus), count, width)

    @property
    def cameras(self) -> tuple[int, int]:
        """(Nx, Ny)."""
        return len(self.columns_m), len(self.rows_m)

    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) of the image that holds all tiles."""
        return self.cameras[0] * self.tile[0], self.cameras[1] * self.tile[1]

    @property
    def rays(self) -> int:
        return self.image_size[0] * self.image_size[1]

    @property
    def field_width(self) -> float:
        """The tangent extent of the shorter side of a tile."""
        return 2.0 * math.tan(math.radians(self.fov_deg) / 2.0)

    @property
    def pixel_pitch(self) -> float:
        """Tangent between neighbouring pixels; pixels are square."""
        return self.field_width / min(self.tile)

    def pixel_tangents(self) -> tuple[np.ndarray, np.ndarray]:
        """(w,) x of columns and (h,) y of rows, float64, at pixel centres."""
        x, y = ((np.arange(n) - (n - 1) / 2.0) * self.pixel_pitch for n in self.tile)
        return x, y

    def origins(self) -> np.ndarray:
        """The cameras' positions O, (Ny, Nx, 3) float64, metres."""
        y, x = np.meshgrid(self.rows_m, self.columns_m, indexing="ij")
        return np.stack([x, y, np.zeros_like(x)], -1)

    def directions(self, column: int = 0, row: int = 0) -> np.ndarray:
        """The directions D of a camera's pixels, (h, w, 3) float64 with z = 1.

        All cameras have the same directions if ``delta`` is 0.
        """
        x, y = self.pixel_tangents()
        y, x = np.meshgrid(y, x, indexing="ij")
        s, t = self.columns_m[column], self.rows_m[row]
        return np.stack([x - s * self.delta, y - t * self.delta, np.ones_like(x)], -1)

    def bounds(self) -> tuple[float, float, float, float]:
        """The limits (x low, x high, y low, y high) of the array's rays, camera space, metres."""
        (a, b), (c, d) = (
            (axis[0] - margin, axis[-1] + margin)
            for axis, margin in zip((self.columns_m, self.rows_m), self.margin_m, strict=True)
        )
        return a, b, c, d

    def tiles(self, image: np.ndarray) -> np.ndarray:
        """(Ny, Nx, h, w, ...) view of an image (Ny h, Nx w, ...).

        Raises :class:`OpticsError` for an image of another size.
        """
        (nx, ny), (w, h) = self.cameras, self.tile
        if image.shape[:2] != (ny * h, nx * w):
            size = f"{image.shape[1]} x {image.shape[0]}"
            problem = f"an image of {size} is not {nx} x {ny} tiles of {w} x {h}"
            raise OpticsError(problem, remedy="Check the number of cameras")
        return image.reshape(ny, h, nx, w, *image.shape[2:]).swapaxes(1, 2)

    def mosaic(self, tiles: np.ndarray) -> np.ndarray:
        """The image (Ny h, Nx w, ...) of tiles (Ny, Nx, h, w, ...)."""
        ny, nx, h, w = tiles.shape[:4]
        return np.ascontiguousarray(tiles.swapaxes(1, 2)).reshape(ny * h, nx * w, *tiles.shape[4:])

    def to_json(self) -> dict:
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict) -> CameraArray:
        """Inverse of :meth:`to_json`; raises :class:`OpticsError` for other data."""
        try:
            columns, rows, tile, margin = (
                tuple(data[key]) for key in ("columns_m", "rows_m", "tile", "margin_m")
            )
            size, beyond = (int(tile[0]), int(tile[1])), (float(margin[0]), float(margin[1]))
            return cls(columns, rows, float(data["fov_deg"]), size, beyond, float(data["delta"]))
        except (KeyError, TypeError, ValueError, IndexError, OverflowError) as error:
            raise OpticsError(f"not the description of a camera array: {error!r}") from None


def thin_lens(field_width: float, lens_radius: float, focus_distance: float) -> Camera:
    """Make a :class:`Camera` from a tangent extent, a lens radius and a focus, metres."""
    image_distance = SENSOR_WIDTH_M / field_width
    focal_length = image_distance / (1.0 + image_distance / focus_distance)
    radius = max(lens_radius, PINHOLE_RADIUS_M)
    return Camera(focal_length, SENSOR_WIDTH_M, focal_length / (2 * radius), focus_distance)


def _axis(
    count: int, low: float, high: float, spacing: str, name: str
) -> tuple[tuple[float, ...], float]:
    """Positions along one axis, and the margin beyond them."""
    if count < 1:
        raise OpticsError(f"{count} cameras along {name} are no array", key="cameras")
    if not (math.isfinite(low) and math.isfinite(high)) or high < low:
        raise OpticsError(f"bounds along {name} are not ordered", key="bounds")
    if count == 1:
        return ((low + high) / 2,), (high - low) / 2
    if not high > low:
        problem = f"{count} cameras along {name} share one position"
        remedy = "Give the bounding box of the data cameras"
        raise OpticsError(problem, key="bounds", remedy=remedy)
    if spacing == "ends":
        return tuple(np.linspace(low, high, count).tolist()), 0.0
    pitch = (high - low) / count
    return tuple((low + (np.arange(count) + 0.5) * pitch).tolist()), pitch / 2

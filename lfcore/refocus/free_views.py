"""Views from any point of the lens, of a stored light field that holds depth.

The cells of slicing by depth, with an opening that is a point: a ray of lens point s that meets
depth z is seen from c where the surface's shift puts it, ``x_f + (s - c) (1 / z - delta)``, and is
as wide as itself.  Views near c have most of the picture, those farther away what the others do not
see; layers of inverse depth, the nearest first, let what lies behind through only where nothing is
before it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import LensCells, ViewSet
from lfcore.refocus.depth_slicing import DepthSlicer
from lfcore.refocus.stored_depth import read_depths, read_rays
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.lightfield import LightFieldFile

LAYERS = 6
"""Of inverse depth: what differs by less is one surface.  More bring nothing: measured,
docs/notebook/true-picture.md, as are the next."""
NEAR, FAR, FAR_SHARE = 2, 4, 1e-3
"""Within how many views of a point a view has a share, and one of holes; and how much that is."""


def views_at(
    field: LightFieldFile,
    points_m: np.ndarray,
    pixels: int | None = None,
    *,
    device: Device | str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Pinhole pictures from points of the lens: (K, pixels, pixels, 3) float32, linear light.

    Parameters
    ----------
    points_m : (K, 2), metres: s to the right and t down.
    pixels : side of the pictures; default what the file was traced for.
    progress : called with (views done, of all).

    Raises
    ------
    OpticsError : points outside the lens, a file without depth, or of more rays than are held at
        a time.
    StorageError : the file is damaged.
    """
    stored, slab = field.require_depth(), field.require_slab()
    points = np.asarray(points_m, float).reshape(-1, 2)
    if points.size and not np.abs(points).max() <= slab.camera.lens_radius_m:
        raise OpticsError(
            f"lies outside the lens, which reaches {1e3 * slab.camera.lens_radius_m:.4g} mm from "
            "its middle",
            file=field.path,
            key="at",
        )
    size = stored.pixels if pixels is None else pixels
    device = device if isinstance(device, Device) else open_device(device)
    light, depth = read_rays(field, device=device)
    views, out = stored.views(slab), np.empty((len(points), size, size, 3), np.float32)
    for number, point in enumerate(points):
        out[number] = _seen(_PointSlicer(views, point, size, stored.codes, device), light, depth)
        if progress:
            progress(number + 1, len(points))
    return out


def inverse_depth(field: LightFieldFile, pixels: int | None = None) -> np.ndarray:
    """(pixels, pixels) float64, 1/m: the nearest surface that a pixel sees from the lens's middle.

    By the views around it; 0 where none of them sees anything.  Errors as of :func:`views_at`.
    """
    stored, slab = field.require_depth(), field.require_slab()
    size, views = stored.pixels if pixels is None else pixels, stored.views(slab)
    out = np.zeros((size, size))
    around = np.flatnonzero(np.abs(views.positions).max(axis=1) < 0.99 * slab.lens_pitch_m)
    for number, depth in zip(around, read_depths(field, around), strict=True):
        inverse = 1.0 / depth.astype(float)
        moves = (inverse - slab.camera.delta) / slab.pixel_pitch
        v, u = np.mgrid[: slab.pixels, : slab.pixels]
        x, y = (
            np.floor((at + 0.5 + off + lens * moves) * (size / slab.pixels)).astype(int)
            for at, off, lens in zip(
                (u, v), views.displacement[number], views.positions[number], strict=True
            )
        )
        inside = (0 <= x) & (x < size) & (0 <= y) & (y < size)
        np.maximum.at(out, (y[inside], x[inside]), inverse[inside])
    return out


def _seen(slicer: _PointSlicer, light: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """The picture of a point, of rays (N N, S, S, 3) and their depths."""
    around = np.flatnonzero(slicer.share)
    slicer.add(around, light[around], depth[around])
    return slicer.pictures()[0]


class _PointSlicer(DepthSlicer):
    """Forms what is seen from one ``point`` (2,) of the lens, metres."""

    def __init__(
        self, views: ViewSet, point: np.ndarray, pixels: int, codes: DepthCodes, device: Device
    ):
        slab = views.slab
        self.point, self.share = point, _shares(views, point)
        plane = SensorPlane(1 / codes.far if codes.far else np.inf, slab.camera.f_number, "square")
        scale = pixels / slab.camera.field_width
        # All lies before the plane: sweeps from 0 to that of the nearest.
        widest = (codes.near - codes.far) * slab.lens_pitch_m * scale
        bounds = np.arange(1, LAYERS) * widest / LAYERS
        super().__init__(views, [plane], pixels, device, bounds_px=bounds.tolist())

    def _cells_of(self, plane: SensorPlane) -> LensCells:
        count = len(self.share)
        return LensCells(np.tile(self.point, (count, 1)), np.zeros((count, 2)), self.share)

    def _first(self, plane: SensorPlane) -> np.ndarray:
        views = self.views
        moved = self.point * (plane.delta - views.slab.camera.delta) * self._scale(plane)
        return super()._first(plane) - moved


def _shares(views: ViewSet, point: np.ndarray) -> np.ndarray:
    """(N N,) float64: what each view has of a point."""
    away = np.abs(views.positions - point) / views.slab.lens_pitch_m
    near, far = (np.clip(1 - away / reach, 0, 1).prod(axis=1) for reach in (NEAR, FAR))
    return near + FAR_SHARE * far

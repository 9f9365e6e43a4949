"""Views in memory, written to a light field file.

A file stores codes from 0 to 1; a camera array has unbounded linear radiance.  Its ``white``, the
radiance of the brightest code, is recorded with the array, and readers multiply by it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfcore.colour import pq_encode, srgb_encode
from lfcore.errors import OpticsError, StorageError, check_kind
from lfcore.files import make_folder
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.grid_geometry import Geometry
from lfcore.optics.slab import Extent, Slab
from lfcore.pictures import LIGHT_FIELD, check_suffix
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding
from lfcore.storage.layout import MOST_LIGHT
from lfcore.storage.views_store import store_views

if TYPE_CHECKING:
    from lfcore.scene.model import Scene

CODES = (np.uint8, np.uint16)
"""The types of views that hold sRGB codes."""


def store_arrays(
    path: Path,
    views: np.ndarray,
    geometry: Camera | CameraArray | float,
    encoding: Encoding | None,
    *,
    scene: Scene | None,
    name: str | None,
    white: float | None,
    progress: Callable[[int, int], None] | None,
) -> None:
    """Write ``views`` to ``path``; parameters and errors as of :meth:`LightField.from_views`."""
    from lfcore.scene.files import scene_digest

    check_suffix(path, (LIGHT_FIELD,))
    try:
        views, encoding = np.asarray(views), encoding or Encoding()
    except (TypeError, ValueError) as error:
        raise OpticsError(f"must be an array: {error}", key="views") from None
    if views.dtype.kind != "f" and views.dtype not in CODES:
        remedy = "Give floats of linear light, or uint8 or uint16 of sRGB codes"
        raise OpticsError(f"are of type {views.dtype}", key="views", remedy=remedy)
    if isinstance(geometry, CameraArray) and views.ndim == 3:
        views = geometry.tiles(views)
    if views.ndim != 5 or views.shape[-1] != 3 or 0 in views.shape:
        raise OpticsError(
            f"must be (rows, columns, height, width, 3), not {views.shape}", key="views"
        )
    if encoding.depth or encoding.layout == "macropixels":
        raise StorageError("views are stored as views, without depth", key="encoding")
    name = name or (scene.name if scene else path.stem)
    digest = scene_digest(scene) if scene else None
    make_folder(path.parent)
    rows, columns = views.shape[:2]
    recorded: Slab | CameraArray
    peak = content = None
    if isinstance(geometry, CameraArray):
        recorded, white = geometry, _white(path, views, geometry, white)
        spec = chosen_encoding(columns, encoding)
    else:
        if views.dtype == np.uint8 and encoding.codec == "ffv1" and encoding.pixel_format is None:
            encoding = replace(encoding, pixel_format="gbrp")  # exact
        recorded, content = _slab(views, geometry)
        peak = _peak(views, white, encoding, path)
        encoding = replace(encoding, transfer="pq" if peak else "srgb")
        spec = chosen_encoding(max(rows, columns), encoding, width=recorded.size.width)
    white = white or 1.0

    def shown(column: int, row: int) -> np.ndarray:
        picture = views[row, column]
        if picture.dtype in CODES:
            return picture
        light = picture.astype(np.float32) / np.float32(peak or white)
        return pq_encode(light) if peak else srgb_encode(light)

    store_views(
        path, recorded, shown, spec, name=name, digest=digest, white=white, peak=peak,
        content=content, progress=progress,
    )  # fmt: skip


def _white(path: Path, views: np.ndarray, array: CameraArray, white: float | None) -> float:
    """Return the radiance of the brightest code: ``white``, or the views' maximum and at least 1.

    Raises :class:`OpticsError` for views that a file cannot store.
    """
    (nx, ny), (w, h) = array.cameras, array.tile
    if views.dtype in CODES:
        raise OpticsError("of a camera array are linear light, not codes", key="views")
    if views.shape != (ny, nx, h, w, 3):
        raise OpticsError(
            f"views of shape {views.shape} are not {ny} x {nx} x {h} x {w} x 3", file=path,
            key="views", remedy="Check the cameras",
        )  # fmt: skip
    if nx != ny or w != h:
        raise OpticsError(
            f"has {nx} x {ny} cameras of {w} x {h} pixels; a file stores square grids of square "
            "pictures",
            file=path,
            remedy="Keep it as EXR, or trace a square array",
        )
    low, high = float(views.min()), float(views.max())
    if not (low >= 0 and np.isfinite(high)):
        raise OpticsError(
            f"has radiance from {low:g} to {high:g}",
            file=path,
            remedy="Replace negative and infinite values",
        )
    white = max(1.0, high) if white is None else float(white)
    if not (white > 0 and np.isfinite(white)):
        raise OpticsError(f"must be positive and finite, not {white}", key="white")
    return white


def _slab(views: np.ndarray, geometry: Camera | float) -> tuple[Slab, dict]:
    """Return the views' slab, and the facts about its geometry that the file records."""
    rows, columns, height, width, _ = views.shape
    if isinstance(geometry, Camera):
        extent = Extent.centred(columns, rows, width, height)
        whole = rows == columns and height == width
        slab = Slab(geometry, max(rows, columns), max(height, width), None if whole else extent)
        return slab, {}
    check_kind(geometry, Real, "geometry", "a Camera, a CameraArray or metres")
    spacing = float(geometry)
    if not (spacing > 0 and np.isfinite(spacing)):
        raise OpticsError(f"must be positive and finite, not {spacing}", key="spacing")
    content = {"metric": False, "source": {"format": "views", "pitch_m": spacing}}
    return Geometry(spacing).slab(columns, rows, width, height), content


def _peak(views: np.ndarray, white: float | None, encoding: Encoding, path: Path) -> float | None:
    """Return the light of the brightest code; None for sRGB."""
    if white is not None:
        raise OpticsError("belongs to a camera array", key="white", remedy="Give a CameraArray")
    if views.dtype in CODES:
        if encoding.transfer == "pq":
            raise StorageError("pq needs views of linear light, not codes", key="transfer")
        return None
    low, high = float(views.min()), float(views.max())
    if not (low >= 0 and high <= (MOST_LIGHT if encoding.transfer != "srgb" else 1)):
        raise OpticsError(
            f"have light from {low:g} to {high:g}", file=path, key="views",
            remedy="Clip them: sRGB stores 0 to 1, PQ 0 to 65536",
        )  # fmt: skip
    return max(1.0, high) if high > 1 or encoding.transfer == "pq" else None

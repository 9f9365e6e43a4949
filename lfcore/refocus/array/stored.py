"""Camera arrays in the video store, and any stored light field as a camera array's picture.

The store holds sRGB codes from 0 to 1, an array linear radiance without an upper end: what code
255 stands for, ``white``, is recorded beside the geometry and taken back on reading.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.refocus.views import read_views
from lfcore.storage.codecs import Encoding
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.metadata import Metadata
from lfcore.storage.views_store import store_views


def store_array(
    path: str | Path,
    tiles: np.ndarray,
    array: CameraArray,
    encoding: Encoding,
    *,
    name: str,
    digest: str | None = None,
    white: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Metadata:
    """Write a light field file of a camera array: one data camera is one frame.

    Parameters
    ----------
    tiles : ndarray
        (Ny, Nx, h, w, 3) float, linear radiance.
    array : CameraArray
        The data cameras.
    encoding : Encoding
        With its pixel format chosen.
    name, digest : str
        Of the scene; default of the digest is that of the pictures.
    white : float, optional
        Radiance that the brightest code stands for; more is clipped.  Default the brightest of the
        pictures, and at least 1.
    progress : callable, optional
        Called with (cameras done, of all).

    Raises
    ------
    OpticsError
        Pictures that are not the array's, not finite or negative; other than as many columns as
        rows of square pictures; a white that is not positive.
    StorageError
        The file cannot be written, or the codec does not take the settings.
    """
    _check(tiles, array, Path(path))
    white = max(1.0, float(tiles.max())) if white is None else float(white)
    if not (white > 0 and np.isfinite(white)):
        raise OpticsError(f"must be positive and finite, not {white}", key="white")

    def view(column: int, row: int) -> np.ndarray:
        return srgb_encode(tiles[row, column].astype(np.float32) / np.float32(white))

    return store_views(
        Path(path), array, view, encoding, name=name, digest=digest, white=white,
        progress=progress,
    )  # fmt: skip


def read_stored(
    field: LightFieldFile,
    *,
    device: Device | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[np.ndarray, CameraArray]:
    """All pictures of a stored light field, slab or array, as one array's picture.

    Returns
    -------
    (N M, N M, 3) float32, linear radiance, ready for ``DeviceField`` and ``write_array``; and the
    array that it is of, sheared when the slab is focused.

    Raises
    ------
    StorageError : the file is damaged.
    """
    if not field.metric:
        raise OpticsError(
            "does not hold its geometry, which a camera array needs", file=field.path,
            remedy="Import it again with --baseline, --field-of-view and --focus",
        )  # fmt: skip
    slab, (columns, rows) = field.metadata.slab, field.grid
    array = field.array if slab is None else CameraArray.from_slab(slab)
    assert array is not None  # a file holds one or the other
    samples = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2)
    views = read_views(field, samples, device=device, progress=progress)
    image = array.mosaic(views.reshape(rows, columns, *views.shape[1:]))
    if field.white != 1.0:
        image *= np.float32(field.white)
    return image, array


def _check(tiles: np.ndarray, array: CameraArray, path: Path) -> None:
    (nx, ny), (w, h) = array.cameras, array.tile
    if tiles.shape != (ny, nx, h, w, 3):
        raise OpticsError(
            f"views of shape {tiles.shape} are not {ny} x {nx} x {h} x {w} x 3", file=path,
            key="views", remedy="Check the cameras",
        )  # fmt: skip
    if nx != ny or w != h:
        raise OpticsError(
            f"{nx} x {ny} cameras of {w} x {h} pixels: a file holds as many columns as rows, of "
            "square pictures",
            file=path,
            remedy="Keep it as EXR, or trace a square array",
        )
    low, high = float(tiles.min()), float(tiles.max())
    if not (low >= 0 and np.isfinite(high)):
        raise OpticsError(
            f"has radiance from {low:g} to {high:g}",
            file=path,
            remedy="Mend the picture: light is neither negative nor infinite",
        )

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
from lfcore.files import draft_folder
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.refocus.views import read_views
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.metadata import Metadata
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb

_CHUNK_PIXELS = 1 << 22


def store_array(
    path: str | Path,
    image: np.ndarray,
    array: CameraArray,
    spec: Encoding,
    *,
    scene: dict,
    white: float | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Metadata:
    """Write a light field file of a camera array: one data camera is one frame.

    Parameters
    ----------
    image : (Ny h, Nx w, 3) float, linear radiance, as :class:`CameraArray` lays tiles out.
    scene : JSON object with at least ``name`` and ``digest``.
    white : radiance that the brightest code stands for; more is clipped.  Default the brightest
        of the image, and at least 1.
    progress : called with (cameras done, cameras).

    Raises
    ------
    OpticsError : an image that is not the array's, is not finite or is negative; an array that
        has other than as many columns as rows of square pictures; a white that is not positive.
    StorageError : the file cannot be written, or the codec does not take the settings.
    """
    tiles, path = array.tiles(image), Path(path)
    _check(image, array, path)
    white = max(1.0, float(image.max())) if white is None else float(white)
    if not (white > 0 and np.isfinite(white)):
        raise OpticsError(f"must be positive and finite, not {white}", key="white")
    layout = FrameLayout("views", array.cameras[0], array.tile[0], pixel_format=spec.stored_format)
    whole = layout.tile(0, 0, layout.views, layout.views)
    size, cameras = (layout.frame_width, layout.frame_height), whole.elements()
    step = max(1, _CHUNK_PIXELS // layout.pixels**2)
    with draft_folder(path) as folder:
        segment = folder / "array.mp4"
        with SegmentWriter(segment, spec, *size) as writer:
            for start in range(0, len(cameras), step):
                column, row = cameras[start : start + step].T
                light = tiles[row, column].astype(np.float32) / np.float32(white)
                writer.write(frames_from_rgb(srgb_encode(light), spec.stored_format, *size))
                if progress is not None:
                    progress(min(start + step, len(cameras)), len(cameras))
        geometry = {**array.to_json(), "white": white}
        return join_segments(
            path, [segment], [whole], layout, geometry=geometry, scene=scene, spec=spec
        )


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


def _check(image: np.ndarray, array: CameraArray, path: Path) -> None:
    (nx, ny), (w, h) = array.cameras, array.tile
    if nx != ny or w != h:
        raise OpticsError(
            f"{nx} x {ny} cameras of {w} x {h} pixels: a file holds as many columns as rows, of "
            "square pictures",
            file=path,
            remedy="Keep it as EXR, or trace a square array",
        )
    low, high = float(image.min()), float(image.max())
    if not (low >= 0 and np.isfinite(high)):
        raise OpticsError(
            f"has radiance from {low:g} to {high:g}",
            file=path,
            remedy="Mend the picture: light is neither negative nor infinite",
        )

"""Camera arrays as one tiled EXR: linear radiance, the geometry in the header.

The picture holds the data cameras' tiles side by side as the assignment lays them out, and the file
is tiled so that one camera is one EXR tile (where the size allows).  The header attribute
:data:`ATTRIBUTE` holds the array as JSON.  An EXR without it, as pbrt writes, is read too; its
geometry must then come from elsewhere.
"""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

from lfcore.errors import OpticsError, StorageError
from lfcore.optics.array import CameraArray

ATTRIBUTE = "lightfield"
FORMAT = "lfcore camera array"
VERSION = 1
_TILE_LIMIT = 4096  # larger tiles help nobody's reader


@dataclass(frozen=True, eq=False)
class TiledPicture:
    """``image`` is (H, W, 3) float32 or float16; ``array`` is None without geometry."""

    image: np.ndarray
    array: CameraArray | None
    extra: dict


def write_array(
    path: str | Path,
    image: np.ndarray,
    array: CameraArray,
    *,
    half: bool = False,
    extra: dict | None = None,
) -> None:
    """Write a light field of ``array``.

    Parameters
    ----------
    image : (Ny h, Nx w, 3) float, linear radiance.
    half : store 16-bit floats, as pbrt does, instead of 32.
    extra : JSON values to keep beside the geometry, e.g. the scene's name.

    Raises
    ------
    OpticsError : the image is not that of the array.
    StorageError : the file cannot be written.
    """
    array.tiles(image)
    description = {"format": FORMAT, "version": VERSION, "array": array.to_json()}
    header = {ATTRIBUTE: json.dumps({**description, "extra": extra or {}})}
    if max(array.tile) <= _TILE_LIMIT and min(array.tile) >= 16:
        tiles = OpenEXR.TileDescription()
        tiles.xSize, tiles.ySize = array.tile
        header |= {"type": OpenEXR.tiledimage, "tiles": tiles}
    _write(path, image, header, half)


def write_picture(path: str | Path, image: np.ndarray, *, half: bool = False) -> None:
    """Write one linear picture (H, W, 3) as a scanline EXR.

    Raises :class:`StorageError` when the file cannot be written.
    """
    _write(path, image, {}, half)


def read_array(path: str | Path) -> TiledPicture:
    """Read an EXR with or without geometry; 16-bit floats stay 16-bit.

    Raises
    ------
    StorageError : not an EXR, no colour channels, or a header that contradicts the picture.
    """
    image, header = _read(path)
    text = header.get(ATTRIBUTE)
    if text is None:
        return TiledPicture(image, None, {})
    try:
        description = json.loads(text)
        if description["format"] != FORMAT:
            raise ValueError(f"format {description['format']!r}")
        if description["version"] > VERSION:
            raise ValueError(f"version {description['version']} is newer than {VERSION}")
        array = CameraArray.from_json(description["array"])
        array.tiles(image)
    except (ValueError, KeyError, TypeError, OpticsError) as error:
        raise StorageError(
            f"the geometry in its header does not fit: {error}",
            file=path,
            key=ATTRIBUTE,
            remedy="Write the light field again",
        ) from None
    return TiledPicture(image, array, description.get("extra", {}))


def read_picture(path: str | Path) -> np.ndarray:
    """(H, W, 3) float32 of any EXR; a single channel is repeated.

    Raises :class:`StorageError` for a file that is no EXR.
    """
    return _read(path)[0].astype(np.float32)


def _read(path: str | Path) -> tuple[np.ndarray, dict]:
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            header = dict(file.header())
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # the package raises RuntimeError, ValueError and more
        if not Path(path).exists():
            raise StorageError("no such file", file=path, remedy="Check the path") from None
        raise StorageError(
            f"not a readable EXR: {error}", file=path, remedy="Write the file again"
        ) from None
    if {"R", "G", "B"} <= set(channels):
        planes = [channels[name] for name in "RGB"]
    elif "Y" in channels or len(channels) == 1:
        planes = [channels.get("Y", next(iter(channels.values())))] * 3
    else:
        raise StorageError(f"has channels {sorted(channels)}, not R, G, B", file=path)
    dtype = np.float16 if all(p.dtype == np.float16 for p in planes) else np.float32
    return np.stack([np.asarray(plane, dtype) for plane in planes], -1), header


def _write(path: str | Path, image: np.ndarray, header: dict, half: bool) -> None:
    path = Path(path)
    if image.ndim != 3 or image.shape[2] != 3:
        raise StorageError(f"a picture is (H, W, 3), not {image.shape}", file=path)
    pixels = np.ascontiguousarray(image, np.float16 if half else np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | header
    # Moved into place when whole: a file that looks finished is finished.
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with OpenEXR.File(header, {"RGB": pixels}) as file:
            file.write(str(temporary))
        os.replace(temporary, path)
    except (OSError, RuntimeError, ValueError) as error:
        temporary.unlink(missing_ok=True)
        reason = getattr(error, "strerror", None) or error
        raise StorageError(
            f"cannot be written: {reason}", file=path, remedy="Check the folder and free space"
        ) from None

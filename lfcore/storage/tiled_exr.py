"""Camera arrays as one tiled EXR: linear radiance, with the geometry in the header.

The picture has the cameras' pictures side by side, in the order of the assignment; if the size
allows, one camera is one EXR tile.  The header attribute :data:`ATTRIBUTE` has the array as JSON.
An EXR without it, as pbrt writes, can be read, too, but without geometry.
"""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import OpenEXR

from lfcore.errors import OpticsError, StorageError
from lfcore.exr import exr_bytes, read_exr
from lfcore.files import whole_file
from lfcore.optics.array import CameraArray

ATTRIBUTE = "lightfield"
"""The name of the header attribute."""
FORMAT = "lfcore camera array"
"""The name of the format, in the attribute."""
VERSION = 1
"""The version of the attribute."""
_TILE_LIMIT = 4096
"""The longest side of EXR tiles, pixels; readers gain nothing from larger ones."""


def _digest(description: dict) -> str:
    """Return the SHA-256 of a description without its digest."""
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()


@dataclass(frozen=True, eq=False)
class TiledPicture:
    """The content of an EXR.

    Attributes
    ----------
    image : ndarray
        (H, W, 3) float32 or float16.
    array : CameraArray or None
        The geometry, if the file has any.
    extra : dict
        JSON values recorded beside it.
    """

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
    """Write a light field (Ny h, Nx w, 3) of ``array``, with ``extra`` JSON values; ``half``: with
    16-bit floats, as pbrt."""
    array.tiles(image)
    description = {
        "format": FORMAT, "version": VERSION, "array": array.to_json(), "extra": extra or {}
    }  # fmt: skip
    header: dict = {ATTRIBUTE: json.dumps(description | {"digest": _digest(description)})}
    if max(array.tile) <= _TILE_LIMIT and min(array.tile) >= 16:
        tiles = OpenEXR.TileDescription()
        tiles.xSize, tiles.ySize = array.tile
        header |= {"type": OpenEXR.tiledimage, "tiles": tiles}
    with whole_file(path) as file:
        file.write(exr_bytes(image, header, half=half))


def read_array(path: str | Path) -> TiledPicture:
    """Read an EXR with or without geometry; 16-bit floats stay 16-bit."""
    image, header = read_exr(path)
    text = header.get(ATTRIBUTE)
    if text is None:
        return TiledPicture(image, None, {})
    try:
        description = json.loads(text)
        digest = description.pop("digest", None)  # older files have none
        if digest not in (None, _digest(description)):
            raise ValueError("the digest differs")
        if description["format"] != FORMAT:
            raise ValueError(f"format {description['format']!r}")
        if description["version"] > VERSION:
            raise ValueError(f"version {description['version']} is newer than {VERSION}")
        array = CameraArray.from_json(description["array"])
        array.tiles(image)
    except (
        ValueError, KeyError, TypeError, AttributeError, RecursionError, OpticsError
    ) as error:  # fmt: skip
        problem = f"the geometry in its header is invalid: {error}"
        remedy = "Write the light field again"
        raise StorageError(problem, file=path, key=ATTRIBUTE, remedy=remedy) from None
    return TiledPicture(image, array, description.get("extra", {}))

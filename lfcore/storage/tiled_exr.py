"""Camera arrays as one tiled EXR: linear radiance, the geometry in the header.

The picture holds the data cameras' tiles side by side as the assignment lays them out, and the file
is tiled so that one camera is one EXR tile (where the size allows).  The header attribute
:data:`ATTRIBUTE` holds the array as JSON.  An EXR without it, as pbrt writes, is read too; its
geometry must then come from elsewhere.
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
FORMAT = "lfcore camera array"
VERSION = 1
_TILE_LIMIT = 4096  # larger tiles help nobody's reader


def _digest(description: dict) -> str:
    """SHA-256 of a description without its digest."""
    return hashlib.sha256(json.dumps(description, sort_keys=True).encode()).hexdigest()


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
    """Write a light field (Ny h, Nx w, 3) of ``array``, with ``extra`` JSON values; ``half``: as
    pbrt."""
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
            raise ValueError("it is damaged")
        if description["format"] != FORMAT:
            raise ValueError(f"format {description['format']!r}")
        if description["version"] > VERSION:
            raise ValueError(f"version {description['version']} is newer than {VERSION}")
        array = CameraArray.from_json(description["array"])
        array.tiles(image)
    except (
        ValueError, KeyError, TypeError, AttributeError, RecursionError, OpticsError
    ) as error:  # fmt: skip
        problem = f"the geometry in its header does not fit: {error}"
        remedy = "Write the light field again"
        raise StorageError(problem, file=path, key=ATTRIBUTE, remedy=remedy) from None
    return TiledPicture(image, array, description.get("extra", {}))

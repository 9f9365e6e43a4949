"""Files that a mesh file names: beside it, or where names of another computer mean them."""

import os
from pathlib import Path, PureWindowsPath

import numpy as np

from lfcore.errors import LfcoreError
from lfcore.pictures import codes_of, decode
from lfcore.reading import LARGEST_TEXT, Where, read_bytes

SOLID = 250
"""The least code of alpha that is solid: encoders blur an alpha of one."""


SOFT = 0.05
"""The largest share of texels on the edges of holes; with more, a texture is transparent."""


def is_mask(alpha: np.ndarray) -> bool:
    """Whether codes of alpha cut holes: nearly all of them stop or pass all light."""
    return float(((alpha > 255 - SOLID) & (alpha < SOLID)).mean()) <= SOFT


def beside(name: str, *files: Path) -> Path | None:
    """The file that one of ``files`` names, in the folder of the first of them that has it.

    Backslashes count as slashes where there is no such file, and at last the name alone counts.
    """
    for candidate in (name, name.replace("\\", "/"), PureWindowsPath(name).name):
        for file in files:
            try:
                if candidate and os.path.isfile(file.parent / candidate):
                    return file.parent / candidate
            except ValueError:  # a NUL in the name
                continue
    return None


def read_texture(path: Path, where: Where, *, alpha: bool = False) -> np.ndarray:
    """An image file as (H, W, 3) uint8 sRGB, or 4 with ``alpha``; :class:`SceneError` if missing
    or damaged."""
    if not os.path.isfile(path):
        remedy = "Give a path relative to the scene file"
        raise where.error(f"texture {str(path)!r} not found", remedy)
    try:
        return codes_of(decode(read_bytes(path, LARGEST_TEXT, "texture"), alpha=alpha))
    except LfcoreError as error:
        problem = f"texture {str(path)!r} cannot be decoded: {error.problem}"
        raise where.error(problem, "Use a PNG or JPEG") from None


def same_size(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two pictures, the smaller enlarged, bilinear."""
    import cv2  # slow to import

    height, width = np.maximum(one.shape[:2], other.shape[:2]).tolist()
    scaled = [cv2.resize(each, (width, height)) for each in (one, other)]
    return scaled[0], scaled[1]

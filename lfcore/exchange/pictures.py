"""Reading of other programs' pictures and float maps, whole or not at all."""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import LfcoreError
from lfcore.exchange.reading import ExchangeError
from lfcore.files import whole_file
from lfcore.pictures import by_opencv, picture_size, read_picture
from lfcore.reading import LARGEST_PICTURE, read_bytes

SUFFIXES = (
    ".png",
    ".jpg",
    ".jpeg",
    ".ppm",
    ".bmp",
    ".tif",
    ".tiff",
    ".webp",
    ".rgb",
    ".tga",
    ".exr",
    ".hdr",
)


def is_picture(path: Path) -> bool:
    return (
        os.path.isfile(path) and path.suffix.lower() in SUFFIXES and not path.name.startswith(".")
    )


def view_name(column: int, row: int) -> str:
    """The name of a view's file, in formats that leave it to their descriptions."""
    return f"view_{row:03d}_{column:03d}.png"


def pictures_of(folder: Path) -> list[Path]:
    """Pictures in a folder, sorted by the numbers in their names."""

    def natural(path: Path) -> list:
        words: list[Any] = re.split(r"(\d+)", path.name)
        words[1::2] = map(int, words[1::2])
        return words

    return sorted(filter(is_picture, folder.iterdir()), key=natural)


def size_of(path: Path) -> tuple[int, int]:
    """(width, height) of a picture, from its header where that is cheap."""
    try:
        return picture_size(path)
    except LfcoreError as error:
        raise error.named(ExchangeError) from None


def read(path: Path, size: tuple[int, int] | None = None) -> np.ndarray:
    """(h, w, 3) uint8 or uint16 codes, or float32 sRGB-encoded values of linear light.

    Grey is repeated and an alpha channel left out.
    """
    try:
        picture = read_picture(path)
    except LfcoreError as error:
        raise error.named(ExchangeError, file=path) from None
    if picture.dtype == np.float32:
        picture = srgb_encode(picture)
    if size is not None and picture.shape[1::-1] != tuple(size):
        problem = "is {} x {} pixels, where {} x {} are expected"
        raise ExchangeError(problem.format(*picture.shape[1::-1], *size), file=path)
    return picture


def write_ppm(path: Path, picture: np.ndarray, bits: int) -> None:
    """Write uint8 codes as a binary PPM with ``bits`` per sample, most significant byte first."""
    most = (1 << bits) - 1
    codes = np.rint(picture * (most / 255.0)).astype(np.uint8 if bits == 8 else ">u2")
    head = f"P6\n{picture.shape[1]} {picture.shape[0]}\n{most}\n".encode("ascii")
    with whole_file(path) as file:
        file.write(head + codes.tobytes())


def read_pfm(path: Path) -> np.ndarray:
    """(h, w) or (h, w, 3) float32 of a Portable FloatMap, first row on top."""
    try:
        picture = by_opencv(read_bytes(path, LARGEST_PICTURE, "picture"))
    except LfcoreError as error:
        raise error.named(ExchangeError) from None
    if picture is None or picture.dtype != np.float32:
        raise ExchangeError("is no whole float map (PFM)", file=path)
    return picture

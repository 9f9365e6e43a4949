"""Reading pictures and float maps of other programs, whole or not at all."""

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from lfcore.colour import srgb_encode
from lfcore.errors import LfcoreError
from lfcore.exchange.reading import ExchangeError, unreadable
from lfcore.files import whole_file
from lfcore.pictures import MOST_PIXELS, by_opencv, read_codes

SUFFIXES = (".png", ".jpg", ".jpeg", ".ppm", ".bmp", ".tif", ".tiff", ".webp", ".rgb", ".exr")
PPM_HEADER = re.compile(rb"P6%b(\d{1,9})%b(\d{1,9})%b(\d{1,9})\s" % ((rb"(?:\s|#[^\n]*\n)+",) * 3))
Image.MAX_IMAGE_PIXELS = MOST_PIXELS


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
    if path.suffix.lower() == ".exr":
        return read(path).shape[1::-1]
    try:
        with Image.open(path) as picture:
            return picture.size
    except (OSError, UnidentifiedImageError, ValueError, SyntaxError) as error:
        raise unreadable(path, error, "cannot be read as a picture") from None


def read(path: Path, size: tuple[int, int] | None = None) -> np.ndarray:
    """(h, w, 3) uint8 or uint16 codes, or float32 sRGB-encoded values of an EXR's linear light.

    Grey is repeated and an alpha channel left out.
    """
    suffix = path.suffix.lower()
    if suffix == ".exr":
        from lfcore.exr import read_exr_picture

        picture = srgb_encode(read_exr_picture(path))
    elif suffix == ".ppm":
        picture = read_ppm(path)
    else:
        try:
            picture = read_codes(path)
        except LfcoreError as error:
            raise ExchangeError(error.problem, file=path) from None
        if picture.dtype == np.float32:
            raise ExchangeError("holds floats, which are not codes", file=path)
    if size is not None and picture.shape[1::-1] != tuple(size):
        problem = "is {} x {} pixels, where {} x {} are expected"
        raise ExchangeError(problem.format(*picture.shape[1::-1], *size), file=path)
    return picture


def read_ppm(path: Path) -> np.ndarray:
    """(h, w, 3) of a binary PPM: uint8, or uint16 scaled to the full range of 16 bits."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise unreadable(path, error, "cannot be read as a picture") from None
    head = PPM_HEADER.match(data)
    width, height, most = (int(word) for word in head.groups()) if head else (0, 0, 0)
    if not (head and 0 < most < 65536 and width > 0 and height > 0):
        raise ExchangeError("is no binary PPM (P6) of 1 to 16 bits", file=path)
    item = np.dtype(np.uint8) if most < 256 else np.dtype(">u2")
    whole = head.end() + width * height * 3 * item.itemsize
    if len(data) < whole:
        raise ExchangeError(f"is cut short: {len(data)} bytes, {whole} expected", file=path)
    codes: np.ndarray = np.frombuffer(data, item, width * height * 3, head.end())
    codes = codes.reshape(height, width, 3)
    if most == 255:
        return codes
    return np.rint(codes * (65535.0 / most)).clip(0, 65535).astype(np.uint16)


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
        picture = by_opencv(path.read_bytes())
    except OSError as error:
        raise unreadable(path, error, "cannot be read as a picture") from None
    if picture is None or picture.dtype != np.float32:
        raise ExchangeError("is no whole float map (PFM)", file=path)
    return picture

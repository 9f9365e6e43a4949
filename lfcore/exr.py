"""EXR files: colour channels and a header, through the OpenEXR library."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenEXR

from lfcore.errors import StorageError
from lfcore.files import refuse_special

MOST_EMPTY = 1 << 24
"""The pixels of a display window, up to which its data window may be arbitrarily small."""


def exr_bytes(image: np.ndarray, header: dict | None = None, *, half: bool = False) -> bytes:
    """An EXR file of ``image`` (H, W, 3), linear light, or (H, W) depths, channel Z.

    In memory: writing by a name, the library does not notice a full disk.
    """
    if image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)):
        raise StorageError(f"a picture is (H, W, 3) or (H, W), not {image.shape}")
    pixels = np.ascontiguousarray(image, np.float16 if half else np.float32)
    base = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    stream = io.BytesIO()
    try:
        with OpenEXR.File(base | (header or {}), {"RGB" if image.ndim == 3 else "Z": pixels}) as f:
            f.write(stream)
    except (RuntimeError, ValueError) as error:
        raise StorageError(f"cannot be made an EXR: {error}") from None
    return stream.getvalue()


def read_exr(path: str | Path | io.BytesIO) -> tuple[np.ndarray, dict]:
    """Read an EXR picture and its header.

    Parameters
    ----------
    path : str, Path or BytesIO
        The file.

    Returns
    -------
    picture : ndarray
        (H, W, 3) of the display window, black outside the data window: float32, or float16 if all
        channels are.  A single channel is repeated; colours may be in the only layer.
    header : dict
        The header's attributes.

    Raises
    ------
    StorageError
        The file is no EXR.

    Examples
    --------
    >>> lfcore.write_picture("grey.exr", np.full((4, 6, 3), 0.5, np.float32))
    >>> picture, header = lfcore.read_exr("grey.exr")
    >>> picture.shape, picture.dtype
    ((4, 6, 3), dtype('float32'))
    """
    name = None if isinstance(path, io.BytesIO) else str(path)
    with _opened(path) as file:
        header = dict(file.header())
        channels = {name: channel.pixels for name, channel in file.channels().items()}
    layers = [key.removesuffix("R") for key in channels if key.endswith(("R", ".R"))]
    layers = [layer for layer in layers if {layer + "G", layer + "B"} <= set(channels)]
    if "" in layers or len(layers) == 1:
        layer = "" if "" in layers else layers[0]
        planes = [channels[layer + colour] for colour in "RGB"]
    elif len(channels) == 1 or ("Y" in channels and not {"RY", "BY"} & set(channels)):
        planes = [channels.get("Y", next(iter(channels.values())))] * 3
    else:
        raise StorageError(f"has channels {sorted(channels)}, not R, G, B", file=name)
    if len({plane.shape for plane in planes}) > 1:
        raise StorageError("has channels of different sizes", file=name)
    dtype = np.float16 if all(p.dtype == np.float16 for p in planes) else np.float32
    picture = np.stack([np.asarray(plane, dtype) for plane in planes], -1)
    return _displayed(picture, header, name), header


def exr_size(path: str | Path | io.BytesIO) -> tuple[int, int]:
    """(width, height) of the display window; raises as :func:`read_exr`."""
    with _opened(path, header_only=True) as file:
        low, high = _window(file.header(), "displayWindow")
    return int(high[0] - low[0]), int(high[1] - low[1])


@contextmanager
def _opened(path: str | Path | io.BytesIO, **how: bool) -> Iterator[OpenEXR.File]:
    name = None if isinstance(path, io.BytesIO) else str(path)
    if name and not Path(name).exists():
        raise StorageError("no such file", file=name, remedy="Check the path")
    if name:
        refuse_special(name)
    try:
        with OpenEXR.File(name or path, separate_channels=True, **how) as file:
            yield file
    except Exception as error:  # the package raises RuntimeError, ValueError and more
        problem = f"not a readable EXR: {error}"
        raise StorageError(problem, file=name, remedy="Write the file again") from None


def _window(header: dict, name: str) -> np.ndarray:
    """(2, 2) int64: the first pixel of a window, x and y, and that after its last."""
    return np.array(header[name], np.int64) + [[0], [1]]


def _displayed(picture: np.ndarray, header: dict, name: str | None) -> np.ndarray:
    """The display window of a picture that fills the data window."""
    low, high = _window(header, "displayWindow")
    first, last = _window(header, "dataWindow")
    if (low == first).all() and (high == last).all():
        return picture
    width, height = (high - low).tolist()
    if min(width, height) < 1 or width * height > max(MOST_EMPTY, 16 * picture[..., 0].size):
        raise StorageError(f"has a display window of {width} x {height} pixels", file=name)
    out = np.zeros((height, width, 3), picture.dtype)
    (x, y), (right, bottom) = np.maximum(first, low), np.maximum(np.minimum(last, high), first)
    if right > x and bottom > y:
        part = picture[y - first[1] : bottom - first[1], x - first[0] : right - first[0]]
        out[y - low[1] : bottom - low[1], x - low[0] : right - low[0]] = part
    return out


def read_exr_picture(path: str | Path | io.BytesIO) -> np.ndarray:
    """(H, W, 3) float32 of any EXR; raises as :func:`read_exr`."""
    return read_exr(path)[0].astype(np.float32)

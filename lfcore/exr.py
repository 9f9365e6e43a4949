"""EXR files: colour channels and a header, through the OpenEXR library."""

import io
from pathlib import Path

import numpy as np
import OpenEXR

from lfcore.errors import StorageError


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
    """(H, W, 3) float32, or float16 where all channels are, and the header's attributes.

    A single channel is repeated.  Raises :class:`StorageError` for a file that is no EXR.
    """
    name = None if isinstance(path, io.BytesIO) else str(path)
    if name and not Path(name).exists():
        raise StorageError("no such file", file=name, remedy="Check the path")
    try:
        with OpenEXR.File(name or path, separate_channels=True) as file:
            header = dict(file.header())
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # the package raises RuntimeError, ValueError and more
        problem = f"not a readable EXR: {error}"
        raise StorageError(problem, file=name, remedy="Write the file again") from None
    if {"R", "G", "B"} <= set(channels):
        planes = [channels[name] for name in "RGB"]
    elif "Y" in channels or len(channels) == 1:
        planes = [channels.get("Y", next(iter(channels.values())))] * 3
    else:
        raise StorageError(f"has channels {sorted(channels)}, not R, G, B", file=name)
    if len({plane.shape for plane in planes}) > 1:
        raise StorageError("has channels of different sizes", file=name)
    dtype = np.float16 if all(p.dtype == np.float16 for p in planes) else np.float32
    return np.stack([np.asarray(plane, dtype) for plane in planes], -1), header


def read_exr_picture(path: str | Path) -> np.ndarray:
    """(H, W, 3) float32 of any EXR; raises as :func:`read_exr`."""
    return read_exr(path)[0].astype(np.float32)

"""Pictures to files: PNG and PPM to look at, EXR and NPY with linear floats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from PIL import Image

from lfcore.errors import LfcoreError
from lfcore.files import whole
from lfcore.pictures import encode_srgb

CODED = (".png", ".ppm")
FLOAT = (".exr", ".npy")
SUFFIXES = (*CODED, *FLOAT)


def check_suffix(path: Path, suffixes: Sequence[str] = SUFFIXES, key: str = "--output") -> None:
    """Raise :class:`LfcoreError` for a name of no known format, before any work is done."""
    if path.suffix.lower() not in suffixes:
        raise LfcoreError(
            f"unknown format {path.suffix!r}",
            file=path,
            key=key,
            remedy=f"Use a name that ends in {', '.join(suffixes)}",
        )


def write_pictures(named: Sequence[tuple[Path, np.ndarray]]) -> None:
    """Write pictures (H, W, 3) of linear light; all of them appear, or none.

    8-bit formats are sRGB-encoded; uint8 arrays are taken for codes already.  An array of any
    shape goes to ``.npy``.
    """
    with ExitStack() as files:
        for path, picture in named:
            _writer(path)(files.enter_context(whole(path)), picture)


def write_picture(path: Path, picture: np.ndarray) -> None:
    """As :func:`write_pictures`, one."""
    write_pictures([(path, picture)])


def _writer(path: Path) -> Callable[[Path, np.ndarray], None]:
    suffix = path.suffix.lower()
    return {".exr": _exr, ".npy": _npy}.get(suffix, _coded)


def _coded(path: Path, picture: np.ndarray) -> None:
    codes = picture if picture.dtype == np.uint8 else encode_srgb(picture)
    Image.fromarray(codes).save(path)


def _npy(path: Path, picture: np.ndarray) -> None:
    with path.open("wb") as file:
        np.save(file, picture, allow_pickle=False)


def _exr(path: Path, picture: np.ndarray) -> None:
    from lfcore.colour import srgb_to_linear
    from lfcore.storage.tiled_exr import write_picture as write_exr

    if picture.dtype == np.uint8:
        picture = srgb_to_linear(picture / 255.0)
    write_exr(path, picture)

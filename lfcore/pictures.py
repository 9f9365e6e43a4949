"""Pictures on disk: single ones for people, stacks of planes in linear float for the next stage."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from lfcore.colour import linear_to_srgb
from lfcore.errors import LfcoreError
from lfcore.files import whole
from lfcore.optics.planes import SensorPlane

FORMATS = ("png", "ppm")


def encode_srgb(picture: np.ndarray) -> np.ndarray:
    """(H, W, 3) linear light in [0, 1] (clipped) to sRGB codes, uint8, rounded once."""
    return np.rint(255.0 * linear_to_srgb(np.clip(picture, 0.0, 1.0))).astype(np.uint8)


def write_picture(path: str | Path, picture: np.ndarray) -> None:
    """Write (H, W, 3) linear light as an 8-bit sRGB picture; PNG or PPM by the suffix.

    Raises
    ------
    LfcoreError
        for another suffix.
    """
    if Path(path).suffix.lower().lstrip(".") not in FORMATS:
        raise LfcoreError(
            "pictures are written as PNG or PPM", file=path, remedy=f"Use one of {FORMATS}"
        )
    with whole(path) as draft:
        Image.fromarray(encode_srgb(picture)).save(draft)


def plane_label(index: int, plane: SensorPlane) -> str:
    """A file name for plane ``index``, e.g. ``02_focus1.25m_f2.8_circle``."""
    return f"{index:02d}_focus{plane.focus_distance_m:.4g}m_f{plane.f_number:.3g}_{plane.shape}"


def write_pictures(
    folder: str | Path, pictures: np.ndarray, planes: Sequence[SensorPlane], *, suffix: str
) -> None:
    """Write (P, M, M, 3) linear light as one picture a plane, named by :func:`plane_label`.

    Raises
    ------
    LfcoreError
        for a ``suffix`` other than ``png`` and ``ppm``.
    """
    for index, (picture, plane) in enumerate(zip(pictures, planes, strict=True)):
        write_picture(Path(folder) / f"{plane_label(index, plane)}.{suffix}", picture)


def save_stack(path: str | Path, pictures: np.ndarray, planes: Sequence[SensorPlane]) -> None:
    """Write (P, M, M, 3) float32 linear light with the planes it shows, as npz.

    Raises
    ------
    ValueError
        when there is not one plane a picture.
    """
    if len(pictures) != len(planes):
        raise ValueError(f"{len(pictures)} pictures of {len(planes)} planes")
    header = json.dumps([plane.to_json() for plane in planes])
    with whole(path) as draft, draft.open("wb") as stream:
        np.savez(
            stream,
            pictures=np.asarray(pictures, np.float32),
            planes=np.frombuffer(header.encode(), np.uint8),
        )


def load_stack(path: str | Path) -> tuple[np.ndarray, list[SensorPlane]]:
    """The (P, M, M, 3) float32 pictures and the planes of :func:`save_stack`.

    Raises
    ------
    LfcoreError
        when the file is missing, damaged or not a stack.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            planes = json.loads(archive["planes"].tobytes())
            return archive["pictures"], [SensorPlane(**plane) for plane in planes]
    except (OSError, KeyError, ValueError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise LfcoreError(
            f"not a whole stack of planes ({' '.join(str(error).split())[:120]})",
            file=path,
            remedy="Delete it and run again",
        ) from None

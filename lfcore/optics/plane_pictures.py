"""Pictures of sensor planes on disk: files named by their planes, or one file with all."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.files import make_folder, read_arrays, whole_file
from lfcore.optics.planes import SensorPlane
from lfcore.pictures import write_pictures


def plane_label(index: int, plane: SensorPlane) -> str:
    """A file name for plane ``index``, e.g. ``02_focus1.25m_f2.8_circle``."""
    half = f"_{plane.half}" if plane.half else ""
    return f"{index:02d}_focus{plane.focus_m:.4g}m_f{plane.f_number:.3g}_{plane.aperture}{half}"


def write_plane_pictures(
    folder: str | Path, pictures: np.ndarray, planes: Sequence[SensorPlane], *, suffix: str
) -> None:
    """Write (P, M, M, 3) linear light, a picture per plane, named by :func:`plane_label`."""
    names = [f"{plane_label(index, plane)}.{suffix}" for index, plane in enumerate(planes)]
    write_pictures(
        [(Path(folder) / name, picture) for name, picture in zip(names, pictures, strict=True)]
    )


def save_stack(
    path: str | Path, pictures: np.ndarray, planes: Sequence[SensorPlane], **arrays: Any
) -> None:
    """Write (P, M, M, 3) float32 linear light with its planes, and other arrays by name, as npz."""
    if len(pictures) != len(planes):
        raise ValueError(f"{len(pictures)} pictures for {len(planes)} planes")
    header = json.dumps([plane.to_json() for plane in planes])
    make_folder(Path(path).parent)
    with whole_file(path) as file:
        np.savez(
            file,
            pictures=np.asarray(pictures, np.float32),
            planes=np.frombuffer(header.encode(), np.uint8),
            **arrays,
        )


def load_stack(path: str | Path) -> tuple[np.ndarray, list[SensorPlane]]:
    """Read the (P, M, M, 3) float32 pictures and the planes that :func:`save_stack` wrote."""

    def read(archive: Any) -> tuple[np.ndarray, list[SensorPlane]]:
        planes = json.loads(archive["planes"].tobytes())
        return archive["pictures"], [SensorPlane(**plane) for plane in planes]

    return read_arrays(path, "stack of planes", read)

"""Checks of single arrays that public objects are given, and fast arithmetic of their rows."""

from functools import reduce
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.appearance import RANGES


def columnwise(ufunc: np.ufunc, rows: np.ndarray) -> np.ndarray:
    """``ufunc.reduce`` over the short last axis, column by column: numpy takes ten times as long
    for rows of three."""
    return reduce(ufunc, np.moveaxis(rows, -1, 0))


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar products of vectors (..., 3), term by term: libraries add in other orders
    on other processors, and numpy takes longer."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


KINDS = {"floats": "f", "integers": "iu", "uint8": "u"}


def check_array(key: str, value: Any, shape: tuple[int | None, ...], kind: str = "floats") -> None:
    """Raise :class:`SceneError` unless it is an array of this kind and shape; None: any length."""
    is_array = isinstance(value, np.ndarray)
    if (
        is_array
        and value.dtype.kind in KINDS[kind]
        and value.ndim == len(shape)
        and all(wanted in (None, length) for wanted, length in zip(shape, value.shape, strict=True))
        and (kind != "uint8" or value.dtype == np.uint8)
    ):
        return
    expected = ", ".join("any" if length is None else str(length) for length in shape)
    actual = f"{value.dtype} {value.shape}" if is_array else f"a {type(value).__name__}"
    raise SceneError(f"must be an array of {kind} of shape ({expected}), not {actual}", key=key)


def check_texture(key: str, picture: Any) -> None:
    """Raise :class:`SceneError` unless the picture is (H, W, 3) or (H, W, 4) uint8."""
    channels = 4 if getattr(picture, "shape", ())[2:] == (4,) else 3
    check_array(key, picture, (None, None, channels), "uint8")
    if not picture.size:
        raise SceneError("has no texels", key=key)


def check_triple(key: str, values: Any) -> None:
    """Raise :class:`SceneError` unless there are three numbers."""
    try:
        array = np.asarray(values)
        fits = array.shape == (3,) and array.dtype.kind in "fiu"
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise SceneError(f"must be three numbers, not {values!r}", key=key)


def check_appearance(key: str, owner: Any) -> None:
    """Raise :class:`SceneError` unless colours and numbers of a material or surface make sense."""
    place = f"{key}." if key else ""
    for name in ("diffuse", "specular", "emission", "attenuation_colour"):
        check_triple(f"{place}{name}", getattr(owner, name))
    for channel in owner.attenuation_colour:
        check_range(f"{place}attenuation_colour", channel, 0.0, 1.0)
    for name, (least, most) in RANGES.items():
        check_range(f"{place}{name}", getattr(owner, name), least, most)


def check_range(key: str, value: Any, least: float, most: float) -> None:
    """Raise :class:`SceneError` unless it is a number from ``least`` to ``most``."""
    try:
        fits = bool(least <= value <= most)
    except (TypeError, ValueError):
        fits = False
    if not fits:
        problem = f"must be a number from {least:g} to {most:g}, not {value!r}"
        raise SceneError(problem, key=key, remedy="Give one in this range")

"""The size of pictures: a width and a height in pixels, which are square."""

from __future__ import annotations

import operator
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera

MOST_PIXELS = 65536
Pixels = int | Sequence[int]
"""What a caller gives: the side of a square picture, or its width and height."""


class Size(NamedTuple):
    """Width and height of a picture.

    The camera's field is that of the shorter side, as in pbrt: a wide picture shows more on both
    sides.
    """

    width: int
    height: int

    @classmethod
    def of(cls, pixels: Pixels | str) -> Size:
        """The size of ``512``, ``(1920, 1080)`` or ``"1920x1080"``."""
        given: object = pixels
        if isinstance(pixels, str):
            sides = re.fullmatch(r"(\d{1,9})(?:[x\u00d7](\d{1,9}))?", pixels.strip())
            if sides:
                pixels = [int(side or sides[1]) for side in sides.groups()]
        if not isinstance(pixels, Sequence) or isinstance(pixels, (str, bytes)):
            pixels = [pixels, pixels]  # type: ignore[list-item]
        found = [_whole(side, MOST_PIXELS) for side in pixels]
        if not all(found) or len(found) != 2:
            raise OpticsError(
                f"must be a whole number from 1 to {MOST_PIXELS}, or two such as 1920x1080, not "
                f"{given!r}", key="pixels",
            )  # fmt: skip
        return cls(*found)

    @property
    def longer(self) -> int:
        return max(self)

    @property
    def shorter(self) -> int:
        return min(self)

    @property
    def as_given(self) -> int | str:
        """The side of a square, else ``1920x1080``: as configurations and tables have it."""
        return self.width if self.width == self.height else repr(self)

    def scaled(self, longer: int) -> Size:
        """The size of the same shape whose longer side has so many pixels."""
        return Size(*(max(1, round(side * longer / self.longer)) for side in self))

    def camera(self, camera: Camera) -> Camera:
        """``camera`` with the sensor of the longer side, of one with that of the shorter side."""
        return replace(camera, sensor_width_m=camera.sensor_width_m * (self.longer / self.shorter))

    def __repr__(self) -> str:
        return f"{self.width}x{self.height}"

    def __str__(self) -> str:
        return f"{self.width} x {self.height}"


def whole_number(key: str, value: object, most: int) -> int:
    """``value``, which may be one of numpy's integers, as an int from 1 to ``most``."""
    found = _whole(value, most)
    if not found:
        raise OpticsError(f"must be a whole number from 1 to {most}, not {value!r}", key=key)
    return found


def _whole(value: object, most: int) -> int:
    """``value`` as an int from 1 to ``most``, else 0."""
    try:
        found = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return 0
    return found if not isinstance(value, bool) and 1 <= found <= most else 0

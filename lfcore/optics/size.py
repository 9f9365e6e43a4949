"""The size of pictures: width and height in square pixels."""

from __future__ import annotations

import operator
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera

MOST_PIXELS = 65536
"""The most pixels per side."""
Pixels = int | Sequence[int]
"""A parameter: the side of a square picture, or its width and height."""


class Size(NamedTuple):
    """Width and height of a picture.

    The camera's field of view is that of the shorter side, as in pbrt: a wide picture shows more on
    the left and on the right.
    """

    width: int
    height: int

    @classmethod
    def of(cls, pixels: Pixels | str) -> Size:
        """The size of ``512``, ``(1920, 1080)`` or ``"1920x1080"``."""
        parameter: object = pixels
        if isinstance(pixels, str):
            sides = re.fullmatch(r"(\d{1,9})(?:[x\u00d7](\d{1,9}))?", pixels.strip())
            if sides:
                pixels = [int(side or sides[1]) for side in sides.groups()]
        if not isinstance(pixels, Sequence) or isinstance(pixels, (str, bytes)):
            pixels = [pixels, pixels]  # type: ignore[list-item]
        size = [_whole(side, MOST_PIXELS) for side in pixels]
        if not all(size) or len(size) != 2:
            raise OpticsError(
                f"must be a whole number from 1 to {MOST_PIXELS}, or two such as 1920x1080, not "
                f"{parameter!r}", key="pixels",
            )  # fmt: skip
        return cls(*size)

    @property
    def longer(self) -> int:
        return max(self)

    @property
    def shorter(self) -> int:
        return min(self)

    @property
    def as_given(self) -> int | str:
        """The side of a square, else ``1920x1080``, as in configurations and tables."""
        return self.width if self.width == self.height else repr(self)

    def scaled(self, longer: int) -> Size:
        """The size of the same shape with another longer side."""
        return Size(*(max(1, round(side * longer / self.longer)) for side in self))

    def camera(self, camera: Camera) -> Camera:
        """Widen a camera's sensor from the shorter side of the picture to the longer."""
        return replace(camera, sensor_width_m=camera.sensor_width_m * (self.longer / self.shorter))

    def __repr__(self) -> str:
        return f"{self.width}x{self.height}"

    def __str__(self) -> str:
        return f"{self.width} x {self.height}"


def whole_number(key: str, value: object, most: int) -> int:
    """Convert a value, perhaps numpy's integer, to an int from 1 to ``most``."""
    number = _whole(value, most)
    if not number:
        raise OpticsError(f"must be a whole number from 1 to {most}, not {value!r}", key=key)
    return number


def _whole(value: object, most: int) -> int:
    """The value as an int from 1 to ``most``; 0 for any other value."""
    try:
        number = operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return 0
    return number if not isinstance(value, bool) and 1 <= number <= most else 0

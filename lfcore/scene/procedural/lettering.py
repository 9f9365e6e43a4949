"""Text in textures, with the typeface that Pillow carries, so that it is the same everywhere."""

from __future__ import annotations

import functools

import numpy as np
from PIL import Image, ImageDraw, ImageFont


@functools.cache
def _font(size: float):
    return ImageFont.load_default(size=size)


def write(
    picture: np.ndarray, text: str, centre: tuple[float, float], height: float, colour, *, turn=0
) -> np.ndarray:
    """A copy of (H, W, 3) uint8 ``picture`` with ``text`` on it.

    ``centre`` is (x, y) from the top left and ``height`` the letters' size, in pixels; ``turn``
    counts quarter turns counter-clockwise of the picture under the text.
    """
    image = Image.fromarray(np.ascontiguousarray(np.rot90(picture, -turn)))
    ImageDraw.Draw(image).text(
        centre, text, tuple(int(c) for c in colour), font=_font(float(height)), anchor="mm"
    )
    return np.rot90(np.array(image), turn).copy()


def blank_page(colour, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8 of one colour."""
    return np.broadcast_to(np.asarray(colour, np.uint8), (*size, 3)).copy()

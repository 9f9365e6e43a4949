"""Text in textures, with the typeface that Pillow carries, so that it is the same everywhere."""

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont


@functools.cache
def _font(size: float) -> ImageFont.ImageFont | ImageFont.FreeTypeFont:
    return ImageFont.load_default(size=size)


def write(
    picture: np.ndarray,
    text: str,
    centre: tuple[float, float],
    height: float,
    colour: Sequence[float],
    *,
    turn: int = 0,
) -> np.ndarray:
    """A copy of (H, W, 3) uint8 ``picture`` with ``text`` on it.

    ``centre`` is (x, y) from the top left and ``height`` the letters' size, in pixels; ``turn``
    counts quarter turns counter-clockwise of the picture under the text.
    """
    image = Image.fromarray(np.ascontiguousarray(np.rot90(picture, -turn)))
    ImageDraw.Draw(image).text(
        centre,
        text,
        (int(colour[0]), int(colour[1]), int(colour[2])),
        font=_font(float(height)),
        anchor="mm",
    )
    return np.rot90(np.array(image), turn).copy()


def blank_page(colour: ArrayLike, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8 of one colour."""
    return np.broadcast_to(np.asarray(colour, np.uint8), (*size, 3)).copy()

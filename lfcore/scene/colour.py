"""Colours of scene files: linear RGB lists, or ``"#rrggbb"`` in sRGB."""

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.scene.surface_mesh import Colour, triple


def parse_colour(value: str | list[float]) -> Colour:
    """A colour as the schema admits it, to linear RGB."""
    if isinstance(value, str):
        return hex_colour(value)
    return triple(value)


def hex_colour(code: str) -> Colour:
    """``"#rrggbb"``, sRGB, to linear RGB."""
    encoded = np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return triple(srgb_decode(encoded))

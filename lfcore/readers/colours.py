"""Colours of vertices and faces, in any of the types in which files have them."""

import numpy as np

from lfcore.colour import srgb_decode


def display_colours(values: np.ndarray) -> np.ndarray:
    """Linear light of display values: floats to 1, to 255 or to 65535, integers to the latter two,
    by the largest of them."""
    if values.dtype == np.int8:
        values = values.view(np.uint8)
    values = np.nan_to_num(values)
    largest = values.max(initial=0)
    most = 255.0 if largest <= 255 else 65535.0
    if values.dtype.kind == "f" and largest <= 1:
        most = 1.0
    return srgb_decode(np.asarray(values, np.float64) / most)

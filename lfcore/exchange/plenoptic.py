"""The raw picture of a plenoptic camera, with what calibrates it: a white image and its centres.

Pixels (u S, v T) to (u S + S - 1, v T + T - 1) lie behind microlens (u, v); pixel (s, t) of them is
of the view in column s and row t, so the picture is upright.  The main lens is round and
vignettes, in the raw picture as in the white one: the corners of every micro image are dark, and
the white image divided out gives the views again.  The centres stand beside the white image as
PlenoptiCam keeps them: ``mic_list`` of (y, x, row, column) in pixels, ``ptc_mean`` their pitch,
``pat_type`` ``rec`` for a rectangular grid.  Both pictures are PNG of 16 bits, linear in light.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.exchange.exporting import WriteOptions
from lfcore.exchange.grid import ExchangeError
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

FINE = 16
"""Points along a pixel's side that tell how much of it the lens lights."""


VIGNETTING = 0.9
"""What the rim of the main lens lacks of the light of its middle; between them it grows with the
square of the radius.  Micro images of even light have no middle that a calibration could find."""


def lit(samples: int) -> np.ndarray:
    """(N, N) float64: light of each pixel of a white micro image, of the brightest."""
    place = (np.arange(samples * FINE) + 0.5) / FINE - samples / 2
    radius2 = (place[:, None] ** 2 + place[None, :] ** 2) / (samples / 2) ** 2
    light = np.where(radius2 <= 1, 1 - VIGNETTING * radius2, 0.0)
    share = light.reshape(samples, FINE, samples, FINE).mean((1, 3))
    return share / share.max()


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    if source.columns != source.rows:
        raise ExchangeError(
            f"{source.columns} x {source.rows} views are no square micro images",
            file=source.field.path,
            key="--views",
        )
    count, width, height = source.columns, source.width, source.height
    share = lit(count)
    raw = np.empty((height * count, width * count, 3), np.uint16)
    for column, row, picture in source.views(options.progress):
        raw[row::count, column::count] = _codes(srgb_decode(picture) * share[row, column])
    white = _codes(np.tile(share, (height, width)))
    write_picture(folder / f"{source.name}_raw.png", raw)
    write_picture(folder / f"{source.name}_white.png", white)
    middle = (count - 1) / 2
    centres = [
        [row * count + middle, column * count + middle, row, column]
        for row in range(height)
        for column in range(width)
    ]
    data = {"pat_type": "rec", "ptc_mean": [float(count)] * 2, "mic_list": centres}
    write_json(folder / f"{source.name}_white.json", data)


def _codes(light: np.ndarray) -> np.ndarray:
    return np.rint(65535 * light.astype(np.float64)).astype(np.uint16)

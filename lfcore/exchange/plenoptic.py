"""The raw picture of a plenoptic camera, and its calibration: a white image and its centres.

Pixels (u S, v T) to (u S + S - 1, v T + T - 1) are behind microlens (u, v); among them, pixel (s,
t) belongs to the view in column s and row t, so the picture is upright.  The main lens is round
and vignettes, in the raw picture and in the white image: the corners of every micro image are
dark, and dividing by the white image restores the views.  The centres are beside the white image
in PlenoptiCam's form: ``mic_list`` of (y, x, row, column) in pixels, ``ptc_mean`` their pitch,
``pat_type`` ``rec`` for a rectangular grid.  Both pictures are PNG of 16 bits, linear in light.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.exchange.grid import ExchangeError, WriteOptions
from lfcore.exchange.source import Source
from lfcore.files import write_json
from lfcore.pictures import write_picture

FINE = 16
"""The points per pixel side at which the lens's light is sampled."""
VIGNETTING = 0.9
"""The share of light that the rim of the main lens loses; the loss grows with the square of the
radius.  A calibration finds no centre in micro images of even light."""


def lit(samples: int) -> np.ndarray:
    """(N, N) float64: the light of each pixel of a white micro image, relative to the brightest."""
    place = (np.arange(samples * FINE) + 0.5) / FINE - samples / 2
    radius2 = (place[:, None] ** 2 + place[None, :] ** 2) / (samples / 2) ** 2
    light = np.where(radius2 <= 1, 1 - VIGNETTING * radius2, 0.0)
    share = light.reshape(samples, FINE, samples, FINE).mean((1, 3))
    return share / share.max()


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    if source.columns != source.rows:
        raise ExchangeError(
            f"{source.columns} x {source.rows} views do not make square micro images",
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

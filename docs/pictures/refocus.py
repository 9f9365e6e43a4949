"""Draws refocus.webp, the moving picture of README.md, from one light field file.

lfcore record scenes/bike -o bike.mkv --pixels 400
python docs/pictures/refocus.py bike.mkv
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import lfcore
from lfcore.colour import srgb_codes

NEAR, FAR, COUNT = 2.2, 6.1, 20
"""Metres between which the focus moves, and pictures from one to the other."""


def main(file: str) -> None:
    distances = 1 / np.linspace(1 / NEAR, 1 / FAR, COUNT)
    pictures = lfcore.LightField.open(file).stack(distances.tolist())
    frames = [Image.fromarray(srgb_codes(picture)) for picture in pictures]
    frames += frames[-2:0:-1]
    # The ends rest for a second.
    durations = [1000 if k in (0, COUNT - 1) else 70 for k in range(len(frames))]
    out = Path(__file__).with_name("refocus.webp")
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=durations, loop=0,
                   quality=84, method=6, kmin=0, kmax=1)  # whole frames, no blocks  # fmt: skip


if __name__ == "__main__":
    main(sys.argv[1])

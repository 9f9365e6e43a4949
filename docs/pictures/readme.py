"""Draws the pictures of README.md: refocus.webp and viewer.png from one light field, and lit.webp.

python -m docs.pictures.readme
"""

import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

import lfcore
from docs.examples.sky import sky
from lfcore.colour import srgb_codes
from lfcore.pictures import write_picture
from tests.viewer.viewer_browser import chromium, visit

HERE = Path(__file__).parent
SCENES = HERE.parents[1] / "scenes"
LIT_PIXELS = 288
PIXELS, COUNT = 400, 20
"""Pixels of the light field, and pictures from its near end to its far end."""


def moving(field: lfcore.LightField) -> None:
    near, far = field.depth_range
    distances = 1 / np.linspace(1 / near, 1 / far, COUNT)
    frames = [Image.fromarray(srgb_codes(one)) for one in field.stack(distances.tolist())]
    frames += frames[-2:0:-1]
    # The ends rest for a second.
    durations = [1000 if k in (0, COUNT - 1) else 70 for k in range(len(frames))]
    frames[0].save(HERE / "refocus.webp", save_all=True, append_images=frames[1:],
                   duration=durations, loop=0, quality=84, method=6,
                   kmin=0, kmax=1)  # whole frames, no blocks  # fmt: skip


def lit(folder: Path) -> None:
    """A room lit through its window, a bicycle under a panorama, and a box with a lamp."""
    write_picture(folder / "sky.exr", sky())
    light = {"sky": {"file": str(folder / "sky.exr")}}
    scenes = [
        lfcore.load_scene(SCENES / "bedroom" / "window.yaml"),
        lfcore.load_scene(SCENES / "bike" / "sky.yaml", light=light),
        lfcore.load_scene(SCENES / "cornell"),
    ]
    row = []
    for number, scene in enumerate(scenes):
        file = folder / f"{number}.png"
        picture = lfcore.render(scene, pixels=LIT_PIXELS, quality=lfcore.Quality(42))
        write_picture(file, picture, roll_off=True)
        row.append(np.asarray(Image.open(file)))
    Image.fromarray(np.hstack(row)).save(HERE / "lit.webp", quality=88, method=6)


def screenshot(field: lfcore.LightField, folder: Path) -> None:
    field.viewer().save(folder / "bike.html")
    with chromium(folder / "profile", "--window-size=900,900", "--hide-scrollbars") as browser:
        visit(browser, folder / "bike.html")
        browser.save_screenshot(str(folder / "page.png"))
        high = browser.execute_script("return document.querySelector('main').offsetHeight")
    cv2.imwrite(str(HERE / "viewer.png"), cv2.imread(str(folder / "page.png"))[:high])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        made = lfcore.record(lfcore.load_scene("scenes/bike"), f"{name}/bike.mkv", pixels=PIXELS)
        lit(Path(name))
        moving(made)
        screenshot(made, Path(name))

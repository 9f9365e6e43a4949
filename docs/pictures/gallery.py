"""Draws a sheet of foreign models: of each the picture focused near, far, and in the browser.

python -m docs.pictures.gallery FOLDER OUT

Every mesh of FOLDER is recorded with default settings, refocused, and opened in the page of
``lfcore view``; OUT receives the light fields, the pages and gallery.webp.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import lfcore
from lfcore.colour import srgb_codes
from lfcore.pictures import contact_sheet
from tests.viewer.viewer_browser import chromium, pixels, visit

PIXELS, MODELS_PER_ROW = 128, 4
FOCI = ("near", "far")


def main(folder: str, out: str) -> None:
    models = sorted(Path(folder).iterdir(), key=lambda path: path.stem.lower())
    Path(out).mkdir(parents=True, exist_ok=True)
    pictures, labels = [], []
    with tempfile.TemporaryDirectory() as profile, chromium(Path(profile)) as browser:
        for model in models:
            scene = lfcore.load_scene(model)
            if any("z seems to be" in note.what for note in scene.notes):
                scene = lfcore.load_scene(model, up="z")  # as the note says
            field = lfcore.record(scene, Path(out) / f"{model.stem}.mkv", pixels=PIXELS)
            page = Path(out) / f"{model.stem}.html"
            field.viewer().save(page)
            visit(browser, page.resolve())
            pictures += [srgb_codes(field.refocus(focus)) for focus in FOCI] + [pixels(browser)]
            labels += [f"{model.stem}, {shown}" for shown in (*FOCI, "page")]
            print(labels[-1], *(note.what for note in scene.notes), sep=": ", flush=True)
    sheet = contact_sheet(np.stack(pictures), 3 * MODELS_PER_ROW, 2, labels)
    Image.fromarray(sheet).save(Path(out) / "gallery.webp", quality=80, method=6)


if __name__ == "__main__":
    main(*sys.argv[1:])

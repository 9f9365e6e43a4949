"""COLMAP's text model: one PINHOLE camera an image, so that principal points are exact.

World and cameras have x right, y down, z forward; rotations are none.  ``points3D.txt`` is empty.
"""

from __future__ import annotations

from pathlib import Path

from lfcore.exchange import pictures
from lfcore.files import write_text


def write(source, folder: Path, options) -> None:
    source.require_geometry("a COLMAP model")
    model = folder / "sparse" / "0"
    model.mkdir(parents=True)
    (folder / "images").mkdir()
    cameras = ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]"]
    images = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[]"]
    for column, row, picture in source.views(options.progress):
        name, number = f"view_{row:03d}_{column:03d}.png", row * source.columns + column + 1
        pictures.write(folder / "images" / name, picture)
        cx, cy = source.centre(column, row)
        lens = f"{source.focal_px:.12g} {source.focal_px:.12g} {cx:.12g} {cy:.12g}"
        cameras.append(f"{number} PINHOLE {source.width} {source.height} {lens}")
        x, y = -source.columns_m[column], -source.rows_m[row]
        images += [f"{number} 1 0 0 0 {x:.12g} {y:.12g} 0 {number} {name}", ""]
    for name, lines in (("cameras", cameras), ("images", images), ("points3D", ["# empty"])):
        write_text(model / f"{name}.txt", "\n".join(lines) + "\n")

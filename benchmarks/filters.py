"""How rays are best spread over pixels when a slab is sliced at another focus.

    python benchmarks/filters.py --scenes bike bedroom --views 16 32 --size 256 --out filters.csv

All views of a scene are traced, refocused on the scene's own focus distances with each filter, and
compared with the picture traced directly at that focus with 4096 rays a pixel (PSNR, sRGB-encoded).
A view moves by s pixels, and its neighbour by s + d:

    nearest    to the nearest whole pixel
    bilinear   shared by the two next pixels
    cell       spread evenly over [s - d/2, s + d/2], the extent of its cell of the lens
    staggered  to a whole pixel, rounded up at another threshold in each row of the lens (of 4)
    dithered   nearest, the threshold another in each pixel (of 8)
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from benchmarks.measured.rows import print_table, say, write_csv
from benchmarks.measured.scenes import Loaded
from lfcore.colour import srgb_encode
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_picture

FILTERS = ("nearest", "bilinear", "cell", "staggered", "dithered")


def thresholds(period: int) -> np.ndarray:
    """The van der Corput sequence in base 2: its first ``period`` members, in [0, 1)."""
    bits = period.bit_length() - 1
    return np.array([int(f"{k:0{bits}b}"[::-1], 2) for k in range(period)]) / period


def weights(name: str, shift: float, step: float, other: int) -> list[tuple[int, float]]:
    """(whole shift, share) of one column of the lens; ``other`` is the row's number."""
    if name == "bilinear":
        low = int(np.floor(shift))
        return [(low, 1 - (shift - low)), (low + 1, shift - low)]
    if name == "cell":
        left, right = shift - step / 2 - 1e-9, shift + step / 2 + 1e-9
        pixels = np.arange(int(np.floor(left + 0.5)), int(np.floor(right + 0.5)) + 1)
        shares = np.minimum(pixels + 0.5, right) - np.maximum(pixels - 0.5, left)
        return list(zip(pixels.tolist(), (shares / shares.sum()).tolist(), strict=True))
    threshold = thresholds(4)[other % 4] if name == "staggered" else 0.5
    return [(int(np.floor(shift + threshold)), 1.0)]


def refocused(views: np.ndarray, slab: Slab, plane: SensorPlane, name: str) -> np.ndarray:
    """(M, M, 3) of views (N, N, M, M, 3), linear light."""
    size, shifts, mask = slab.pixels, plane.shifts(slab), plane.mask(slab)
    step = abs(shifts[1] - shifts[0])
    total, count = np.zeros((size, size, 3)), np.zeros((size, size))
    pixels = np.arange(size)
    for j, i in np.argwhere(mask):
        if name == "dithered":
            move = thresholds(8)[pixels % 8]
            x, y = (pixels + np.floor(shifts[k] + move).astype(int) for k in (i, j))
            ins = (x >= 0) & (x < size), (y >= 0) & (y < size)
            at = np.ix_(y[ins[1]], x[ins[0]])
            np.add.at(total, at, views[j, i][ins[1]][:, ins[0]])
            np.add.at(count, at, 1.0)
            continue
        for dx, across in weights(name, shifts[i], step, j):
            for dy, down in weights(name, shifts[j], step, i):
                rows = slice(max(0, dy), min(size, size + dy))
                columns = slice(max(0, dx), min(size, size + dx))
                if rows.start >= rows.stop or columns.start >= columns.stop:
                    continue
                part = views[j, i][rows.start - dy : rows.stop - dy]
                part = part[:, columns.start - dx : columns.stop - dx]
                total[rows, columns] += across * down * part
                count[rows, columns] += across * down
    return total / np.maximum(count, 1e-9)[..., None]


def measure(loaded: Loaded, views: int, pixels: int) -> list[dict]:
    camera, rows = loaded.scene.camera, []
    slab = Slab(camera, views, pixels)
    grid = np.stack(np.meshgrid(np.arange(views), np.arange(views)), -1).reshape(-1, 2)
    parts = np.array_split(grid.astype(np.int32), -(-len(grid) // 64))
    traced = [loaded.tracer.bundle_radiance(bundles.views(slab, part)) for part in parts]
    light = np.clip(np.concatenate(traced), 0, 1).reshape(views, views, pixels, pixels, 3)
    for distance in loaded.scene.focus_distances_m:
        plane = SensorPlane(distance, camera.f_number)
        truth = trace_picture(loaded.tracer, camera, pixels, plane, views=64)
        shifts = plane.shifts(slab)
        row = {"scene": loaded.name, "N": views, "M": pixels, "focus_m": distance,
               "pixels_a_sample": float(abs(shifts[1] - shifts[0]))}  # fmt: skip
        for name in FILTERS:
            found = refocused(light, slab, plane, name)
            error = srgb_encode(np.clip(found, 0, 1)) - srgb_encode(np.clip(truth, 0, 1))
            row[name] = float(-10 * np.log10(np.mean(error**2)))
        say(", ".join(f"{key} {value}" for key, value in row.items()))
        rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "bedroom"])
    parser.add_argument("--views", nargs="+", type=int, default=[16, 32], help="N, at least 2")
    parser.add_argument("--size", type=int, default=256, help="M; default 256")
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    options = parser.parse_args()
    if min(options.views) < 2:
        parser.error("--views must be at least 2")
    rows = []
    for name in options.scenes:
        loaded = Loaded.open(name)
        for views in options.views:
            rows += measure(loaded, views, options.size)
    print_table(rows)
    write_csv(options.out, rows)


if __name__ == "__main__":
    main()

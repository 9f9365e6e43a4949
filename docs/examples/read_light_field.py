"""Read every ray of a light field file with PyAV and numpy alone, as docs/format.md describes."""

import json

import av
import numpy as np


def cells(order, columns, rows):
    """(column, row) of each frame's block, in the order of frames."""
    if order == "hilbert":
        if rows > columns:
            return [(x, y) for y, x in cells(order, rows, columns)]
        curve, half, side = [(0, 0)], 1, 1 << (rows - 1).bit_length()
        while half < side:
            curve = ([(y, x) for x, y in curve] + [(x, y + half) for x, y in curve]
                     + [(x + half, y + half) for x, y in curve]
                     + [(2 * half - 1 - y, half - 1 - x) for x, y in curve])  # fmt: skip
            half *= 2
        chain = [(x + k, y) for k in range(0, columns, side) for x, y in curve]
        return [(x, y) for x, y in chain if x < columns and y < rows]
    back = order == "serpentine"
    return [(columns - 1 - x if back and y % 2 else x, y)
            for y in range(rows) for x in range(columns)]  # fmt: skip


def rgb(frame, form):
    """(height, width, 3) float R'G'B' in [0, 1] of a decoded frame."""
    if form == "gbrp":  # FFV1 holds it as blue, green, red, 0
        plane = np.frombuffer(frame.planes[0], np.uint8).reshape(frame.height, -1)
        return plane[:, : 4 * frame.width].reshape(frame.height, -1, 4)[..., 2::-1] / 255
    bits = int(form[-4:-2]) if form.endswith("le") else 8
    kind, scale = np.dtype("<u2" if bits > 8 else "u1"), 2 ** (bits - 8)
    codes = [np.frombuffer(p, kind).reshape(p.height, -1)[:, : p.width] for p in frame.planes]
    y, cb, cr = (c if c.shape == codes[0].shape else c.repeat(2, 0).repeat(2, 1) for c in codes)
    y, cb, cr = (y / scale - 16) / 219, (cb / scale - 128) / 112, (cr / scale - 128) / 112
    red, blue = y + (1 - 0.2126) * cr, y + (1 - 0.0722) * cb
    return np.clip(np.stack([red, (y - 0.2126 * red - 0.0722 * blue) / 0.7152, blue], -1), 0, 1)


def read(path):
    """(metadata, rays): float32 [j, i, v, u, channel] R'G'B'; NaN for rays that are not there."""
    with av.open(str(path)) as file:
        about = json.loads(file.metadata["LIGHTFIELD"])
        if about["version"] > 2:
            raise ValueError(f"{path} is a film or has specular light, which this does not read")
        layout, frames = about["layout"], file.decode(video=0)
        n, m, pack, form = (layout[key] for key in ("views", "pixels", "pack", "pixel_format"))
        outer, inner = (n, n), tuple(layout.get("picture", (m, m)))[::-1]  # rows, columns
        if layout["kind"] == "macropixels":
            outer, inner = inner, outer
        slot = [side + side % 2 if "420" in form else side for side in inner]
        rays = np.full((*outer, *inner, 3), np.nan, np.float32)
        for column, row, columns, rows, _first, _count, _bytes, _crc in about["segments"]:
            for block in cells(layout["order"], -(-columns // pack), -(-rows // pack)):
                picture = rgb(next(frames), form)
                for y, x in np.ndindex(pack, pack):
                    a, b = block[0] * pack + x, block[1] * pack + y
                    if a < columns and b < rows:
                        part = picture[y * slot[0] :, x * slot[1] :]
                        rays[row + b, column + a] = part[: inner[0], : inner[1]]
    return about, rays if layout["kind"] == "views" else rays.transpose(2, 3, 0, 1, 4)

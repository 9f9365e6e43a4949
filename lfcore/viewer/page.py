"""The page: one HTML file with views, program and style, which works from disk."""

import base64
import html
import http.server
import json
import re
import zlib
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import StorageError, printable
from lfcore.files import write_text
from lfcore.opencl.device import Device, open_device
from lfcore.optics.slab import Slab
from lfcore.progress import Progress, part_of
from lfcore.refocus.free_views import inverse_depth
from lfcore.storage.lightfield import LightFieldFile
from lfcore.viewer.atlas import Atlas, Choice, choose, encode, read, read_disparities
from lfcore.viewer.disparity import estimate
from lfcore.viewer.neighbours import CODES, STEP_PX, Neighbours

HERE = Path(__file__).parent
SCRIPTS = ("optics.js", "neighbours.js", "drawing.js", "splatting.js", "film.js", "viewer.js")
COMMENT = re.compile(r"^\s*//[^\n]*\n|/\*\*.*?\*/|^\s+", re.DOTALL | re.MULTILINE)
MOST_PARALLAX = 0.08
"""The parallax over the lens if depths are unknown, relative to the picture's width."""
MAP_SIDE = 128
"""The most pixels per side of the depth map: a click is no finer."""
QUALITIES = (60, 75, 85, 92, 97)
"""The encoder's qualities, tried in this order."""
MOST_ERROR = 255**2 / 10**3.9
"""The largest mean square error of views' codes, 39 dB; a picture averages at least four views."""
MARGIN = 0.1
"""The margin beyond each end of the visible disparities, relative to their range."""
ESTIMATED = (
    "The file has no depth: a click focuses by an estimate from the views. The focus slider is "
    "exact."
)
STORED = "The file has depth: a click focuses exactly."
NO_MAP = "The file has no depth, and too few views to estimate it: focus with the slider."


@dataclass(frozen=True)
class ViewerPage:
    """A page for the browser; a notebook shows it in a frame."""

    html: str = field(repr=False)

    def save(self, path: str | Path) -> None:
        """Write the page; raises :class:`StorageError` if the file cannot be written."""
        write_text(path, self.html)

    def server(self, port: int = 0) -> http.server.ThreadingHTTPServer:
        """Serve the page to this machine alone; port 0 is any free port.

        Raises :class:`StorageError` for a port that cannot be used.
        """
        page = self.html.encode()

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(page)))
                self.end_headers()
                self.wfile.write(page)

            def log_message(self, format: str, *arguments: object) -> None:
                pass

        try:
            return http.server.ThreadingHTTPServer(("127.0.0.1", port), Handler)
        except (OSError, OverflowError) as error:
            problem = f"port {port} cannot be used: {getattr(error, 'strerror', None) or error}"
            remedy = "Name another port, or none"
            raise StorageError(problem, key="port", remedy=remedy) from None

    def _repr_html_(self) -> str:
        source = html.escape(self.html, quote=True)
        return (
            f'<iframe srcdoc="{source}" title="Light field" style="width: 100%; height: 640px; '
            'border: 0"></iframe>'
        )


def viewer_page(
    field: LightFieldFile,
    grid: int | None,
    pixels: int | None,
    format: str | None,
    jpeg_quality: int | None,
    device: Device | str | None,
    progress: Progress | None,
    *,
    film: bool = True,
) -> ViewerPage:
    """As :meth:`lfcore.LightField.viewer`."""
    device = device if isinstance(device, Device) else open_device(device)
    instants = [field.at(k) for k in range(len(field.times))] if film else [field]
    field, slab = instants[0], field.require_slab()
    choice = choose(field, grid, pixels, len(instants))
    ends = np.array([_range(each, slab) for each in instants])
    low, high = ends[:, 0].min(), ends[:, 1].max()
    played = None
    if field.metadata.depth:
        status, shown = STORED, []
        for number, each in enumerate(instants):
            tell = part_of(progress, number, len(instants))
            pictures = read(each, choice, device=device, progress=tell)
            shown.append(_instant(each, slab, choice, pictures, format or "webp", jpeg_quality))
        views = {"depth": shown[0]["depth"], "map": shown[0]["map"], "atlas": shown[0]["atlas"]}
        if len(instants) > 1:
            fps = (len(instants) - 1) / (field.times[-1] - field.times[0])
            keys = "depth", "map"
            played = {
                "fps": fps,
                "instants": [{key: each[key] for key in keys} for each in shown[1:]],
            }
    else:
        pictures = read(field, choice, device=device, progress=progress)
        places = np.stack(np.meshgrid(*_places(slab, choice)), -1).reshape(-1, 2)
        disparities = estimate(pictures, places, low * choice.scale, high * choice.scale)
        disparities = None if disparities is None else disparities / choice.scale
        status = NO_MAP if disparities is None else ESTIMATED
        atlas = encode(pictures, format or "jpeg", jpeg_quality or 90)
        seen = None if disparities is None else _map(disparities, (low, high))
        views = {"depth": None, "atlas": _coded(atlas), "map": seen}
    # The recorded focus, 0, is always in the range.
    low, high = min(low, 0.0), max(high, 0.0)
    margin = MARGIN * (high - low) or 1e-3
    data = _describe(field, slab, choice) | views | {
        "range": [low - margin, high + margin],
        "film": played,
    }  # fmt: skip
    # The program without comments and indentation.
    scripts = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS)
    program = '"use strict";\n' + COMMENT.sub("", scripts)
    parts = {
        "title": html.escape(printable(data["name"])),
        "style": (HERE / "viewer.css").read_text(encoding="utf-8"),
        "status": status,
        # "<" would end the script element.
        "field": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "script": base64.b64encode(zlib.compress(program.encode(), 9)).decode(),
    }
    template = (HERE / "page.html").read_text(encoding="utf-8")
    pieces = template.split("@")  # text and names by turns: the page itself has no other "@"
    pieces[1::2] = [parts[name] for name in pieces[1::2]]
    return ViewerPage("".join(pieces))


def _places(slab: Slab, choice: Choice) -> tuple[np.ndarray, np.ndarray]:
    """The positions of view columns and rows, in views from the middle of the lens."""
    column, row, *_ = slab.held.views
    middle = (slab.views - 1) / 2
    return choice.columns + column - middle, choice.rows + row - middle


def _describe(field: LightFieldFile, slab: Slab, choice: Choice) -> dict[str, Any]:
    columns, rows = _places(slab, choice)
    camera = slab.camera
    metric = {
        "delta": camera.delta,
        "step": slab.pixel_pitch / slab.lens_pitch_m,
        "focal": camera.focal_length_m,
        "pitch": slab.lens_pitch_m,
    }
    return {
        "name": str(field.metadata.scene.get("name") or field.path.stem),
        "file": field.path.name,
        "columns": columns.tolist(),
        "rows": rows.tolist(),
        "views": slab.views,
        "width": choice.width,
        "height": choice.height,
        "scale": choice.scale,
        "white": field.white,
        "peak": field.layout.peak or 0,
        "metric": metric if field.metric else None,
    }


def _instant(
    field: LightFieldFile,
    slab: Slab,
    choice: Choice,
    pictures: np.ndarray,
    format: str,
    quality: int | None,
) -> dict[str, Any]:
    """The page's data of views, depths and the map of disparities, of a file with depth."""
    inverse = inverse_depth(field, min(slab.pixels, MAP_SIDE))
    disparities = (inverse - slab.camera.delta) * (slab.lens_pitch_m / slab.pixel_pitch)
    views = _by_depth(field, slab, choice, pictures, format, quality)
    return views | {"map": _map(disparities, _range(field, slab))}


def _by_depth(
    field: LightFieldFile,
    slab: Slab,
    choice: Choice,
    pictures: np.ndarray,
    format: str,
    quality: int | None,
) -> dict[str, Any]:
    """The page's data of views and depths, coded as differences between neighbours."""
    stored = field.require_depth()
    disparities = read_disparities(field, choice).astype(float)
    low, high = float(disparities.min()), float(disparities.max())
    step = max(STEP_PX * len(choice.columns) / slab.views, (high - low) / (CODES - 1))
    i, j = choice.samples.T
    displaced = stored.views(slab).displacement[i + slab.views * j] * choice.scale
    count = round((high - low) / step) + 1
    views = Neighbours(*_places(slab, choice), displaced.round(6), low, step, count)
    codes, differences = views.coded_depth(disparities)
    grey = np.repeat((differences * (255 // max(count - 1, 1)))[..., None], 3, -1)
    atlas = encode(grey, "webp", 100)
    levels = views.levels()
    shown = slab.resized(stored.pixels).size
    size = [max(1, round(side * choice.scale)) for side in shown]
    gain, coded = _to_quality(views, pictures, codes, size, format, quality)
    depth = {
        "pages": _pages(atlas),
        "levels": [
            {"views": level} | _coded(each) for level, each in zip(levels, coded, strict=True)
        ],
        "gain": gain,
        "low": low,
        "step": step,
        "codes": count,
        "ends": [
            (end - slab.camera.delta) * slab.lens_pitch_m / slab.pixel_pitch * choice.scale
            for end in (stored.codes.far, stored.codes.near)
        ],
        "size": size,
        "displaced": views.displaced.tolist(),
    }
    return {"depth": depth, "atlas": {"pages": [], "across": atlas.across, "down": atlas.down}}


def _to_quality(
    views: Neighbours,
    pictures: np.ndarray,
    codes: np.ndarray,
    size: list[int],
    format: str,
    quality: int | None,
) -> tuple[int, list[Atlas]]:
    """Encode views; returns the divisor of differences, and the atlases.

    Without a quality it is the lowest that is good enough for the first views.
    """
    import cv2

    levels = views.levels()
    first = [view for level in levels[:2] for view, _ in level]
    for each in [quality] if quality else QUALITIES:
        gain = 1 if (format, each) == ("webp", 100) else 2
        coding = partial(encode, format=format, jpeg_quality=each)
        _, decoded = views.coded_colours(pictures, codes, coding, gain, levels[:2])
        errors = pictures[first] - decoded[first].astype(np.float32)
        shown = [cv2.resize(error, size, interpolation=cv2.INTER_AREA) for error in errors]
        if np.square(shown).mean() <= MOST_ERROR:
            break
    return gain, views.coded_colours(pictures, codes, coding, gain, levels)[0]


def _coded(atlas: Atlas) -> dict[str, Any]:
    return {"pages": _pages(atlas), "across": atlas.across, "down": atlas.down}


def _pages(atlas: Atlas) -> list[str]:
    return [f"data:{atlas.media};base64,{base64.b64encode(page).decode()}" for page in atlas.pages]


def _range(field: LightFieldFile, slab: Slab) -> tuple[float, float]:
    """The range of visible disparities, pixels of the file between neighbouring views."""
    step, delta = slab.pixel_pitch / slab.lens_pitch_m, slab.camera.delta
    if field.metric and field.seen_range:
        near, far = field.seen_range
        return (1 / far - delta) / step, (1 / near - delta) / step
    most = MOST_PARALLAX * max(field.picture_size) / max(slab.views - 1, 1)
    return max(-most, -delta / step) if field.metric else -most, most


def _map(disparities: np.ndarray, seen: tuple[float, float]) -> dict[str, Any]:
    """The page's disparity map, in codes of 8 bits."""
    low, high = seen
    codes = np.rint(255 * (disparities - low) / max(high - low, 1e-9)).clip(0, 255).astype(np.uint8)
    return {
        "page": _pages(encode(np.repeat(codes[None, ..., None], 3, -1), "webp", 100))[0],
        "width": disparities.shape[1],
        "height": disparities.shape[0],
        "low": low,
        "high": high,
    }

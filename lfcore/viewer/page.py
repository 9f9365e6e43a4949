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
from lfcore.refocus.free_views import FreeViews, inverse_depth
from lfcore.refocus.stored_views import read_own_views
from lfcore.storage.lightfield import LightFieldFile
from lfcore.viewer.atlas import Atlas, Choice, choose, encode, read, read_by_depth
from lfcore.viewer.disparity import estimate
from lfcore.viewer.neighbours import CODES, FIRST_CODE, STEP_PX, Neighbours

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
MIRRORS = " Where a surface shows another, a second click changes between the two."
IMAGES = (0.02, 0.98)
"""The quantiles of the depths of images in mirrors and glass that the slider reaches."""
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
    """As :meth:`lfcore.LightField.viewer`; without ``film`` the page shows one instant."""
    device = device if isinstance(device, Device) else open_device(device)
    instants = [field.at(k) for k in range(len(field.times))] if film else [field]
    field, slab = instants[0], field.require_slab()
    choice = choose(field, grid, pixels, len(instants))
    if field.metadata.depth:
        status = STORED + (MIRRORS if field.specular else "")
        shown, (low, high) = _shown_by_depth(
            instants, choice, format or "webp", jpeg_quality, device, progress
        )
    else:
        views, (low, high) = _shown_views(
            field, choice, format or "jpeg", jpeg_quality or 90, device, progress
        )
        shown, status = [views], ESTIMATED if views["map"] else NO_MAP
    played = None
    if len(shown) > 1:
        fps = (len(shown) - 1) / (field.times[-1] - field.times[0])
        played = {"fps": fps, "instants": shown[1:]}
    # The recorded focus, 0, is always in the range.
    low, high = min(low, 0.0), max(high, 0.0)
    margin = MARGIN * (high - low) or 1e-3
    data = _describe(field, slab, choice) | shown[0] | {
        "range": [low - margin, high + margin],
        "film": played,
    }  # fmt: skip
    # The program without comments and indentation.
    scripts = "\n".join((HERE / name).read_text(encoding="utf-8") for name in SCRIPTS)
    program = '"use strict";\n' + COMMENT.sub("", scripts)
    texts = {
        "title": html.escape(printable(data["name"])),
        "style": (HERE / "viewer.css").read_text(encoding="utf-8"),
        "status": status,
        # "<" would end the script element.
        "field": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "script": base64.b64encode(zlib.compress(program.encode(), 9)).decode(),
    }
    template = (HERE / "page.html").read_text(encoding="utf-8")
    pieces = template.split("@")  # text and names by turns: the page itself has no other "@"
    pieces[1::2] = [texts[name] for name in pieces[1::2]]
    return ViewerPage("".join(pieces))


def _shown_by_depth(
    instants: list[LightFieldFile],
    choice: Choice,
    format: str,
    jpeg_quality: int | None,
    device: Device,
    progress: Progress | None,
) -> tuple[list[dict[str, Any]], tuple[float, float]]:
    """The page's data of each instant of a file with depth, and the ends of its disparities."""
    slab = instants[0].require_slab()
    maps = [_disparities(each, slab) for each in instants]
    ends = [_range(each, slab, seen) for each, seen in zip(instants, maps, strict=True)]
    shown: list[dict[str, Any]] = []
    for number, (each, (seen, beside)) in enumerate(zip(instants, maps, strict=True)):
        tell = part_of(progress, number, len(instants))
        coded = [
            _by_depth(each, slab, choice, *part, format, jpeg_quality)
            for part in read_by_depth(each, choice, device=device, progress=tell)
        ]
        data, atlas = coded[0]
        shown.append({
            "depth": data,
            "specular": coded[1][0] if coded[1:] else None,
            "map": _map(seen, ends[number]),
            "beside": None if beside is None else _map(beside, ends[number]),
        })  # fmt: skip
        if not number:
            shown[0]["atlas"] = {"pages": [], "across": atlas.across, "down": atlas.down}
    return shown, (min(low for low, _ in ends), max(high for _, high in ends))


def _shown_views(
    field: LightFieldFile,
    choice: Choice,
    format: str,
    jpeg_quality: int,
    device: Device,
    progress: Progress | None,
) -> tuple[dict[str, Any], tuple[float, float]]:
    """The page's data of a file without depth, and the ends of its disparities."""
    slab = field.require_slab()
    pictures = read(field, choice, device=device, progress=progress)
    places = np.stack(np.meshgrid(*_places(slab, choice)), -1).reshape(-1, 2)
    low, high = _range(field, slab)
    estimated = estimate(pictures, places, low * choice.scale, high * choice.scale)
    seen = None if estimated is None else _map(estimated / choice.scale, (low, high))
    atlas = _coded(encode(pictures, format, jpeg_quality))
    views = {"depth": None, "specular": None, "atlas": atlas, "map": seen, "beside": None}
    return views, (low, high)


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


def _disparities(field: LightFieldFile, slab: Slab) -> tuple[np.ndarray, np.ndarray | None]:
    """The disparities (h, w) seen from the middle of the lens, of a file with depth.

    A pixel shows a surface and perhaps an image in it.  The first array has the disparity of the
    brighter one, the second array of the other; it is None if nothing is specular.
    """
    side, scale = min(slab.pixels, MAP_SIDE), slab.lens_pitch_m / slab.pixel_pitch
    surface = (inverse_depth(field, side) - slab.camera.delta) * scale
    if field.specular is None:
        return surface, None
    image = FreeViews(field, side, virtual=True).inverse_depth(np.zeros(2))
    image = (image - slab.camera.delta) * scale
    middle = np.full((1, 2), slab.views // 2)
    own, shown = (read_own_views(each, middle)[0].sum(-1) for each in (field, field.specular))
    v, u = (
        ((np.arange(count) + 0.5) * rays / count).astype(int)
        for count, rays in zip(surface.shape, own.shape, strict=True)
    )
    stronger = (shown > own)[v[:, None], u]
    return np.where(stronger, image, surface), np.where(stronger, surface, image)


def _by_depth(
    field: LightFieldFile,
    slab: Slab,
    choice: Choice,
    pictures: np.ndarray,
    disparities: np.ndarray,
    format: str,
    quality: int | None,
) -> tuple[dict[str, Any], Atlas]:
    """The page's data of views and depths, coded as differences between neighbours, and the
    depths' atlas.  Disparities that are NaN have the code 0."""
    stored, present = field.require_depth(), ~np.isnan(disparities)
    first = 0 if present.all() else FIRST_CODE
    seen = disparities[present]
    low, high = float(seen.min()), float(seen.max())
    step = max(STEP_PX * len(choice.columns) / slab.views, (high - low) / (CODES - 1 - first))
    ends = [
        (end - slab.camera.delta) * slab.lens_pitch_m / slab.pixel_pitch * choice.scale
        for end in (stored.codes.far, stored.codes.near)
    ]
    ends = [min(ends[0], low), max(ends[1], high)]  # images are beyond surfaces
    low -= first * step
    disparities = np.where(present, disparities, low).astype(float)
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
        "ends": ends,
        "size": size,
        "displaced": views.displaced.tolist(),
    }
    return depth, atlas


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


def _range(
    field: LightFieldFile, slab: Slab, seen: tuple[np.ndarray, np.ndarray | None] | None = None
) -> tuple[float, float]:
    """The range of visible disparities, pixels of the file between neighbouring views, with the
    images of which maps are ``seen``."""
    step, delta = slab.pixel_pitch / slab.lens_pitch_m, slab.camera.delta
    if field.metric and field.seen_range:
        near, far = field.seen_range
        low, high = (1 / far - delta) / step, (1 / near - delta) / step
        if seen and seen[1] is not None:
            surfaces, others = seen[0], seen[1]
            images = np.stack([surfaces, others])[:, surfaces != others]
            if images.size:
                ends = np.quantile(images, IMAGES)
                low, high = min(low, ends[0]), max(high, ends[1])
        return low, high
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

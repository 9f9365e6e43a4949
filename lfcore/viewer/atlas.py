"""Views of a light field side by side in few compact pictures, which a browser can load.

A *page* is one picture with a rectangle of cells, one view per cell.  The size of pages is limited
by the textures of graphics cards, their number by memory.
"""

import io
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from lfcore.colour import to_uint8
from lfcore.errors import StorageError, check_known
from lfcore.opencl.device import Device
from lfcore.optics.size import Pixels
from lfcore.progress import Progress, part_of
from lfcore.refocus.stored_depth import picture_side, read_depths
from lfcore.refocus.stored_views import read_own_views, read_views
from lfcore.refocus.two_parts import placed_parts
from lfcore.storage.lightfield import LightFieldFile

PAGE_SIDE = 4096
"""The most pixels per side of a page: all graphics cards of the last ten years have them."""
MOST_PIXELS = 80 << 20
"""The most pixels of all views together: 4 bytes each on the graphics card."""
READ_BYTES = 256 << 20
"""The bytes of linear light in memory at a time."""
VIEWS = 17
"""The default number of views per side."""
LEAST = 9
"""The least number of views per side: with fewer, moves are not smooth."""
MOST = 33
"""The most views per side: more do not fit in memory at a useful size."""
FORMATS = {"jpeg": "image/jpeg", "webp": "image/webp"}


@dataclass(frozen=True)
class Choice:
    """The views of a page.

    Attributes
    ----------
    columns, rows : ndarray
        The numbers of the views' columns and rows, ascending.
    width, height : int
        The views' size in the atlas.
    scale : float
        This size relative to the file's pictures.
    """

    columns: np.ndarray
    rows: np.ndarray
    width: int
    height: int
    scale: float

    @property
    def samples(self) -> np.ndarray:
        """The views (i, j), row by row: (K, 2) int32."""
        j, i = np.meshgrid(self.rows, self.columns, indexing="ij")
        return np.stack([i.ravel(), j.ravel()], 1)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """The shape of all pictures."""
        return len(self.columns) * len(self.rows), self.height, self.width, 3


@dataclass(frozen=True)
class Atlas:
    """Encoded pages of ``across`` x ``down`` cells, filled row by row with the views in order."""

    pages: list[bytes]
    media: str
    across: int
    down: int

    def decoded(self, shape: tuple[int, ...]) -> np.ndarray:
        """Decode the views, uint8 with ``shape`` (K, height, width, 3)."""
        from PIL import Image

        count, height, width, _ = shape
        cells = [
            np.asarray(Image.open(io.BytesIO(page)).convert("RGB"))
            .reshape(self.down, height, self.across, width, 3)
            .swapaxes(1, 2)
            .reshape(-1, height, width, 3)
            for page in self.pages
        ]
        return np.concatenate(cells)[:count]


def choose(
    field: LightFieldFile,
    grid: int | None = None,
    pixels: Pixels | None = None,
    instants: int = 1,
) -> Choice:
    """Choose a page's views: those in the middle of equal cells of the whole lens.

    ``grid`` is 9 to 33 views per side, by default 17.  ``pixels`` is the longer side, or width and
    height, by default as recorded and at most 512.  Views of all ``instants`` are in memory.
    """
    most_pixels = MOST_PIXELS // instants
    count = VIEWS if grid is None else grid
    if not LEAST <= count <= MOST:
        raise StorageError(f"must be from {LEAST} to {MOST}, not {count}", key="grid")
    columns, rows = (_cells(min(count, there), there) for there in field.grid)
    width, height = field.picture_size
    stored = field.metadata.depth
    # Views of a file with depth are finer than its pictures.
    longest = stored.pixels if stored else max(width, height)
    most = min(longest, PAGE_SIDE * longest // max(width, height))
    fits = math.isqrt(most_pixels * longest**2 // (len(columns) * len(rows) * width * height))
    side = max(1, min(most, 512, fits)) if pixels is None else picture_side(field, pixels)
    if not 1 <= side <= most:
        raise StorageError(f"must be from 1 to {most} pixels, not {side}", key="pixels")
    scale = side / longest
    width, height = max(1, round(width * scale)), max(1, round(height * scale))
    if len(columns) * len(rows) * width * height > most_pixels:
        raise StorageError(
            f"{len(columns)} x {len(rows)} views of {width} x {height} are too many for a browser",
            file=field.path, key="pixels", remedy="Give fewer views, or fewer pixels",
        )  # fmt: skip
    return Choice(columns, rows, width, height, scale)


def _cells(count: int, there: int) -> np.ndarray:
    return ((np.arange(count) * 2 + 1) * there // (2 * count)).astype(np.int32)


def read(
    field: LightFieldFile,
    choice: Choice,
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Read the chosen views, (K, height, width, 3) uint8, sRGB or PQ as in the file.

    They are resized in linear light.
    """
    samples, out = choice.samples, np.empty(choice.shape, np.uint8)
    for part, report in _some(field, choice, progress):
        light = read_views(field, samples[part], device=device, progress=report)
        out[part] = _codes(field, choice, light)
    return out


def _some(
    field: LightFieldFile, choice: Choice, progress: Progress | None
) -> Iterator[tuple[slice, Progress | None]]:
    """Some of the chosen views at a time, and what is told of their progress."""
    step = max(1, READ_BYTES // (12 * math.prod(field.picture_size)))
    starts = range(0, len(choice.samples), step)
    for number, start in enumerate(starts):
        yield slice(start, start + step), part_of(progress, number, len(starts))


def _codes(field: LightFieldFile, choice: Choice, light: np.ndarray) -> np.ndarray:
    """Light (K, H, W, 3) as the page's pictures."""
    import cv2

    if light.shape[1:3] != (choice.height, choice.width):
        size = choice.width, choice.height
        resized = [cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in light]
        light = np.stack([np.asarray(one) for one in resized])
    return to_uint8(field.layout.encoded(light))


def read_by_depth(
    field: LightFieldFile,
    choice: Choice,
    *,
    device: Device | None = None,
    progress: Progress | None = None,
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Read the chosen views of a file with depth, in one part or two, as they are sliced.

    A part has pictures, as of :func:`read`, and disparities (K, height, width) float32, in their
    pixels per view.  Disparities in mirrors and glass are those of the images.  The second part
    has the reflections of coats; its disparities are NaN where there is none.
    """
    slab, samples = field.require_slab(), choice.samples
    files = [field, *([field.specular] if field.specular else [])]
    depths = [read_depths(each, samples @ [1, slab.views]) for each in files]
    v, u = (
        ((np.arange(side) + 0.5) * rays / side).astype(int)
        for side, rays in ((choice.height, slab.size.height), (choice.width, slab.size.width))
    )
    scale = choice.scale * slab.lens_pitch_m / slab.pixel_pitch
    found = [(np.zeros(choice.shape, np.uint8), np.full(choice.shape[:3], np.nan, np.float32))
             for _ in files]  # fmt: skip
    for some, report in _some(field, choice, progress):
        parts = [
            (read_own_views(each, samples[some], device=device, progress=report), depth[some])
            for each, depth in zip(files, depths, strict=True)
        ]
        for (pictures, disparities), (light, depth) in zip(
            found, placed_parts(parts), strict=False
        ):
            pictures[some] = _codes(field, choice, light)
            near = depth[:, v[:, None], u]
            with np.errstate(divide="ignore"):
                disparities[some] = np.where(near > 0, 1 / near - slab.camera.delta, np.nan) * scale
    return found[:1] + [part for part in found[1:] if not np.isnan(part[1]).all()]


def encode(pictures: np.ndarray, format: str = "jpeg", jpeg_quality: int = 90) -> Atlas:
    """Encode pictures (K, height, width, 3) uint8 as pages.

    WebP halves the resolution of colours: views with coloured edges reach at most 30 dB.  At
    quality 100 it is lossless.
    """
    from PIL import Image

    check_known(StorageError, "format", format, FORMATS)
    if not 1 <= jpeg_quality <= 100:
        raise StorageError(f"must be from 1 to 100, not {jpeg_quality}", key="jpeg_quality")
    count, height, width, _ = pictures.shape
    across = max(1, min(PAGE_SIDE // width, math.ceil(math.sqrt(count * height / width)), count))
    down = min(PAGE_SIDE // height, math.ceil(count / across))
    own: dict[str, dict[str, Any]] = {
        "jpeg": {"subsampling": "4:4:4", "optimize": True},
        "webp": {"lossless": jpeg_quality == 100},
    }
    pages = []
    for start in range(0, count, across * down):
        part = pictures[start : start + across * down]
        cells = np.zeros((across * down, height, width, 3), np.uint8)
        cells[: len(part)] = part
        cells = cells.reshape(down, across, height, width, 3).transpose(0, 2, 1, 3, 4)
        data = io.BytesIO()
        image = Image.fromarray(cells.reshape(down * height, across * width, 3))
        image.save(data, format.upper(), quality=jpeg_quality, **own[format])
        pages.append(data.getvalue())
    return Atlas(pages, FORMATS[format], across, down)

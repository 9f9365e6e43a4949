"""The positions of a light slab's rays in video frames.

The *outer* grid of elements and the *inner* grid of rays of one element are, by kind,

    macropixels   outer: pixels (u, v), W x H      inner: lens samples (i, j), N x N
    views         outer: lens samples (i, j)       inner: pixels (u, v)

A frame holds a *block* of pack x pack neighbouring elements side by side.  A tile is a rectangle
of the outer grid; its frames, in scan order, are one video segment.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from functools import cached_property

import numpy as np

from lfcore.colour import floating, pq_decode, pq_encode, srgb_decode, srgb_encode
from lfcore.errors import StorageError, check_known
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.optics.size import Size
from lfcore.optics.slab import Slab
from lfcore.storage.pixels import PixelFormat, pixel_format

KINDS = ("macropixels", "views")
"""The kinds of layouts."""
LEAST_PQ_BITS = 10
"""The fewest bits per sample with PQ; with fewer, bands are visible."""
PQ_ONE = float(1 << 26)
"""The brightest PQ code in the fixed point of decoded frames."""
MOST_LIGHT = 1 << 16
"""The greatest peak, as a multiple of white."""
MOST_PER_SIDE = 65536
"""The most views and the most pixels per side, as in a slab."""
SMALLEST_FRAME = 16
"""The side, pixels, to which smaller frames are padded: some encoders refuse smaller ones, and all
pad to it internally."""


@dataclass(frozen=True)
class FrameLayout:
    """The positions of the rays of N x N views with M x M pixels in frames.

    Attributes
    ----------
    kind : str
        ``macropixels`` or ``views``.
    views, pixels : int
        N and M.
    order : str
        The scan order of frames within a tile: ``raster``, ``serpentine`` or ``hilbert``.
    pack : int
        The elements per side of a frame.
    pixel_format : str
        The format of frames.
    picture : (int, int), optional
        The width and height of pictures that are not square; the longer side is M.  Without it,
        frames have squares that contain a slab's pictures at the position of its extent.
    peak : float, optional
        The linear light of PQ's (SMPTE ST 2084) brightest code; without it codes are sRGB and clip
        at white.

    Raises
    ------
    StorageError
        Values that make no layout.
    """

    kind: str
    views: int
    pixels: int
    order: str = "serpentine"
    pack: int = 1
    pixel_format: str = "yuv420p"
    picture: tuple[int, int] | None = None
    peak: float | None = None

    def __post_init__(self) -> None:
        check_known(StorageError, "kind", self.kind, KINDS)
        check_known(StorageError, "order", self.order, ORDERS)
        for key in ("views", "pixels", "pack"):
            value = getattr(self, key)
            if not (isinstance(value, int) and not isinstance(value, bool) and value >= 1):
                raise StorageError(f"must be a positive integer, not {value!r}", key=key)
            if value > MOST_PER_SIDE:
                raise StorageError(f"must be at most {MOST_PER_SIDE}, not {value}", key=key)
        form = pixel_format(self.pixel_format)
        if self.peak is not None and not (
            isinstance(self.peak, int | float) and 1 <= self.peak <= MOST_LIGHT
        ):
            raise StorageError(f"must be from 1 to {MOST_LIGHT}, not {self.peak!r}", key="peak")
        if self.peak is not None and form.bits < LEAST_PQ_BITS:
            problem = f"has too few bits for PQ: {form.name}"
            remedy = "Use one of 10 or 12 bits, or the transfer srgb"
            raise StorageError(problem, key="pixel_format", remedy=remedy)
        if self.picture is not None:
            width, height = self.picture
            whole = type(width) is type(height) is int and min(width, height) >= 1
            if not whole or max(width, height) != self.pixels:
                problem = f"must be width and height, with a longer side of {self.pixels}"
                raise StorageError(problem, key="picture")
            object.__setattr__(self, "picture", None if width == height else (width, height))

    def corner(self, slab: Slab) -> tuple[int, int]:
        """Return the first pixel of the slab's pictures in the layout's; (0, 0) if both agree."""
        left, top = slab.held.pixels[:2]
        return (0, 0) if self.picture else (left, top)

    @property
    def size(self) -> Size:
        """The width and height of pictures in frames."""
        return Size(*(self.picture or (self.pixels, self.pixels)))

    @property
    def format(self) -> PixelFormat:
        return pixel_format(self.pixel_format)

    @property
    def outer(self) -> Size:
        """The columns and rows of the outer grid."""
        return self.size if self.kind == "macropixels" else Size(self.views, self.views)

    @property
    def inner(self) -> Size:
        """The columns and rows of the inner grid."""
        return Size(self.views, self.views) if self.kind == "macropixels" else self.size

    @property
    def packed(self) -> Size:
        """The columns and rows of elements in a frame."""
        return Size(*(min(self.pack, count) for count in self.outer))

    @property
    def elements_per_frame(self) -> int:
        return math.prod(self.packed)

    @property
    def slot(self) -> Size:
        """The width and height of an element in a frame, pixels; even for 4:2:0.

        Columns and rows from ``inner`` to ``slot`` are padding; they should repeat the last one.
        """
        step = self.format.subsampling
        return Size(*(-(-count // step) * step for count in self.inner))

    @property
    def frame_width(self) -> int:
        """The width of every frame, pixels; at least SMALLEST_FRAME."""
        return max(self.slot.width * self.packed.width, SMALLEST_FRAME)

    @property
    def frame_height(self) -> int:
        return max(self.slot.height * self.packed.height, SMALLEST_FRAME)

    @property
    def frame_bytes(self) -> int:
        return self.format.frame_bytes(self.frame_width, self.frame_height)

    @property
    def rays(self) -> int:
        return math.prod(self.outer) * math.prod(self.inner)

    def tile(self, column: int, row: int, columns: int, rows: int, index: int = 0) -> Tile:
        """Return the tile of a rectangle of the outer grid.

        Raises :class:`StorageError` unless it is inside and begins at a block's corner.
        """
        inside = 0 <= column < column + columns <= self.outer.width
        inside &= 0 <= row < row + rows <= self.outer.height
        if not inside or column % self.pack or row % self.pack:
            raise StorageError(
                f"the tile {columns} x {rows} at ({column}, {row}) does not fit an outer grid of "
                f"{self.outer} in blocks of {self.pack}",
                key="tile",
            )
        return Tile(self, index, column, row, columns, rows)

    def tiles(self, max_rays: int, *, least: int = 2, small_rays: int = 1 << 20) -> list[Tile]:
        """Cut the outer grid into tiles of at most ``max_rays`` rays, in raster order.

        If a row of blocks fits, tiles are whole rows, else parts of one row.  A tile has at least
        one block, however small ``max_rays`` is.  Tiles differ by at most one block per side, so
        that cores finish together.  More than ``small_rays`` rays make at least ``least`` tiles, if
        there are that many blocks.
        """
        across, down = (-(-count // self.pack) for count in self.outer)
        if self.rays <= small_rays:
            least = 1
        fit = max(1, max_rays // (self.elements_per_frame * math.prod(self.inner)))
        bands = -(-down // max(1, fit // across))
        pieces = -(-across // fit) if fit < across else 1
        if bands * pieces < least:
            bands = min(down, least)
            pieces = min(across, -(-least // bands))
        tiles: list[Tile] = []
        for top, bottom in _spans(down, bands, self.pack, self.outer.height):
            for left, right in _spans(across, pieces, self.pack, self.outer.width):
                tiles.append(self.tile(left, top, right - left, bottom - top, len(tiles)))
        return tiles

    def encoded(self, light: np.ndarray) -> np.ndarray:
        """Encode linear light as sRGB or PQ, in [0, 1]."""
        if self.peak is None:
            return srgb_encode(light)
        return pq_encode(floating(light) * floating(light).dtype.type(1 / self.peak))

    def decoded(self, codes: np.ndarray) -> np.ndarray:
        """Decode sRGB or PQ, in [0, 1], to linear light."""
        if self.peak is None:
            return srgb_decode(codes)
        return pq_decode(codes) * floating(codes).dtype.type(self.peak)

    @property
    def one(self) -> float:
        """The radiance 1 in the fixed point of decoded frames."""
        return FIXED_ONE if self.peak is None else PQ_ONE / self.peak

    @property
    def most_views(self) -> int:
        """The most views in this fixed point whose sum fits 32 bits."""
        return ((1 << 32) - 1) // int(FIXED_ONE if self.peak is None else PQ_ONE)

    @property
    def stops(self) -> int:
        """The whole stops above white up to the peak."""
        return math.ceil(math.log2(self.peak or 1))

    @property
    def defines(self) -> dict[str, int]:
        """The macros of programs that decode frames."""
        form = self.format
        return {
            "BITS": form.bits,
            "PQ": int(self.peak is not None),
        }

    def to_json(self) -> dict:
        """Return the fields; squares have no ``picture``, and sRGB has no ``peak``."""
        data = {key: value for key, value in asdict(self).items() if value is not None}
        return data | ({"picture": list(self.picture)} if self.picture else {})

    @classmethod
    def from_json(cls, data: dict) -> FrameLayout:
        """Raises :class:`StorageError` for unknown or missing keys and impossible values."""
        optional = {"picture", "peak"}
        known = {field.name for field in fields(cls)} - optional
        if not isinstance(data, dict) or set(data) - optional != known:
            raise StorageError(f"must have exactly the keys {sorted(known)}", key="layout")
        return cls(**data)


@dataclass(frozen=True)
class Tile:
    """A rectangle of the outer grid; ``index`` is its number among all tiles."""

    layout: FrameLayout
    index: int
    column: int
    row: int
    columns: int
    rows: int

    @property
    def element_count(self) -> int:
        return self.columns * self.rows

    @property
    def rays(self) -> int:
        return self.element_count * math.prod(self.layout.inner)

    @property
    def _block_grid(self) -> tuple[int, int]:
        pack = self.layout.pack
        return -(-self.columns // pack), -(-self.rows // pack)

    @property
    def frame_count(self) -> int:
        return math.prod(self._block_grid)

    @cached_property
    def _scan(self) -> np.ndarray:
        """The block (column, row) of each frame, (frame_count, 2) int32."""
        return ORDERS[self.layout.order](*self._block_grid)

    @cached_property
    def _frame_of_block(self) -> np.ndarray:
        """The frame of each block, (block rows, block columns) int32."""
        columns, rows = self._block_grid
        frames = np.empty((rows, columns), np.int32)
        frames[self._scan[:, 1], self._scan[:, 0]] = np.arange(self.frame_count, dtype=np.int32)
        return frames

    def elements(self) -> np.ndarray:
        """Return outer coordinates (column, row), (E, 2) int32, frame after frame in scan order.

        Within a frame they go row by row; slots outside the tile are left out.
        """
        pack = self.layout.pack
        slots = np.stack(np.divmod(np.arange(pack * pack, dtype=np.int32), np.int32(pack))[::-1], 1)
        cells = (self._scan[:, None] * np.int32(pack) + slots).reshape(-1, 2)
        if self.columns % pack or self.rows % pack:
            cells = cells[(cells[:, 0] < self.columns) & (cells[:, 1] < self.rows)]
        return cells + np.array([self.column, self.row], np.int32)

    def placement(self, elements: np.ndarray) -> np.ndarray:
        """Return (E, 3) int32 [frame within the tile, x0, y0] of outer coordinates (E, 2).

        (x0, y0) is the corner of the element's inner grid within the frame, in pixels.
        """
        local = np.asarray(elements, np.int32).reshape(-1, 2) - np.array(
            [self.column, self.row], np.int32
        )
        if local.size and (local.min() < 0 or (local >= [self.columns, self.rows]).any()):
            raise StorageError("elements are outside the tile", key="tile")
        block, slot = np.divmod(local, np.int32(self.layout.pack))
        out = np.empty((len(local), 3), np.int32)
        out[:, 0] = self._frame_of_block[block[:, 1], block[:, 0]]
        out[:, 1:] = slot * np.array(self.layout.slot, np.int32)
        return out

    def to_json(self) -> list[int]:
        return [self.column, self.row, self.columns, self.rows]


def _spans(blocks: int, parts: int, pack: int, outer: int) -> Iterator[tuple[int, int]]:
    """Yield ``parts`` nearly equal spans of blocks, in elements: (start, stop)."""
    cuts = [part * blocks // parts * pack for part in range(parts)] + [outer]
    yield from itertools.pairwise(cuts)


def raster(columns: int, rows: int) -> np.ndarray:
    """Scan row after row, each from the left, with a long step at the end of each row."""
    row, column = np.divmod(np.arange(columns * rows, dtype=np.int32), np.int32(columns))
    return np.stack([column, row], axis=1)


def serpentine(columns: int, rows: int) -> np.ndarray:
    """Scan every other row from the right: all steps have length one."""
    cells = raster(columns, rows)
    back = cells[:, 1] % 2 == 1
    cells[back, 0] = columns - 1 - cells[back, 0]
    return cells


def hilbert(columns: int, rows: int) -> np.ndarray:
    """Scan squares along the longer side, each by a Hilbert curve; cells outside are left out.

    All steps have length one if the shorter side is a power of two that divides the longer.
    """
    if rows > columns:
        return np.ascontiguousarray(hilbert(rows, columns)[:, ::-1])
    side = 1 << (rows - 1).bit_length()
    cells = _hilbert_square(side)
    squares = -(-columns // side)
    shift = np.zeros((squares, 1, 2), np.int32)
    shift[:, 0, 0] = np.arange(squares) * side
    chain = (cells[None] + shift).reshape(-1, 2)
    return chain[(chain[:, 0] < columns) & (chain[:, 1] < rows)]


def _hilbert_square(side: int) -> np.ndarray:
    """Return a square's curve from (0, 0) to (side - 1, 0), by copies and reflections of its
    quadrants' curves (Hilbert 1891)."""
    curve = np.zeros((1, 2), np.int32)
    half = 1
    while half < side:
        first = curve[:, ::-1]
        last = np.stack([2 * half - 1 - curve[:, 1], half - 1 - curve[:, 0]], axis=1)
        up, across = np.array([0, half], np.int32), np.array([half, half], np.int32)
        curve = np.concatenate([first, curve + up, curve + across, last]).astype(np.int32)
        half *= 2
    return curve


ORDERS = {"raster": raster, "serpentine": serpentine, "hilbert": hilbert}

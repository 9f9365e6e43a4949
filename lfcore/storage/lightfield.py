"""A light field on disk: open it, read views, macropixels and rectangles of rays.

The file alone is enough: geometry, layout and an index of segments are in its metadata.
"""

from bisect import bisect_left
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_codes, to_uint8
from lfcore.errors import OpticsError, StorageError
from lfcore.optics.array import CameraArray
from lfcore.optics.slab import Extent, Slab
from lfcore.storage.depth_stream import StoredDepth
from lfcore.storage.index import Segment
from lfcore.storage.layout import FrameLayout
from lfcore.storage.pixels import pixel_format
from lfcore.storage.stored_video import StoredVideo
from lfcore.storage.ycbcr import rgb_from_planes

CHUNK_BYTES = 4 << 20
"""Frames that are decoded before rays are taken out of them; as floats these are some 50 MB."""
FULL = {8: "yuv444p", 10: "yuv444p10le", 12: "yuv444p12le"}
"""Formats of as many bits whose chroma is not subsampled."""


class LightFieldFile(StoredVideo):
    """A light field file that was opened: its geometry, and its rays as views and macropixels."""

    def __repr__(self) -> str:
        (columns, rows), (width, height) = self.grid, self.picture_size
        size = f"{columns} x {rows} views of {width} x {height}"
        depth = ", with depth" if self.metadata.depth else ""
        return f"<{type(self).__name__} {str(self.path)!r}: {size}{depth}>"

    def __reduce__(self) -> tuple:
        """Pickled by path: the file is opened again where the pickle is loaded."""
        path = self.path.absolute() if isinstance(self.path, Path) else self.path
        again = partial(type(self).open, salvage=self._salvage, threads=self.threads)
        return again, (str(path),)

    @property
    def slab(self) -> Slab | None:
        """The slab; of a camera array that of the same rays, None where there is none."""
        return self.metadata.slab or (self.array.as_slab() if self.array else None)

    def require_slab(self) -> Slab:
        """The slab; :class:`OpticsError` for a camera array that is none."""
        if self.slab is None:
            problem = "holds a camera array that is no slab"
            raise OpticsError(problem, file=self.path, remedy="Use lfcore imgtool lightfield")
        return self.slab

    @property
    def displaced(self) -> bool:
        """Whether views are displaced within a pixel against one another, for slicing by depth."""
        depth = self.metadata.depth
        return depth is not None and depth.displaced

    def require_grid(self) -> Slab:
        """The slab, whose views see the same places of a pixel; :class:`OpticsError` for another.

        Raised for views that are displaced for slicing by depth, too.
        """
        if self.displaced:
            problem = "has views that are displaced within a pixel, for pictures by depth alone"
            remedy = "Use the filter 'depth', or record it with views that are not displaced"
            raise OpticsError(problem, file=self.path, remedy=remedy)
        return self.require_slab()

    def require_depth(self) -> StoredDepth:
        """What is known of the stream of depths; :class:`OpticsError` where there is none."""
        if self.metadata.depth is None:
            problem = "holds no depth"
            remedy = "Record it with depth, or use the filter 'nearest'"
            raise OpticsError(problem, file=self.path, key="filter", remedy=remedy)
        return self.metadata.depth

    def require_depth_video(self) -> StoredVideo:
        """The stream of depths; :class:`OpticsError` where there is none."""
        self.require_depth()
        assert self.depth_video is not None
        return self.depth_video

    @property
    def array(self) -> CameraArray | None:
        """The camera array; None for a slab."""
        return self.metadata.camera_array

    @property
    def white(self) -> float:
        """Linear light of the brightest code: 1, but for an array of brighter."""
        return self.metadata.white

    @property
    def extent(self) -> Extent:
        """The views and pixels that are there, of the smallest squares that hold them."""
        n, m = self.layout.views, self.layout.pixels
        slab = self.metadata.slab
        return slab.held if slab else Extent((0, 0, n, n), (0, 0, m, m))

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row of the first pixel in the layout's pictures."""
        slab = self.metadata.slab
        return self.layout.corner(slab) if slab else (0, 0)

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of views."""
        return self.extent.views[2:]

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of a view, pixels."""
        return self.extent.pixels[2:]

    @property
    def content(self) -> dict:
        """What else is known of the light field; see :class:`Metadata`."""
        return self.metadata.content

    @property
    def depth_range(self) -> tuple[float, float] | None:
        """The nearest and farthest depth seen, metres; None where it is not known."""
        found = self.content.get("depth_m")
        return tuple(found) if found else None

    @property
    def seen_range(self) -> tuple[float, float] | None:
        """The same without a floor that was put under a mesh."""
        found = self.content.get("seen_m")
        return tuple(found) if found else self.depth_range

    @property
    def metric(self) -> bool:
        """Whether lens, focus and distances are known; else only disparities mean something."""
        return bool(self.content.get("metric", True))

    def macropixel(self, u: int, v: int, *, codes: bool = False) -> np.ndarray:
        """Read the rays of the pixel in column ``u`` and row ``v``, through all lens samples.

        (N, N, 3), indexed [j, i]; otherwise as :meth:`rectangle`.
        """
        return self.rectangle(u, v, u + 1, v + 1, codes=codes)[0, 0]

    def view(self, i: int, j: int, *, codes: bool = False) -> np.ndarray:
        """Read the picture from the lens sample in column ``i`` and row ``j``.

        (M, M, 3), indexed [v, u]; otherwise as :meth:`views`.
        """
        return self.views(i, j, i + 1, j + 1, codes=codes)[0, 0]

    def views(self, i0: int, j0: int, i1: int, j1: int, *, codes: bool = False) -> np.ndarray:
        """Read a rectangle of views.

        Parameters
        ----------
        i0, j0, i1, j1 : int
            First column and row, and the column and row after the last.
        codes : bool
            Return the stored sRGB codes, of PQ those of the light that is not above white.

        Returns
        -------
        ndarray
            (j1 - j0, i1 - i0, M, M, 3), indexed [j, i, v, u]: float32 linear light, or uint8 codes.

        Raises
        ------
        StorageError
            The file does not hold these views, or is damaged.
        """
        *_, width, height = self.extent.pixels
        return self.block((i0, j0, i1, j1), (0, 0, width, height), codes=codes)

    def rectangle(self, u0: int, v0: int, u1: int, v1: int, *, codes: bool = False) -> np.ndarray:
        """Read the rays of a rectangle of pixels, through all lens samples.

        Parameters
        ----------
        u0, v0, u1, v1 : int
            First column and row, and the column and row after the last.
        codes : bool
            Return the stored sRGB codes, of PQ those of the light that is not above white.

        Returns
        -------
        ndarray
            (v1 - v0, u1 - u0, N, N, 3), indexed [v, u, j, i]: float32 linear light, or uint8 codes.
            Damaged segments are black if the file was opened to salvage.

        Raises
        ------
        StorageError
            The file does not hold these pixels, or is damaged.
        """
        *_, columns, rows = self.extent.views
        rays = self.block((0, 0, columns, rows), (u0, v0, u1, v1), codes=codes)
        return np.ascontiguousarray(rays.transpose(2, 3, 0, 1, 4))

    def block(self, lens: tuple, film: tuple, *, codes: bool = False) -> np.ndarray:
        """As :meth:`views`, of the rectangle of pixels ``film`` alone."""
        moved = []
        views, picture = self.extent.views, (*self.corner, *self.picture_size)
        for asked, held in ((lens, views), (film, picture)):
            (a, b, c, d), (column, row, columns, rows) = asked, held
            if not (0 <= a < c <= columns and 0 <= b < d <= rows):
                problem = f"({a}, {b}) to ({c}, {d}) lies outside the {columns} x {rows} recorded"
                raise StorageError(problem, file=self.path)
            moved.append((a + column, b + row, c + column, d + row))
        if self.layout.kind == "views":
            return self._read(*moved, codes=codes)
        return self._read(*moved[::-1], codes=codes).transpose(2, 3, 0, 1, 4)

    def _read(self, outer: tuple, inner: tuple, *, codes: bool) -> np.ndarray:
        """(outer rows, outer columns, inner rows, inner columns, 3) of two rectangles.

        Rectangles are (column0, row0, column1, row1), half open.
        """
        shape = (outer[3] - outer[1], outer[2] - outer[0], inner[3] - inner[1], inner[2] - inner[0])
        out = np.zeros((*shape, 3), np.uint8 if codes else np.float32)
        corner = np.array(outer[:2], np.int32)
        damaged = {damage.segment.index for damage in self.damage}
        for index in self.metadata.segments.meeting(*outer):
            if index in damaged:
                continue
            part = self.metadata.segments[index]
            if part.index not in self._checked:  # before a list is made of what may not be there
                self.check_segment(part.index)
            elements = part.tile.elements()
            inside = (elements >= corner).all(1) & (elements < outer[2:]).all(1)
            elements = elements[inside]
            places = part.tile.placement(elements)
            for frames, places_of, which in self._needed(part, places[:, 0]):
                column, line = (elements[which] - corner).T
                found = windows(self.layout, frames, places_of, places[which, 1:], inner)
                out[line, column] = self._read_codes(found) if codes else self.layout.decoded(found)
        return out if codes or self.white == 1.0 else out * np.float32(self.white)

    def _read_codes(self, found: np.ndarray) -> np.ndarray:
        """uint8 sRGB of what frames hold; light above white is cut."""
        layout = self.layout
        return to_uint8(found) if layout.peak is None else srgb_codes(layout.decoded(found))

    def _needed(
        self, part: Segment, numbers: np.ndarray
    ) -> Iterator[tuple[np.ndarray, np.ndarray, slice]]:
        """Decode the frames ``numbers`` (ascending), some at a time.

        Gives (frames of one chunk, index into them of each element, slice of ``numbers``).
        """
        wanted = np.unique(numbers)
        step = max(1, CHUNK_BYTES // self.layout.frame_bytes)
        held = slice(bisect_left(self._keys, part.first), bisect_left(self._keys, part.stop))
        keys = np.array([key - part.first for key in self._keys[held]] or [0])
        entry = keys[np.searchsorted(keys, wanted, side="right") - 1]
        # On through the frames between, unless a later key frame lets us skip some.
        for run in np.split(wanted, np.flatnonzero(entry[1:] > wanted[:-1] + 1) + 1):
            first = int(run[0])
            for chunk in self.frames(part.index, first, int(run[-1]) + 1, chunk=step):
                low, high = np.searchsorted(numbers, (first, first + len(chunk)))
                if low < high:
                    yield chunk, numbers[low:high] - first, slice(low, high)
                first += len(chunk)


def windows(
    layout: FrameLayout,
    frames: np.ndarray,
    which: np.ndarray,
    corners: np.ndarray,
    inner: tuple[int, int, int, int],
) -> np.ndarray:
    """(E, rows, columns, 3) float32 in [0, 1], encoded: the rectangle ``inner`` (column0, row0,
    column1, row1) of each of E elements, whose first pixels are ``corners`` of frames ``which``."""
    form = layout.format
    pictures = []
    for index, plane in enumerate(form.views(frames, layout.frame_width, layout.frame_height)):
        # Chroma is repeated over its 2 x 2 pixels, as refocusing does: the mean of a macropixel is
        # then what was stored, 4 dB nearer than interpolated, and nothing leaks between elements.
        step = form.subsampling if index else 1
        x, y = corners.T
        columns = (x[:, None] + np.arange(inner[0], inner[2])) // step
        rows = (y[:, None] + np.arange(inner[1], inner[3])) // step
        pictures.append(plane[which[:, None, None], rows[:, :, None], columns[:, None, :]])
    whole = pixel_format(FULL[form.bits]) if form.subsampling > 1 else form
    return rgb_from_planes(pictures, whole)

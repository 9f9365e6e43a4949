"""Slicing by depth: pictures from few rays, each spread over the area that its cell sweeps.

The rays of a lens cell of side ds that hit depth z are up to (1/d' - 1/z) ds apart on the plane
focused at d'.  A traced ray represents its cell: its light is spread over a box of that side, the
ray's *sweep*.  A few lens samples then fill the picture, where plain slicing leaves gaps.  Two
differences within a cell are neglected: colour that changes with direction, and occluders that hide
only a part of the cell.  The second is corrected between surfaces with different sweeps: light from
behind fills only the part of a pixel that nearer light has left.

Sources: Zwicker et al., "EWA Splatting", 2002 (splats by footprint); Lehtinen et al., "Temporal
Light Field Reconstruction for Rendering Distribution Effects", SIGGRAPH 2011 (reprojection by
depth); Soler et al., "Fourier Depth of Field", TOG 2009 (the number of samples).
`tests/refocus/slicing_reference.py` is the reference.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, cl, open_device, page_aligned
from lfcore.opencl.interface import record
from lfcore.opencl.kernel import Kernel
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import ViewSet
from lfcore.optics.size import Size
from lfcore.refocus.depth_program import (
    COARSE_PX,
    FILES,
    FULL_LAYERS,
    INTERFACE,
    MOST_BOUNDS,
    PATCH_COLUMNS,
    PATCH_ROWS,
    SLICING_ARGUMENTS,
    SQUARES,
)
from lfcore.refocus.lens_views import LensViews, colours_of
from lfcore.refocus.placed_views import PlacedViews
from lfcore.storage.depth_stream import DepthCodes

LEAST_OF_RAY = 0.5
"""The least side of a box, in distances between neighbouring rays of a view (measured in
docs/decisions.md)."""
LEAST_OF_ALL = 2.0
"""The least side of a box, in distances between neighbouring rays of all views together.  The less
of both sides counts (measured there)."""
LARGE_FROM = 2048
"""The longer side, pixels, of the smallest large picture.  In large pictures 4 x 4 rays share boxes
that are 32 rays wide, and sums of wide blur have pixels of 2 x 2."""
STRIPS_A_THREAD = 2
"""The least number of a picture's strips per thread, so that threads end together."""
STRIP_ROWS = 256
"""The most rows of a strip: views arrive some rows at a time."""
SUMS_BYTES = 1 << 33
"""The most bytes of sums at a time.  Few of a pixel's layers have light: about an eighth of the
bytes is written to, and a CPU allocates no memory for the rest."""
KERNELS = "add_rays", "compose", "join_rays"
"""The kernels, the last of which sums squares of rays for large pictures."""
MOST_RAYS_A_PIXEL = 1 << 20
"""The most rays per pixel whose sums fit in 32 bits."""

HeldRays = tuple[cl.Buffer, cl.Buffer, np.ndarray, np.ndarray | None]
"""Colours and depths of views on a device, the least and largest depth of each row, and the patches
that have rays, if some have none."""


def held_rays(device: Device, light: np.ndarray, depth: np.ndarray) -> HeldRays:
    """Copy rays to the device once for several slicers; arrays as in :meth:`DepthSlicer.add`."""
    ranges, present = depth_ranges(depth), present_patches(depth)
    light, depth = (np.ascontiguousarray(each, np.float32) for each in (light, depth))
    return device.shared(light), device.shared(depth), ranges, present


def present_patches(depth: np.ndarray) -> np.ndarray | None:
    """Which patches of PATCH_ROWS x PATCH_COLUMNS rays have a depth, (K, rows, columns) uint8; None
    if all rays have one."""
    if depth.all():
        return None
    _, rows, columns = depth.shape
    first = np.arange(0, rows, PATCH_ROWS), np.arange(0, columns, PATCH_COLUMNS)
    most = np.maximum.reduceat(np.maximum.reduceat(depth, first[1], axis=2), first[0], axis=1)
    return (most > 0).astype(np.uint8)


def depth_ranges(depth: np.ndarray) -> np.ndarray:
    """The least and the largest depth of each row, (K, rows, 2) float32; 0 is no depth, and rows
    without depths have infinity and 0."""
    least, most = depth.min(axis=2), depth.max(axis=2)
    if not least.all():
        least = np.where(depth > 0, depth, np.inf).min(axis=2)
    return np.stack([least, most], -1).astype(np.float32)


def code_ranges(codes: np.ndarray, table: np.ndarray) -> np.ndarray:
    """As :func:`depth_ranges`, of codes whose depths are ``table``, from far to near; the last of
    them may be no depths."""
    least, most, count = codes.min(axis=2), codes.max(axis=2), np.count_nonzero(table)
    if count < len(table):
        most = np.where(codes < count, codes, 0).max(axis=2)
    return np.stack([table[most], table[least]], -1)


def planes_at_a_time(device: Device, planes: Sequence[SensorPlane], size: Size, stops: int) -> int:
    """The number of these pictures that are formed at a time."""
    most = min(SUMS_BYTES, device.device.max_mem_alloc_size, device.device.global_mem_size // 2)
    return max(1, most * len(planes) // DepthSlicer.sums_bytes(planes, size, stops))


def sheets_of(planes: Sequence[SensorPlane]) -> int:
    """The number of a picture's sums: one of all colours, and one each if a lens parts them."""
    colours = colours_of(planes)
    return colours + 1 if colours > 1 else 1


class DepthSlicer:
    """Forms pictures from rays whose depth is known.

    Parameters
    ----------
    views : ViewSet
        The rays.
    planes : sequence of SensorPlane
        The pictures.
    pixels : int
        The pictures' longer side.
    device : Device, optional
        Default: the default device.
    bounds_px : sequence of float, optional
        Sweeps between layers.  Default: :func:`layer_bounds` of each plane.
    stops : int
        Stops above white of the brightest ray.
    codes : DepthCodes, optional
        The codes of a file's depths, for :meth:`add_stored`.  Default: rays are traced.
    one : float
        Radiance 1 in a file's fixed-point views.
    empty : float
        The radiance of pixels without rays.
    """

    def __init__(
        self,
        views: ViewSet,
        planes: Sequence[SensorPlane],
        pixels: int,
        device: Device | None = None,
        *,
        bounds_px: Sequence[float] | None = None,
        stops: int = 0,
        codes: DepthCodes | None = None,
        one: float = FIXED_ONE,
        empty: float = 0.0,
    ):
        for plane in planes:
            plane.check(views.slab)
            plane.check_pixels(pixels)
        slab = views.slab
        self.left, self.top, width, height = slab.picture(pixels)
        self.size = Size(width, height)
        if (rays := slab.rays / math.prod(self.size)) > MOST_RAYS_A_PIXEL:
            raise OpticsError(
                f"{rays:,.0f} rays per pixel are more than {MOST_RAYS_A_PIXEL:,}",
                remedy="Give fewer views, or more pixels",
            )
        self.views, self.planes = views, list(planes)
        self.device = device or open_device()
        self._behind_lens = any(plane.lens for plane in planes)
        self._colours, self._sheets = colours_of(planes), sheets_of(planes)
        placed = [self._place(plane, pixels, bounds_px, long_sums=stops > 0) for plane in planes]
        self._placed = placed
        bounds, large = len(placed[0].bounds_px), pixels >= LARGE_FROM
        coarse = any(each.step > COARSE_PX for each in placed)
        fours = large and not coarse
        defines: dict[str, Any] = {
            "N_BOUNDS": bounds, "LONG_SUMS": stops > 0, "COARSE": coarse,
            "FOURS": fours, "HALVED": large, "STORED": codes is not None,
            "LENS": self._behind_lens, "COLOURS": self._colours,
        }  # fmt: skip
        self._table = np.ones(1, np.float32) if codes is None else codes.table
        self._codes = np.zeros((0, 0, 0), self._table.dtype)
        if codes is not None:
            code = "uchar" if codes.format.bits == 8 else "ushort"
            defines |= {"CODE": code, "LIGHT_ONE": one}
        kernels = [
            Kernel(self.device, FILES, name, defines, INTERFACE) for name in KERNELS[: 2 + fours]
        ]
        self._add, self._compose, *self._join = kernels
        self._fours = self.device.empty(0)
        strips = STRIPS_A_THREAD * self.device.threads
        rows = min(STRIP_ROWS, -(-self.size.height // min(strips, self.size.height)))
        rows += rows % 2 * large
        dropped = max(0, stops - math.floor(math.log2(MOST_RAYS_A_PIXEL / rays)))
        self._numbers = record(
            SLICING_ARGUMENTS, views=0, columns=slab.size.width, rows=0, first_row=0,
            strip_rows=rows, width=width, height=height, white=2.0**-dropped,
            brightest=2.0**stops, empty=empty, parts=1, sparse=0,
            axis_x=pixels / 2 - self.left, axis_y=pixels / 2 - self.top,
            least_box=min(LEAST_OF_RAY, LEAST_OF_ALL / slab.views) * pixels / slab.pixels,
        )  # fmt: skip
        self._strips = -(-self.size.height // rows)
        self._view_records = np.stack([each.view_records for each in placed])
        self._planes = self.device.buffer(np.stack([each.plane_record for each in placed]))
        size = self.sums_bytes(planes, self.size, stops, bounds, rows)
        self._sums = self.device.zeros(size, sparse=True)
        self._used = self.device.zeros(4 * len(planes) * self._sheets * self._strips)

    def _place(
        self, plane: SensorPlane, pixels: int, bounds_px: Sequence[float] | None, *, long_sums: bool
    ) -> PlacedViews:
        """The views on a plane; parameters are as for :class:`PlacedViews`."""
        if not self._behind_lens:
            return PlacedViews(self.views, plane, pixels, bounds_px, long_sums=long_sums)
        return LensViews(
            self.views, plane, pixels, bounds_px, long_sums=long_sums, colours=self._colours
        )

    @property
    def bounds_px(self) -> list[tuple[float, ...]]:
        """The sweeps between the layers of each plane."""
        return [placed.bounds_px for placed in self._placed]

    @staticmethod
    def sums_bytes(
        planes: Sequence[SensorPlane], size: Size, stops: int, bounds: int = MOST_BOUNDS,
        rows: int | None = None,
    ) -> int:  # fmt: skip
        """The bytes of the sums, in strips of ``rows``; by default one strip."""
        rows = rows or size.height
        whole = min(bounds, FULL_LAYERS) if size.longer >= LARGE_FROM else bounds
        large = 2 * min(bounds, 2) - 1 if bounds and any(plane.lens for plane in planes) else 0
        pixels = (2 * whole + 1 + large) * (rows + 1) * (size.width + 1)
        pixels += 2 * (bounds - whole) * (-(-rows // 2) + 3) * (-(-size.width // 2) + 3)
        sheets = len(planes) * sheets_of(planes)
        return sheets * -(-size.height // rows) * pixels * (32 if stops else 16)

    def add(
        self, part: slice | np.ndarray, light: np.ndarray, depth: np.ndarray, first_row: int = 0
    ) -> None:
        """Add rows of some views.

        Parameters
        ----------
        part : slice or ndarray
            The views' numbers i + N j.
        light : ndarray
            (K, rows, columns, 3) float32 linear radiance, clipped at ``2 ** stops``.
        depth : ndarray
            (K, rows, columns) float32, metres, infinity for a miss, 0 for rays to leave out.
        first_row : int
            The first of them, a multiple of PATCH_ROWS.
        """
        views, rows, columns = depth.shape
        size, fits = self.views.slab.size, light.shape == (*depth.shape, 3)
        fits = fits and (views, columns) == (len(self.views.positions[part]), size.width)
        if not fits or first_row + rows > size.height:
            raise ValueError(f"shapes {light.shape} and {depth.shape} are not the views'")
        self.add_held(part, *held_rays(self.device, light, depth), first_row=first_row)

    def add_stored(
        self, part: np.ndarray, light: cl.Buffer, codes: np.ndarray, first_row: int = 0
    ) -> None:
        """Add rows of a file's views, as :meth:`add` does.

        ``light`` has (K, 3, rows, columns) uint32 in fixed point, ``codes`` (K, rows, columns).
        """
        if self._codes.shape != codes.shape:  # kept: drivers are slow with unaligned memory
            self._codes = page_aligned(codes.shape, codes.dtype.type)
        self._codes[:] = codes
        ranges = code_ranges(codes, self._table)
        self.add_held(part, light, self.device.shared(self._codes), ranges, first_row=first_row)

    def add_held(
        self, part: slice | np.ndarray, light: cl.Buffer, depth: cl.Buffer, ranges: np.ndarray,
        present: np.ndarray | None = None, *, first_row: int = 0,
    ) -> None:  # fmt: skip
        """As :meth:`add`, with :func:`held_rays`."""
        device, (views, rows, _) = self.device, ranges.shape
        if first_row % PATCH_ROWS:
            raise ValueError(f"row {first_row} is no multiple of {PATCH_ROWS}")
        numbers = self._numbers.copy()
        numbers["views"], numbers["rows"], numbers["first_row"] = views, rows, first_row
        numbers["sparse"] = present is not None
        rays: dict[str, Any] = {
            "light": light,
            "depth": depth,
            "dioptres": device.buffer(1 / self._table),
        }
        for join in self._join:
            patches = -(-rows // PATCH_ROWS), -(-int(numbers["columns"]) // PATCH_COLUMNS)
            size = views * math.prod(patches) * SQUARES.itemsize
            if size > self._fours.size:
                self._fours = device.empty(size)
            join(patches[0], views, numbers=numbers, fours=self._fours, **rays)
        grids = [each.nodes for each in self._placed if each.nodes is not None]
        self._add(
            self._strips, len(self.planes), numbers=numbers, fours=self._fours,
            present=None if present is None else device.buffer(present),
            ranges=device.buffer(ranges), planes=self._planes, sums=self._sums, used=self._used,
            views=device.buffer(np.ascontiguousarray(self._view_records[:, part])),
            lens=device.buffer(np.stack([nodes[part] for nodes in grids])) if grids else None,
            **rays,
        )  # fmt: skip
        device.queue.finish()

    def pictures(
        self, shown: "DepthSlicer | None" = None, reflections: np.ndarray | None = None,
        *, vignetted: bool = True,
    ) -> np.ndarray:  # fmt: skip
        """(P, height, width, 3) float32, linear light, of all rays; the sums are lost.

        A pixel is divided by the weight of its rays.  With ``normalise='lens'`` the picture then
        dims as the lens stops down.  Pixels without rays are ``empty``.  ``reflections``
        (P, height, width, 3) are added where ``shown``, which has some of the rays, covers the
        picture.  Without ``vignetted``, a lens from a file does not darken the picture.
        """
        device, numbers = self.device, self._numbers.copy()
        numbers["parts"] = 1 if shown is None else 2
        pictures = page_aligned((len(self.planes), *self.size[::-1], 3))
        shape = len(self.planes), self._sheets * self._strips
        with device.mapped(self._used, shape, np.int32) as used:
            layers = np.bitwise_or.reduce(used, axis=1).tolist()
        for number, (picture, placed) in enumerate(zip(pictures, self._placed, strict=True)):
            rooms, room_rows = placed.rooms(layers[number])
            target = device.target_buffer(picture)
            self._compose(
                self._strips, 1, offset=(0, number), numbers=numbers, sums=self._sums,
                used=self._used, rooms=device.shared(rooms), room_rows=device.shared(room_rows),
                picture=target, shown=shown and shown._sums, shown_used=shown and shown._used,
                reflections=None if reflections is None else device.shared(reflections[number]),
            )  # fmt: skip
            device.collect(target, picture)  # rooms are kept until the kernel has run
            device.forget(self._sums, number, len(self.planes))
            plane = placed.plane
            if vignetted and placed.illumination is not None:
                picture *= placed.illumination
            if plane.normalise == "lens":
                picture *= placed.cells.share.mean() / plane.magnification(self.views.slab) ** 2
        return pictures

"""Slicing by depth: pictures from few rays, each spread over what its cell sweeps.

A ray of lens cell ds that meets depth z stands for rays that fall (1/d' - 1/z) ds apart on the
plane focused at d'.  Spread over a box of that side, a few samples of the lens give what all of it
would, where slicing leaves gaps.  What the cell as a whole sees is neglected in two ways: that
colour changes with direction, and that what hides a surface may hide part of its cell.  The second
is made good between surfaces of unlike sweep: light from behind adds to a pixel only what nearer
light has left of it.

Zwicker et al. ("EWA Splatting", 2002) splat surfaces by their footprint; Lehtinen et al. ("Temporal
Light Field Reconstruction for Rendering Distribution Effects", SIGGRAPH 2011) reproject sparse
samples by their depth; Soler et al. ("Fourier Depth of Field", TOG 2009) say how many are needed.
`lfcore.oracle.depth_slicing` is the reference.
"""

import math
from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, build_program, cl, open_device, page_aligned
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import LensCells, ViewSet, lens_cells
from lfcore.optics.size import Size
from lfcore.storage.depth_stream import DepthCodes

IN_FOCUS_PX, WIDE_PX = 0.5, 2.0
"""Sweeps, pixels of the picture, up to which rays are in focus, and from which blur is wide."""
WIDE_LAYERS = 5
"""Layers of wide blur before the plane, and behind it: measured, docs/notebook/true-picture.md."""
LEAST_OF_RAY, LEAST_OF_ALL = 0.5, 2.0
"""Least side of a box: of the distance between neighbouring rays of a view, and of all views
together where they are in focus, whichever is less: measured there."""
COARSE_PX = 1.25
"""The largest pixel of a view, in pixels of the picture, whose weave a pixel averages away."""
LARGE_FROM = 2048
"""Pixels of a picture's longer side from which 4 x 4 rays share boxes 32 rays wide, of which
smaller pictures have few, and sums of wide blur have pixels of 2 x 2."""
FULL_LAYERS = 3
"""Layers before the plane, and behind it, whose sums have all pixels in large pictures: with one
fewer, pictures lose up to 3 dB."""
TILE_ROWS, TILE_COLUMNS, TILE_BYTES = 4, 64, 6 * 64
"""Rays that the kernel joins to squares at a time, and the memory of these."""
STRIPS_A_THREAD, STRIP_ROWS = 2, 256
"""Strips of a picture at least, and rows of one at most: views come some rows at a time."""
SUMS_BYTES = 1 << 33
"""Sums of the planes that are formed at a time.  About an eighth is written to, for a pixel has few
of the layers; what is not written to takes no memory of a CPU."""
MOST_RAYS_A_PIXEL = 1 << 20
LONG_RAY_BITS, SUM_BITS = 40, 29
"""Of a ray in sums of 64 bits, where light above white takes bits that rays leave, or its last
ones; and of all rays of a pixel in sums of 32 bits, which hold eight times as much."""

HeldRays = tuple[cl.Buffer, cl.Buffer, np.ndarray]
"""Colours and depths of views on a device, and the least and most depth of each row."""


def held_rays(device: Device, light: np.ndarray, depth: np.ndarray) -> HeldRays:
    """Rays as of :meth:`DepthSlicer.add`, for several slicers."""
    ranges = np.stack([depth.min(axis=2), depth.max(axis=2)], -1).astype(np.float32)
    light, depth = (np.ascontiguousarray(each, np.float32) for each in (light, depth))
    return device.shown(light), device.shown(depth), ranges


def layer_bounds(widest_px: float) -> tuple[float, ...]:
    """Sweeps that part the layers before a plane and behind it, where infinity's is ``widest_px``.

    From layer to layer they double; by more where pictures have so many pixels that the last begins
    below half of the widest.
    """
    last = WIDE_LAYERS - 1
    ratio = max(2.0, (widest_px / 2 / WIDE_PX) ** (1 / last))
    return (IN_FOCUS_PX, *(WIDE_PX * ratio**number for number in range(WIDE_LAYERS)))


def typical_sweep(bounds_px: Sequence[float], away: int) -> float:
    """A layer's typical sweep, by its number from the plane; 0 where rays are hardly spread."""
    if away < 2:
        return 0.0
    ends = *bounds_px, 2 * bounds_px[-1]
    return math.sqrt(ends[away - 1] * ends[away])


def planes_at_a_time(device: Device, size: Size, stops: int) -> int:
    """How many pictures of that size are formed at a time."""
    most = min(SUMS_BYTES, device.device.max_mem_alloc_size, device.device.global_mem_size // 2)
    return max(1, most // DepthSlicer.sums_bytes(1, size, stops))


class DepthSlicer:
    """Forms ``planes`` of ``pixels`` on the longer side from rays of ``views`` with known depth.

    ``bounds_px`` are as for the reference, by default :func:`layer_bounds`; ``stops`` those above
    white of the brightest ray.  ``codes`` are of depths, and ``one`` is radiance 1 in fixed point,
    where rays of a file are added (:meth:`add_stored`) and not traced ones.
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
    ):
        for plane in planes:
            plane.check(views.slab)
            plane.check_pixels(pixels)
        slab = views.slab
        self.left, self.top, width, height = slab.picture(pixels)
        self.size = Size(width, height)
        if (rays := slab.rays / math.prod(self.size)) > MOST_RAYS_A_PIXEL:
            raise OpticsError(
                f"{rays:,.0f} rays a pixel are more than {MOST_RAYS_A_PIXEL:,}",
                remedy="Trace fewer, or ask for more pixels",
            )
        self.views, self.planes, self.pixels = views, list(planes), pixels
        self.device = device or open_device()
        self.least_px = min(LEAST_OF_RAY, LEAST_OF_ALL / slab.views) * pixels / slab.pixels
        self._table = np.ones(1, np.float32) if codes is None else codes.table
        self._codes = np.zeros((0, 0, 0), self._table.dtype)
        self._cells = [self._cells_of(plane) for plane in self.planes]
        self._ones = [self._one(*each, stops) for each in zip(planes, self._cells, strict=True)]
        self._records = self._cell_records()
        self.bounds_px = [
            layer_bounds(plane.delta * self._scale(plane) * slab.lens_pitch_m)
            if bounds_px is None else tuple(bounds_px)
            for plane in self.planes
        ]  # fmt: skip
        bounds = len(self.bounds_px[0])
        coarse = any(self._step(plane) > COARSE_PX for plane in self.planes)
        large = pixels >= LARGE_FROM
        fours = large and not coarse
        defines: dict[str, object] = {
            "N_BOUNDS": bounds,
            "STOPS": stops,
            "DROPPED": max(0, stops - math.floor(math.log2(MOST_RAYS_A_PIXEL / rays))),
            "STORED": 0,
            "COARSE": int(coarse),
            "COARSE_PX": f"{COARSE_PX}f",
            "FOURS": int(fours),
            "HALVED": int(large),
            "FULL_LAYERS": FULL_LAYERS,
        }
        if codes is not None:
            code = "uchar" if codes.format.bits == 8 else "ushort"
            defines |= {"STORED": 1, "CODE": code, "LIGHT_ONE": one}
        program = build_program(self.device, ["refocus/kernels/depth_slicing.cl"], defines)
        self._add = cl.Kernel(program, "add_rays")
        self._join = cl.Kernel(program, "join_rays") if fours else None
        self._fours = self.device.empty(0)
        self._compose = cl.Kernel(program, "compose")
        ends = [(*each, np.inf) for each in self.bounds_px]
        self._bounds = self.device.buffer(np.array(ends, np.float32))
        strips = STRIPS_A_THREAD * self.device.threads
        rows = min(STRIP_ROWS, -(-self.size.height // min(strips, self.size.height)))
        self._rows = rows + rows % 2 * large
        self._strips = -(-self.size.height // self._rows)
        each = [[p.delta, self._scale(p), self._step(p), slab.lens_pitch_m] for p in planes]
        self._planes = self.device.buffer(np.array(each, np.float32))
        size = self.sums_bytes(len(planes), self.size, stops, bounds, self._rows)
        self._sums = self.device.zeros(size, sparse=True)
        self._used = self.device.zeros(4 * len(planes) * self._strips)

    def _cells_of(self, plane: SensorPlane) -> LensCells:
        """What the views stand for in a plane's aperture."""
        return lens_cells(self.views.slab, plane.lens_aperture(self.views.slab))

    @property
    def _middle(self) -> np.ndarray:
        """(2,) float64: where the axis is in the pictures, pixels."""
        return self.pixels / 2 - np.array([self.left, self.top])

    @staticmethod
    def sums_bytes(
        planes: int, size: Size, stops: int, bounds: int = 1 + WIDE_LAYERS, rows: int | None = None
    ) -> int:
        """Bytes of the sums, in strips of ``rows``, default one strip."""
        rows = rows or size.height
        whole = min(bounds, FULL_LAYERS) if size.longer >= LARGE_FROM else bounds
        pixels = (2 * whole + 1) * (rows + 1) * (size.width + 1)
        pixels += 2 * (bounds - whole) * (-(-rows // 2) + 3) * (-(-size.width // 2) + 3)
        return planes * -(-size.height // rows) * pixels * (32 if stops else 16)

    def _scale(self, plane: SensorPlane) -> float:
        """Pixels of a picture, a metre of the lens and a dioptre."""
        slab = self.views.slab
        return plane.magnification(slab) * self.pixels / slab.camera.field_width

    def _step(self, plane: SensorPlane) -> float:
        """Pixels of a picture from one pixel of the slab to the next."""
        slab = self.views.slab
        return plane.magnification(slab) * self.pixels / slab.pixels

    def _one(self, plane: SensorPlane, cells: LensCells, stops: int) -> float:
        """The weight, in units of the sums, of a ray whose cell is open."""
        rays = max(1.0, self._rays_a_pixel(plane, cells))
        return 2.0 ** (LONG_RAY_BITS if stops else SUM_BITS - math.ceil(math.log2(rays)))

    def _rays_a_pixel(self, plane: SensorPlane, cells: LensCells) -> float:
        """Rays, by their share, of an even surface in a pixel; sums hold eight times more."""
        return cells.share.sum() / self._step(plane) ** 2

    def _first(self, plane: SensorPlane) -> np.ndarray:
        """(K, 2) float64: where the ray of pixel (0, 0) of each view falls, pixels."""
        views = self.views
        corner = np.array(views.slab.held.pixels[:2])
        moved = views.displacement + corner - (views.slab.pixels - 1) / 2
        shift = views.positions * (plane.delta - views.slab.camera.delta)
        return moved * self._step(plane) + shift * self._scale(plane) + self._middle

    def _cell_records(self) -> np.ndarray:
        """(planes, views, 8) float32, as the kernel's Cell."""
        views = self.views.positions
        records = np.zeros((len(self.planes), len(views), 8), np.float32)
        for record, plane, cells, one in zip(
            records, self.planes, self._cells, self._ones, strict=True
        ):
            record[:, 0:2] = self._first(plane)
            record[:, 2:4] = cells.middle - views
            record[:, 4:6] = cells.extent
            record[:, 6] = cells.share * one
            record[:, 7] = np.arange(len(views)) * 0.6180340 % 1
        return records

    def add(
        self, part: slice | np.ndarray, light: np.ndarray, depth: np.ndarray, first_row: int = 0
    ) -> None:
        """Add rays of the views i + N j of ``part``, rows from ``first_row`` on, a multiple of 4.

        ``light`` is (K, rows, columns, 3) float32 linear radiance, more than ``2 ** stops`` counts
        as that; ``depth`` (K, rows, columns) float32, metres, infinity for a miss.
        """
        views, rows, columns = depth.shape
        size, fits = self.views.slab.size, light.shape == (*depth.shape, 3)
        fits = fits and (views, columns) == (len(self.views.positions[part]), size.width)
        if not fits or first_row + rows > size.height:
            raise ValueError(f"rays of shapes {light.shape} and {depth.shape} are not these views'")
        self.add_held(part, *held_rays(self.device, light, depth), first_row)

    def add_stored(
        self, part: np.ndarray, light: cl.Buffer, codes: np.ndarray, first_row: int = 0
    ) -> None:
        """Add rows of views of a file, from ``first_row`` on, a multiple of 4.

        ``light`` holds (K, 3, rows, columns) uint32, ``one`` to one, ``codes`` (K, rows, columns).
        """
        ends = np.stack([codes.min(axis=2), codes.max(axis=2)], -1)
        if self._codes.shape != codes.shape:  # kept: drivers are slow with what begins no page
            self._codes = page_aligned(codes.shape, codes.dtype.type)
        self._codes[:] = codes
        self.add_held(part, light, self.device.shown(self._codes), self._table[ends], first_row)

    def add_held(
        self, part: slice | np.ndarray, light: cl.Buffer, depth: cl.Buffer, ranges: np.ndarray,
        first_row: int = 0,
    ) -> None:  # fmt: skip
        """As :meth:`add`, of :func:`held_rays`."""
        device, (views, rows, _), columns = self.device, ranges.shape, self.views.slab.size.width
        rays = light, depth, device.buffer(1 / self._table)
        if self._join:
            tiles = -(-rows // TILE_ROWS), views
            size = math.prod(tiles) * -(-columns // TILE_COLUMNS) * TILE_BYTES
            if size > self._fours.size:
                self._fours = device.empty(size)
            shape = np.int32(columns), np.int32(rows)
            self._join(device.queue, tiles, (1, 1), *rays, *shape, self._fours)
        self._add(
            device.queue,
            (self._strips, len(self.planes)),
            (1, 1),
            *rays,
            self._fours,
            device.buffer(ranges),
            device.buffer(np.ascontiguousarray(self._records[:, part])),
            self._planes,
            self._bounds,
            np.int32(views),
            np.int32(columns),
            np.int32(rows),
            np.int32(first_row),
            np.float32(self.least_px),
            np.int32(self._rows),
            *map(np.int32, self.size),
            self._sums,
            self._used,
        )
        device.queue.finish()

    def pictures(self) -> np.ndarray:
        """(P, height, width, 3) float32, linear light, of all rays; the sums are gone then.

        A pixel is divided by what it got, or, with ``normalise='lens'``, dims as the lens stops
        down.  Where no ray fell it is black.
        """
        device = self.device
        pictures = page_aligned((len(self.planes), *self.size[::-1], 3))
        with device.mapped(self._used, (len(self.planes), self._strips), np.int32) as used:
            layers = np.bitwise_or.reduce(used, axis=1).tolist()
        for number, (picture, plane, cells) in enumerate(
            zip(pictures, self.planes, self._cells, strict=True)
        ):
            rooms, row_of = self._rooms(number, layers[number])  # kept until the kernel has run
            target = device.target_buffer(picture)
            self._compose(
                device.queue,
                (self._strips, 1),
                (1, 1),
                self._sums,
                self._used,
                device.shown(rooms),
                device.shown(row_of),
                np.int32(self._rows),
                *map(np.int32, self.size),
                target,
                global_offset=(0, number),
            )
            device.collect(target, picture)
            device.forget(self._sums, number, len(self.planes))
            if plane.normalise == "lens":
                picture *= cells.share.mean() / plane.magnification(self.views.slab) ** 2
        return pictures

    def _rooms(self, number: int, layers: int) -> tuple[np.ndarray, np.ndarray]:
        """Weights (rows, width) float32 of the rays that a pixel gets if all are swept as those of
        a layer, and the row (layers, height) int32 of each of the ``layers``, which are bits."""
        cells, one = self._cells[number], self._ones[number]
        bounds = self.bounds_px[number]
        row_of = np.zeros((2 * len(bounds) + 1, self.size.height), np.int32)
        rooms: list[np.ndarray] = []
        share = cells.share[:, None] / self._step(self.planes[number]) ** 2
        alike = defaultdict(list)
        for layer in range(len(row_of)):
            if layers >> layer & 1:
                alike[typical_sweep(bounds, abs(layer - len(bounds)))].append(layer)
        for sweep, swept in alike.items():
            across, down = self._reached(number, sweep)
            # Most rows are within all views, and alike.
            unlike = np.append(True, np.any(np.diff(down, axis=1), axis=0))
            row_of[swept] = np.cumsum(unlike) - 1 + sum(map(len, rooms))
            rows = down[:, unlike] * share
            # Without BLAS, whose threads spin, and which sums in another order on each processor.
            rooms.append(np.einsum("kv,ku->vu", rows, across) * one)
        none = np.zeros((1, self.size.width))
        return np.concatenate([*rooms, none]).astype(np.float32), row_of

    def _reached(self, number: int, sweep: float) -> list[np.ndarray]:
        """(K, width) and (K, height): how much of a pixel a view's rays reach, each spread over its
        cell's part of ``sweep``."""
        plane, slab = self.planes[number], self.views.slab
        step, reached = self._step(plane), []
        sides = self._cells[number].extent / slab.lens_pitch_m * sweep
        for low, side, rays, count in zip(
            (self._first(plane) - step / 2).T, sides.T, slab.size, self.size, strict=True
        ):
            half = np.maximum(side, 1e-3)[:, None] / 2
            left, ends = np.arange(count), np.stack([low, low + step * rays])[..., None]

            def until(place: np.ndarray, ends: np.ndarray = ends) -> np.ndarray:
                """The integral over the part of a view before a place, up to it."""
                before = np.square(np.maximum(place - ends, 0)) / 2
                return before[0] - before[1]

            whole = until(left + 1 + half) - until(left + half)
            whole -= until(left + 1 - half) - until(left - half)
            reached.append(np.round(whole / (2 * half), 6))  # where all is reached, alike
        return reached

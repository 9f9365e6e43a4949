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

IN_FOCUS_PX = 0.5
"""The largest sweep in focus, pixels of the picture."""
WIDE_PX = 2.0
"""The smallest sweep of wide blur, pixels of the picture."""
WIDE_LAYERS = 5
"""Layers of wide blur on each side of the plane (measured, docs/decisions.md)."""
LEAST_OF_RAY = 0.5
"""The least side of a box, in distances between neighbouring rays of a view (measured there)."""
LEAST_OF_ALL = 2.0
"""The least side of a box, in distances between neighbouring rays of all views together, which
counts if it is less (measured there)."""
COARSE_PX = 1.25
"""The largest pixel of a view, in pixels of the picture, whose pattern a pixel averages away."""
LARGE_FROM = 2048
"""The longer side, in pixels, from which pictures are large: 4 x 4 rays share boxes 32 rays wide,
which smaller pictures hardly have, and sums of wide blur have pixels of 2 x 2."""
FULL_LAYERS = 3
"""Layers on each side of the plane with all pixels in large pictures; with two, pictures lose up to
3 dB."""
TILE_ROWS = 4
"""The rows of rays that the kernel joins to squares at a time."""
TILE_COLUMNS = 64
"""The columns of rays that the kernel joins to squares at a time."""
TILE_BYTES = 6 * 64
"""The memory of the squares of a tile."""
STRIPS_A_THREAD = 2
"""The least number of a picture's strips per thread, so that threads end together."""
STRIP_ROWS = 256
"""The most rows of a strip: views arrive some rows at a time."""
SUMS_BYTES = 1 << 33
"""The most bytes of sums at a time.  A pixel has few of the layers, so that about an eighth is
written to; a CPU allocates no memory for the rest."""
MOST_RAYS_A_PIXEL = 1 << 20
"""The most rays per pixel whose sums fit in 32 bits."""
LONG_RAY_BITS = 40
"""The bits of a ray in sums of 64 bits; light above white uses bits that few rays leave free, or
drops its last ones."""
SUM_BITS = 29
"""The bits of all rays of a pixel in sums of 32 bits: boxes may add up to eight times as much."""

HeldRays = tuple[cl.Buffer, cl.Buffer, np.ndarray]
"""Colours and depths of views on a device, and the least and largest depth of each row."""


def held_rays(device: Device, light: np.ndarray, depth: np.ndarray) -> HeldRays:
    """Copy rays to the device once for several slicers; arrays as in :meth:`DepthSlicer.add`."""
    ranges = np.stack([depth.min(axis=2), depth.max(axis=2)], -1).astype(np.float32)
    light, depth = (np.ascontiguousarray(each, np.float32) for each in (light, depth))
    return device.shown(light), device.shown(depth), ranges


def layer_bounds(widest_px: float) -> tuple[float, ...]:
    """The sweeps between the layers on each side of a plane; infinity has ``widest_px``.

    They double from layer to layer, or grow faster, so that the last layer begins at half the
    widest sweep or above.
    """
    last = WIDE_LAYERS - 1
    ratio = max(2.0, (widest_px / 2 / WIDE_PX) ** (1 / last))
    return (IN_FOCUS_PX, *(WIDE_PX * ratio**number for number in range(WIDE_LAYERS)))


def typical_sweep(bounds_px: Sequence[float], away: int) -> float:
    """A layer's typical sweep, by its number from the plane; 0 for the layers around focus."""
    if away < 2:
        return 0.0
    ends = *bounds_px, 2 * bounds_px[-1]
    return math.sqrt(ends[away - 1] * ends[away])


def planes_at_a_time(device: Device, size: Size, stops: int) -> int:
    """The number of pictures of this size that are formed at a time."""
    most = min(SUMS_BYTES, device.device.max_mem_alloc_size, device.device.global_mem_size // 2)
    return max(1, most // DepthSlicer.sums_bytes(1, size, stops))


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
                f"{rays:,.0f} rays per pixel are more than {MOST_RAYS_A_PIXEL:,}",
                remedy="Give fewer views, or more pixels",
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
        """The views' cells in a plane's aperture."""
        return lens_cells(self.views.slab, plane.lens_aperture(self.views.slab))

    @property
    def _middle(self) -> np.ndarray:
        """The axis's position in the pictures, (2,) float64 pixels."""
        return self.pixels / 2 - np.array([self.left, self.top])

    @staticmethod
    def sums_bytes(
        planes: int, size: Size, stops: int, bounds: int = 1 + WIDE_LAYERS, rows: int | None = None
    ) -> int:
        """The bytes of the sums, in strips of ``rows``; by default one strip."""
        rows = rows or size.height
        whole = min(bounds, FULL_LAYERS) if size.longer >= LARGE_FROM else bounds
        pixels = (2 * whole + 1) * (rows + 1) * (size.width + 1)
        pixels += 2 * (bounds - whole) * (-(-rows // 2) + 3) * (-(-size.width // 2) + 3)
        return planes * -(-size.height // rows) * pixels * (32 if stops else 16)

    def _scale(self, plane: SensorPlane) -> float:
        """Pixels of a picture per metre of the lens and dioptre."""
        slab = self.views.slab
        return plane.magnification(slab) * self.pixels / slab.camera.field_width

    def _step(self, plane: SensorPlane) -> float:
        """Pixels of a picture per pixel of the slab."""
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
        """The pixel that the ray of pixel (0, 0) of each view hits, (K, 2) float64."""
        views = self.views
        corner = np.array(views.slab.held.pixels[:2])
        moved = views.displacement + corner - (views.slab.pixels - 1) / 2
        shift = views.positions * (plane.delta - views.slab.camera.delta)
        return moved * self._step(plane) + shift * self._scale(plane) + self._middle

    def _cell_records(self) -> np.ndarray:
        """The kernel's Cell records, (planes, views, 8) float32."""
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
        """Add rows of some views.

        Parameters
        ----------
        part : slice or ndarray
            The views' numbers i + N j.
        light : ndarray
            (K, rows, columns, 3) float32 linear radiance, clipped at ``2 ** stops``.
        depth : ndarray
            (K, rows, columns) float32, metres, infinity for a miss.
        first_row : int
            A multiple of 4.
        """
        views, rows, columns = depth.shape
        size, fits = self.views.slab.size, light.shape == (*depth.shape, 3)
        fits = fits and (views, columns) == (len(self.views.positions[part]), size.width)
        if not fits or first_row + rows > size.height:
            raise ValueError(f"shapes {light.shape} and {depth.shape} are not the views'")
        self.add_held(part, *held_rays(self.device, light, depth), first_row)

    def add_stored(
        self, part: np.ndarray, light: cl.Buffer, codes: np.ndarray, first_row: int = 0
    ) -> None:
        """Add rows of a file's views, as :meth:`add` does.

        ``light`` has (K, 3, rows, columns) uint32 in fixed point, ``codes`` (K, rows, columns).
        """
        ends = np.stack([codes.min(axis=2), codes.max(axis=2)], -1)
        if self._codes.shape != codes.shape:  # kept: drivers are slow with unaligned memory
            self._codes = page_aligned(codes.shape, codes.dtype.type)
        self._codes[:] = codes
        self.add_held(part, light, self.device.shown(self._codes), self._table[ends], first_row)

    def add_held(
        self, part: slice | np.ndarray, light: cl.Buffer, depth: cl.Buffer, ranges: np.ndarray,
        first_row: int = 0,
    ) -> None:  # fmt: skip
        """As :meth:`add`, with :func:`held_rays`."""
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
        """(P, height, width, 3) float32, linear light, of all rays; the sums are lost.

        A pixel is divided by the weight of its rays.  With ``normalise='lens'`` the picture then
        dims as the lens stops down.  Pixels without rays are black.
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
        """The weight of all rays per pixel, as if each had a layer's typical sweep.

        Returns different rows of weights, (rows, width) float32, and the row of each pixel row,
        (layers, height) int32.  ``layers`` has a bit per layer in use.
        """
        cells, one = self._cells[number], self._ones[number]
        bounds = self.bounds_px[number]
        row_of = np.zeros((2 * len(bounds) + 1, self.size.height), np.int32)
        rooms: list[np.ndarray] = []
        share = cells.share[:, None] / self._step(self.planes[number]) ** 2
        layers_of = defaultdict(list)
        for layer in range(len(row_of)):
            if layers >> layer & 1:
                layers_of[typical_sweep(bounds, abs(layer - len(bounds)))].append(layer)
        for sweep, same in layers_of.items():
            across, down = self._coverage(number, sweep)
            # Most rows are inside all views, and equal.
            differs = np.append(True, np.any(np.diff(down, axis=1), axis=0))
            row_of[same] = np.cumsum(differs) - 1 + sum(map(len, rooms))
            rows = down[:, differs] * share
            # Without BLAS: its threads spin, and its order of sums depends on the processor.
            rooms.append(np.einsum("kv,ku->vu", rows, across) * one)
        empty = np.zeros((1, self.size.width))
        return np.concatenate([*rooms, empty]).astype(np.float32), row_of

    def _coverage(self, number: int, sweep: float) -> list[np.ndarray]:
        """The share of each column and row that a view's rays cover, (K, width) and (K, height).

        Each ray is spread over its cell's part of ``sweep``.
        """
        plane, slab = self.planes[number], self.views.slab
        step, coverage = self._step(plane), []
        sides = self._cells[number].extent / slab.lens_pitch_m * sweep
        for low, side, rays, count in zip(
            (self._first(plane) - step / 2).T, sides.T, slab.size, self.size, strict=True
        ):
            half = np.maximum(side, 1e-3)[:, None] / 2
            left, ends = np.arange(count), np.stack([low, low + step * rays])[..., None]

            def integral(place: np.ndarray, ends: np.ndarray = ends) -> np.ndarray:
                """The second integral of a view's extent up to a place."""
                ramp = np.square(np.maximum(place - ends, 0)) / 2
                return ramp[0] - ramp[1]

            swept = integral(left + 1 + half) - integral(left + half)
            swept -= integral(left + 1 - half) - integral(left - half)
            coverage.append(np.round(swept / (2 * half), 6))  # full coverage is exactly equal
        return coverage

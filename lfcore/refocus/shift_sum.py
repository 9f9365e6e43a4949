"""Shift-sum refocusing on views (thesis section 6.2, equation 6.1).

Every view is shifted to the plane in focus and added.  Without magnification, the nearest filter
shifts a view by a whole number, and its sums equal those of slicing to the last bit.  The bilinear
filter shifts by fractions.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, cl, open_device
from lfcore.opencl.interface import FLOAT, INT, SHARED, Interface, given, read, record, write
from lfcore.opencl.kernel import Kernel
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Ends, Rectangle, Slab
from lfcore.refocus.resampling import crop, normalise, taps
from lfcore.refocus.stored_views import GROUP_BYTES, TakesViews, add_frames
from lfcore.storage.lightfield import LightFieldFile

MOST_VIEWS = 4095
"""The most views of a group: 32-bit sums hold no more."""
FILE = "refocus/kernels/shift_sum.cl"
SHIFT_SUM_ARGUMENTS = np.dtype([
    ("column", INT),  # the views' rectangle of the grid of pixels
    ("row", INT),
    ("width", INT),
    ("height", INT),
    ("left", INT),  # the rectangle of the planes to which they are added
    ("top", INT),
    ("right", INT),
    ("bottom", INT),
    ("size", INT),  # side M of a plane
    ("lens", INT),  # side N of the lens, for MAGNIFIED
    ("is_bilinear", INT),  # four taps, not one
])  # fmt: skip
SHIFTED_VIEW = np.dtype([
    ("view", INT),
    ("x", INT),  # shift from a plane's pixel to the view's; of MAGNIFIED the lens sample (i, j)
    ("y", INT),
    ("right", FLOAT),  # shares of the right and the lower tap
    ("below", FLOAT),
])  # fmt: skip
ENTRIES = np.dtype([("first", INT), ("end", INT)])
"""A plane's entries: the first, and the one after the last."""
# views (K, 3, height, width); lists per plane, of entries; of MAGNIFIED, the source pixel and the
# share of the next one, first and share (planes, N, M); sums (planes, 3, M, M).
INTERFACE = SHARED | Interface(
    records={
        "ShiftSumArguments": SHIFT_SUM_ARGUMENTS, "ShiftedView": SHIFTED_VIEW, "Entries": ENTRIES,
    },
    kernels={
        "add_views": given(numbers="ShiftSumArguments")
        | read(views="uint", lists="Entries", entries="ShiftedView", first="int", share="float")
        | write(sums="SUM"),
        "scale_views": given(divisor="uint") | write(views="uint"),
    },
)  # fmt: skip
"""What the kernels share with the host."""


class ViewSummer:
    """Adds views, or rectangles of views, to planes.

    Parameters
    ----------
    slab, planes
        The views and the pictures.
    filter : str
        ``nearest`` or ``bilinear``.
    device : Device, optional
        Default: the default device.
    one : float
        Radiance 1 in the views' fixed point.
    most_views : int
        The views whose sum fits in 32 bits.
    """

    def __init__(
        self,
        slab: Slab,
        planes: Sequence[SensorPlane],
        *,
        filter: str = "nearest",
        device: Device | None = None,
        one: float = FIXED_ONE,
        most_views: int = MOST_VIEWS,
    ):
        for plane in planes:
            plane.check(slab)
            plane.check_pixels(slab.pixels)
        self.slab, self.planes, self.filter = slab, list(planes), filter
        self.one, self.most_views = one, most_views
        self.device = device or open_device()
        self._masks = [plane.mask(slab) for plane in planes]
        self.open_samples = np.argwhere(np.any(self._masks, axis=0))[:, ::-1].astype(np.int32)
        # Without magnification each view has one shift; else tables have an entry per pixel.
        self._magnified = any(plane.magnification(slab) != 1.0 for plane in planes)
        defines = {"MAGNIFIED": self._magnified, "SUM": "ulong"}
        self._kernel = Kernel(self.device, [FILE], "add_views", defines, INTERFACE)
        tables_of = [taps(slab, plane, filter) for plane in planes]
        self._first = np.stack([first for first, _ in tables_of])  # (planes, N, M)
        self._share = np.stack([share for _, share in tables_of])
        tables = {"first": self._first, "share": self._share} if self._magnified else {}
        self._tables = {name: self.device.buffer(table) for name, table in tables.items()}
        self._sums = self.device.zeros(len(planes) * 24 * slab.pixels**2)

    def group_size(self, width: int, height: int) -> int:
        """The number of views of this size that are added at a time."""
        return int(np.clip(GROUP_BYTES // (12 * width * height), 1, self.most_views))

    def add_fixed(self, views: cl.Buffer, samples: np.ndarray, region: tuple) -> None:
        """Add (K, 3, h, w) uint32 fixed point on the device; region is (column, row, w, h)."""
        lists, entries = self._entries(samples)
        spans = [self._reach(samples[:, axis], region[axis], region[2 + axis]) for axis in (0, 1)]
        if not len(entries) or any(low >= high for low, high in spans):
            return
        (left, right), (top, bottom) = spans
        launch_add(
            self._kernel, self.device, views, region, (left, top, right, bottom), self.slab.pixels,
            lists, entries, self._sums, lens=self.slab.views,
            is_bilinear=self.filter == "bilinear", **self._tables,
        )  # fmt: skip
        self.device.queue.finish()

    def _entries(self, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The lists of planes, and their open views with shifts."""
        entries = []
        for first, share, mask in zip(self._first, self._share, self._masks, strict=True):
            views = np.flatnonzero(mask[samples[:, 1], samples[:, 0]])
            entry = np.zeros(len(views), SHIFTED_VIEW)
            entry["view"] = views
            for place, tap, lens in zip("xy", ("right", "below"), samples[views].T, strict=True):
                entry[place] = lens if self._magnified else first[lens, 0]
                entry[tap] = share[lens, 0]
            entries.append(entry)
        ends = np.cumsum([0, *map(len, entries)])
        return lists_of(ends[:-1], ends[1:]), np.concatenate(entries)

    def _reach(self, lens: np.ndarray, first: int, length: int) -> tuple[int, int]:
        """The output pixels of an axis that can read pixels first ... first + length - 1."""
        table = self._first[:, lens.min() : lens.max() + 1]
        reads = ((table >= first - 1) & (table < first + length)).any(axis=(0, 1))
        pixels = np.flatnonzero(reads)
        return (int(pixels[0]), int(pixels[-1]) + 1) if len(pixels) else (0, 0)

    def pictures(self) -> np.ndarray:
        """(P, M, M, 3) float32, linear light, of all added views."""
        size = self.slab.pixels
        out = np.empty((len(self.planes), size, size, 3), np.float32)
        sums_of = read_sums(self.device, self._sums, len(self.planes), self.slab)
        for picture, plane, sums in zip(out, self.planes, sums_of, strict=True):
            picture[:] = normalise(self.slab, plane, self.filter, sums / float(self.one))
        return out


def to_fixed(views: np.ndarray) -> np.ndarray:
    """Convert views (K, h, w, 3), uint8 sRGB or linear light, to (K, 3, h, w) uint32."""
    planar, are_codes = np.moveaxis(views, -1, 1), views.dtype == np.uint8
    light = srgb_decode(np.arange(256, dtype=np.uint8)) if are_codes else np.clip(planar, 0, 1)
    rounded = np.floor(light.astype(np.float32) * np.float32(FIXED_ONE) + np.float32(0.5))
    fixed = rounded.astype(np.uint32)
    return np.take(fixed, planar) if are_codes else np.ascontiguousarray(fixed)


def read_sums(device: Device, sums: cl.Buffer, count: int, slab: Slab) -> Iterator[np.ndarray]:
    """Yield the (3, M, M) uint64 sums of each plane, always in the same array."""
    host = np.empty((3, slab.pixels, slab.pixels), np.uint64)
    for k in range(count):
        cl.enqueue_copy(device.queue, host, sums, src_offset=k * host.nbytes)
        yield host


def lists_of(firsts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """(P,) ENTRIES."""
    lists = np.zeros(len(firsts), ENTRIES)
    lists["first"], lists["end"] = firsts, ends
    return lists


def launch_add(
    kernel: Kernel,
    device: Device,
    views: cl.Buffer,
    region: Rectangle,
    output: Ends,
    size: int,
    lists: np.ndarray,
    entries: np.ndarray,
    sums: cl.Buffer,
    *,
    lens: int = 0,
    is_bilinear: bool = False,
    first: cl.Buffer | None = None,
    share: cl.Buffer | None = None,
) -> None:
    """Start the kernel ``add_views``; arguments are as in :data:`INTERFACE`."""
    (column, row, width, height), (left, top, right, bottom) = region, output
    numbers = record(
        SHIFT_SUM_ARGUMENTS, column=column, row=row, width=width, height=height, left=left, top=top,
        right=right, bottom=bottom, size=size, lens=lens, is_bilinear=is_bilinear,
    )  # fmt: skip
    # A GPU needs many work-items, a CPU long ones.
    across = 1 if device.is_cpu else -(-(right - left) // device.lanes)
    kernel(
        across, len(lists), bottom - top, numbers=numbers, views=views,
        lists=device.buffer(lists), entries=device.buffer(entries), first=first, share=share,
        sums=sums,
    )  # fmt: skip


def shift_sum(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    *,
    filter: str = "nearest",
    device: Device | str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Refocus a stored light field by shift-sum: (P, height, width, 3) float32, linear light.

    The next frames are decoded while views are added.
    """
    device = device if isinstance(device, Device) else open_device(device)
    summer = ViewSummer(
        field.require_grid(), planes, filter=filter, device=device, one=field.layout.one,
        most_views=field.layout.most_views,
    )  # fmt: skip
    add_frames(summer, field, progress)
    return crop(field.require_slab(), summer.pictures())


def shift_sum_views(
    slab: Slab,
    views: np.ndarray,
    planes: Sequence[SensorPlane],
    *,
    filter: str = "nearest",
    device: Device | None = None,
) -> np.ndarray:
    """Refocus views in memory: (P, M, M, 3) float32, linear light.

    ``views`` is (N, N, M, M, 3), indexed [j, i, v, u], uint8 sRGB or floating linear light.
    Raises :class:`OpticsError` for another shape.
    """
    summer = ViewSummer(slab, planes, filter=filter, device=device)
    add_views(summer, slab, views)
    return summer.pictures()


def add_views(summer: TakesViews, slab: Slab, views: np.ndarray) -> None:
    """Add the open views among all views (N, N, M, M, 3), some at a time.

    Raises :class:`OpticsError` for another shape.
    """
    expected = (slab.views, slab.views, slab.pixels, slab.pixels, 3)
    if views.shape != expected:
        raise OpticsError(f"must be {expected} for this slab, not {views.shape}", key="views")
    samples = summer.open_samples
    step = summer.group_size(slab.pixels, slab.pixels)
    for start in range(0, len(samples), step):
        part = samples[start : start + step]
        buffer = summer.device.buffer(to_fixed(views[part[:, 1], part[:, 0]]))
        summer.add_fixed(buffer, part, (0, 0, slab.pixels, slab.pixels))

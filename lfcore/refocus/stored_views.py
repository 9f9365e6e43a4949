"""Views in fixed-point linear light from a stored light field's frames, in either layout."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Protocol

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, cl, open_device, page_aligned
from lfcore.opencl.interface import INT, Interface, given, read, record, write
from lfcore.opencl.kernel import Kernel
from lfcore.optics.array import CameraArray
from lfcore.optics.grid_geometry import GIVE_GEOMETRY
from lfcore.optics.slab import Rectangle
from lfcore.refocus import fixed_light
from lfcore.storage.frame_memory import PLACEMENT
from lfcore.storage.index import Segment
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.stored_video import StoredVideo

CHUNK_BYTES = 8 << 20
"""The bytes of frames with views that are decoded at a time."""
GROUP_BYTES = 64 << 20
"""The bytes of a group of views in fixed point."""
_SOURCE = "refocus/kernels/unpack_views.cl"
UNPACKING_ARGUMENTS = np.dtype([
    ("frame_width", INT),
    ("frame_height", INT),
    ("halved", INT),  # whether chroma has half the width and height
    ("is_rgb", INT),
    ("by_views", INT),  # whether frames hold views, not macropixels
    ("width", INT),  # of a view
    ("height", INT),
])  # fmt: skip
# placements per element; samples (K,): lens sample (i, j) of each view, for macropixels.
INTERFACE = fixed_light.INTERFACE | Interface(
    records={"UnpackingArguments": UNPACKING_ARGUMENTS},
    kernels={
        "unpack_views": read(frames="sample", placements="Placement", samples="int2")
        | given(numbers="UnpackingArguments")
        | write(views="uint")
    },
)
"""What the kernel shares with the host."""


class TakesViews(Protocol):
    """A receiver of views on the device."""

    device: Device

    @property
    def open_samples(self) -> np.ndarray:
        """The wanted views (i, j), (K, 2) int32."""

    def group_size(self, width: int, height: int) -> int:
        """The number of views of this size per call; 0 for bands of rows."""

    def add_fixed(self, views: cl.Buffer, samples: np.ndarray, region: tuple) -> None:
        """Receive views (K, 3, h, w) uint32 of samples (K, 2).

        Radiance 1 is ``layout.one``; ``region`` is the views' rectangle (column, row, w, h).
        """


class FrameUnpacker:
    """Unpacks frames on the device, and passes their views to ``receiver``.

    ``pixels`` is the views' rectangle of the slab's square grid, by default the whole grid; in
    frames it begins at ``corner``.
    """

    def __init__(
        self,
        receiver: TakesViews,
        layout: FrameLayout,
        pixels: Rectangle | None = None,
        corner: tuple[int, int] = (0, 0),
    ):
        self.receiver, self.layout = receiver, layout
        self._pixels = pixels or (0, 0, layout.pixels, layout.pixels)
        self._corner = np.array(corner, np.int32)
        defines = layout.defines
        self._kernel = Kernel(receiver.device, [_SOURCE], "unpack_views", defines, INTERFACE)
        self._open, self._views = receiver.open_samples, receiver.device.empty(0)
        self._band = page_aligned((0,), layout.format.dtype.type)
        self._is_open = np.zeros((layout.views, layout.views), bool)
        self._is_open[self._open[:, 1], self._open[:, 0]] = True
        _, _, width, height = self._pixels
        self.in_rows = layout.kind == "views" and not receiver.group_size(width, height)
        """Whether views are passed by bands of rows, from frames' planes."""

    def add_planes(self, planes: list[np.ndarray], tile: Tile, number: int) -> None:
        """Add the planes (h, w) of frame ``number`` of a tile, by bands of rows."""
        elements = tile.elements()
        places = tile.placement(elements)
        here = (places[:, 0] == number) & self._is_open[elements[:, 1], elements[:, 0]]
        left, top, width, height = self._pixels
        step = 4 * max(1, self.receiver.group_size(width, 4))  # whole tiles of slicing by depth
        for element, (x, y) in zip(elements[here], places[here, 1:] + self._corner, strict=True):
            for row in range(0, height, step):
                rows = min(step, height - row)
                first = (y + row) // 2 * 2  # rows of chroma are whole
                band = [plane[first // s : (first + rows + 2) // s] for plane in planes
                        for s in [len(planes[0]) // len(plane)]]  # fmt: skip
                size = sum(part.size for part in band)
                if size > self._band.size:
                    self._band = page_aligned((size,), self.layout.format.dtype.type)
                joined = np.concatenate([part.ravel() for part in band], out=self._band[:size])
                place = np.zeros(1, PLACEMENT)
                place["x"], place["y"] = x, y + row - first
                region = left, top + row, width, rows
                self._unpack(
                    self.receiver.device.shared(joined),
                    len(band[0]),
                    place,
                    element[None],
                    region,
                )
                self.receiver.device.queue.finish()

    def add(self, frames: np.ndarray, tile: Tile, first: int) -> None:
        """Add consecutive frames (F, frame_bytes) uint8 of a tile, from number ``first`` on.

        Macropixels need all frames of a tile in one call.  Returns when the device no longer reads
        the frames.
        """
        elements = tile.elements()
        places = np.zeros(len(elements), PLACEMENT)
        places["frame"], places["x"], places["y"] = tile.placement(elements).T
        here = (places["frame"] >= first) & (places["frame"] < first + len(frames))
        elements, places = elements[here], places[here]
        places["frame"] -= first
        buffer = self.receiver.device.shared(np.ascontiguousarray(frames))
        by_views = self.layout.kind == "views"
        if by_views:
            wanted = self._is_open[elements[:, 1], elements[:, 0]]
            samples, places, region = elements[wanted], places[wanted], self._pixels
            places["x"] += self._corner[0]
            places["y"] += self._corner[1]
        else:
            left, top = self._pixels[:2]
            region = (tile.column + left, tile.row + top, tile.columns, tile.rows)
            samples, places = self._open, places[np.lexsort((elements[:, 0], elements[:, 1]))]
        step = self.receiver.group_size(*region[2:])
        for start in range(0, len(samples), step):
            part = slice(start, start + step)
            chosen = places[part] if by_views else places
            self._unpack(buffer, self.layout.frame_height, chosen, samples[part], region)
        self.receiver.device.queue.finish()

    def _unpack(
        self, frames: cl.Buffer, rows: int, places: np.ndarray, samples: np.ndarray, region: tuple
    ) -> None:
        device, layout = self.receiver.device, self.layout
        (width, height), count = region[2:], len(samples)
        if (size := 12 * count * width * height) > self._views.size:
            self._views = device.empty(size)  # kept: new pages cost as much as filling them
        by_views = layout.kind == "views"
        self._kernel(
            *((width, height, count) if by_views else (count, width, height)), grouped=True,
            frames=frames, placements=device.buffer(np.ascontiguousarray(places)),
            samples=device.buffer(np.ascontiguousarray(samples)), views=self._views,
            numbers=record(
                UNPACKING_ARGUMENTS, frame_width=layout.frame_width, frame_height=rows,
                halved=layout.format.subsampling > 1, is_rgb=layout.format.rgb,
                by_views=by_views, width=width, height=height,
            ),
        )  # fmt: skip
        self.receiver.add_fixed(self._views, samples, region)


def add_frames(
    receiver: TakesViews,
    field: LightFieldFile,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Pass all wanted views of a file to ``receiver``, while the next frames are decoded.

    ``progress`` is called with (frames done, total).
    """
    frames, done = FrameUnpacker(receiver, field.layout, field.extent.pixels, field.corner), 0
    total = sum(part.frames for part in field.segments)
    add = frames.add_planes if frames.in_rows else frames.add
    read = frame_planes if frames.in_rows else frame_chunks
    for tile, first, chunk in prefetched(read(field.video, field.segments)):
        add(chunk, tile, first)
        done += 1 if frames.in_rows else len(chunk)
        if progress:
            progress(done, total)


def frame_planes(
    video: StoredVideo, segments: Sequence[Segment]
) -> Iterator[tuple[Tile, int, list[np.ndarray]]]:
    """Yield the tile, the frame's number and its planes (h, w), frame by frame, without a copy."""
    for part in segments:
        for number, planes in enumerate(video.planes(part.index)):
            yield part.tile, number, planes


def frame_chunks(
    video: StoredVideo, segments: Sequence[Segment]
) -> Iterator[tuple[Tile, int, np.ndarray]]:
    """Yield the tile, the first frame's number and frames: some views, or a tile of macropixels.

    Two buffers take turns, so frames are valid until the next but one.  The driver uses the
    buffers' pages without a copy.
    """
    chunk = max((part.frames for part in segments), default=1)
    if video.layout.kind == "views":
        chunk = min(chunk, max(1, CHUNK_BYTES // video.layout.frame_bytes))
    shape = chunk, video.layout.frame_bytes
    rooms = itertools.cycle([page_aligned(shape, np.uint8) for _ in range(2)])
    for part in segments:
        first = 0
        for frames in video.frames(part.index, chunk=chunk, rooms=rooms):
            yield part.tile, first, frames
            first += len(frames)


def prefetched(items: Iterator) -> Iterator:
    """Yield the items; another thread computes the next one meanwhile."""
    with ThreadPoolExecutor(1) as pool:
        end = object()
        coming = pool.submit(next, items, end)
        while (item := coming.result()) is not end:
            coming = pool.submit(next, items, end)
            yield item


def read_views(
    field: LightFieldFile,
    samples: np.ndarray,
    *,
    device: Device | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """Read some views, (K, height, width, 3) float32, linear light, with their specular part.

    ``samples`` (K, 2) are (i, j) from the file's first view.  With macropixels all frames are
    decoded, whatever the number of views.  Raises :class:`OpticsError` for samples outside the
    lens, or given twice.
    """
    light = read_own_views(field, samples, device=device, progress=progress)
    if field.specular:
        light += read_own_views(field.specular, samples, device=device)
    return light


def read_own_views(
    field: LightFieldFile,
    samples: np.ndarray,
    *,
    device: Device | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """As :func:`read_views`, without the specular part of a file that has one."""
    collector = _Collector(field, np.asarray(samples, np.int32).reshape(-1, 2), device)
    add_frames(collector, field, progress)
    return collector.views


def read_stored(
    field: LightFieldFile, *, progress: Callable[[int, int], None] | None = None
) -> tuple[np.ndarray, CameraArray]:
    """Read all pictures of a file, slab or array, as a camera array's picture.

    Returns (N M, N M, 3) float32, linear radiance, and the array, which is sheared if the slab is
    focused; for ``DeviceField`` and ``write_array``.
    """
    if not field.metric:
        raise OpticsError(
            "does not hold its geometry, which a camera array needs", file=field.path,
            remedy=GIVE_GEOMETRY,
        )  # fmt: skip
    slab, (columns, rows) = field.metadata.slab, field.grid
    array = field.array if slab is None else CameraArray.from_slab(slab)
    assert array is not None  # a file has a slab or an array
    samples = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2)
    views = read_views(field, samples, progress=progress)
    image = array.mosaic(views.reshape(rows, columns, *views.shape[1:]))
    image *= np.float32(field.white)
    return image, array


class _Collector:
    """A receiver that keeps all views."""

    def __init__(self, field: LightFieldFile, samples: np.ndarray, device: Device | None):
        column, row, columns, rows = field.extent.views
        *self._corner, width, height = field.extent.pixels
        if len(samples) and not (0 <= samples.min() and (samples < [columns, rows]).all()):
            raise OpticsError(
                f"lens samples are from (0, 0) to ({columns - 1}, {rows - 1})", file=field.path
            )
        samples = samples + np.array([column, row], np.int32)
        self.device, self.open_samples = device or open_device(), samples
        self._one = np.float32(field.layout.one)
        self.views = np.zeros((len(samples), height, width, 3), np.float32)
        self._place = {tuple(sample): k for k, sample in enumerate(samples.tolist())}
        if len(self._place) < len(samples):
            raise OpticsError("has a view twice", file=field.path, key="samples")

    def group_size(self, width: int, height: int) -> int:
        return max(1, GROUP_BYTES // (12 * width * height))

    def add_fixed(self, views: cl.Buffer, samples: np.ndarray, region: tuple) -> None:
        column, row, width, height = region
        column, row = column - self._corner[0], row - self._corner[1]
        light = np.empty((len(samples), 3, height, width), np.uint32)
        cl.enqueue_copy(self.device.queue, light, views)
        for picture, sample in zip(light, samples.tolist(), strict=True):
            out = self.views[
                self._place[tuple(sample)], row : row + height, column : column + width
            ]
            out[:] = np.moveaxis(picture, 0, -1) / self._one

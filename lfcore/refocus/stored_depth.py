"""Slicing by depth of a stored light field, whose two streams have colours and depths."""

from collections.abc import Iterator, Sequence

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, cl, open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import all_samples
from lfcore.progress import Progress, part_of
from lfcore.refocus.depth_slicing import DepthSlicer, planes_at_a_time
from lfcore.refocus.stored_views import add_frames, frame_planes, read_own_views
from lfcore.refocus.two_parts import Part, TwoPartSlicer
from lfcore.storage.lightfield import LightFieldFile

VIEWS_RAYS = 1 << 20
"""The rays of views that are sliced at a time."""
HELD_RAYS = 1 << 27
"""The most rays in memory, as for a file of macropixels: 2 GiB."""


def slice_stored(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    pixels: Pixels | None = None,
    *,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> np.ndarray:
    """Make pictures of a file with depth: (P, height, width, 3) float32, linear light.

    ``pixels`` is as in :func:`picture_side`; by default the size that the file was recorded for.
    """
    stored = field.require_depth()
    side = stored.pixels if pixels is None else picture_side(field, pixels)
    device = device if isinstance(device, Device) else open_device(device)
    size = Size(*field.require_slab().picture(side)[2:])
    layout = field.layout
    kinds = 1 if field.metadata.specular is None else 2
    each = kinds * DepthSlicer.sums_bytes(planes, size, layout.stops) // len(planes)
    if each > device.device.global_mem_size // 2:
        raise OpticsError(
            f"sums of a picture of {size} pixels take {each / 2**30:.1f} GiB",
            file=field.path, key="pixels", remedy="Give fewer pixels",
        )  # fmt: skip
    room = max(1, planes_at_a_time(device, planes, size, layout.stops) // kinds)
    groups = [planes[first : first + room] for first in range(0, len(planes), room)]
    pictures = []
    for number, group in enumerate(groups):
        report = part_of(progress, number, len(groups))
        pictures.append(_slice(field, group, side, device, report))
        field.close()  # decoders hold more memory than pictures
    return pictures[0] if len(pictures) == 1 else np.concatenate(pictures)  # which copies


def _slice(
    field: LightFieldFile,
    planes: Sequence[SensorPlane],
    side: int,
    device: Device,
    progress: Progress | None,
) -> np.ndarray:
    stored, layout = field.require_depth(), field.layout
    views = stored.views(field.require_slab())
    if layout.kind == "views" and field.specular is None:
        slicer = DepthSlicer(
            views, planes, side, device, stops=layout.stops, codes=stored.codes, one=layout.one
        )
        add_frames(_ColourReceiver(field, slicer), field, progress)
        return slicer.pictures()
    parts = read_parts(field, device=device, progress=progress)
    in_parts = TwoPartSlicer(views, planes, side, device, stops=layout.stops)
    in_parts.add(slice(0, len(parts[0][0])), parts)
    return in_parts.pictures()


def picture_side(field: LightFieldFile, pixels: Pixels) -> int:
    """The longer side of a picture whose longer side, or width and height, is ``pixels``.

    Raises :class:`OpticsError` for a width and height of another shape than the views'.
    """
    size = Size.of(pixels)
    shown = Size(*field.require_slab().picture(size.longer)[2:])
    if isinstance(pixels, Sequence) and size != shown:
        raise OpticsError(
            f"a picture of {size} pixels has another shape than the views, {shown}",
            file=field.path, key="pixels", remedy="Give the longer side alone",
        )  # fmt: skip
    return size.longer


def read_rays(
    field: LightFieldFile, *, device: Device, progress: Progress | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Read all rays of a file with depth, view by view with i fastest.

    Returns light (N N, H, W, 3) float32, linear, and depth (N N, H, W) float32, metres; infinity
    for a miss, and for damaged segments.  Raises :class:`OpticsError` for more than
    :data:`HELD_RAYS`.
    """
    slab = field.require_slab()
    if slab.rays > HELD_RAYS:
        raise OpticsError(
            f"{slab.rays:,} rays are more than the {HELD_RAYS:,} that fit in memory",
            file=field.path, remedy="Record fewer views, or the layout views",
        )  # fmt: skip
    light = read_own_views(field, all_samples(slab), device=device, progress=progress)
    return light, read_depths(field, np.arange(len(light)))


def read_parts(
    field: LightFieldFile, *, device: Device, progress: Progress | None = None
) -> list[Part]:
    """Read all rays as :func:`read_rays`, and those of specular light if the file has it."""
    files = [field] if field.specular is None else [field, field.specular]
    return [
        read_rays(each, device=device, progress=part_of(progress, number, len(files)))
        for number, each in enumerate(files)
    ]


def read_depths(field: LightFieldFile, views: np.ndarray) -> np.ndarray:
    """Read depths of some views, (K, H, W) float32, as :func:`read_rays` does.

    ``views`` (K,) are their numbers i + N j.
    """
    slab, codes = field.require_slab(), field.require_depth().codes
    depth = np.full((len(views), *slab.size[::-1]), np.inf, np.float32)
    place = np.full(slab.views**2, -1)
    place[views] = np.arange(len(views))
    for elements, pictures in _elements(field):
        if field.layout.kind == "views":
            to = place[elements[:, 1] * slab.views + elements[:, 0]]
            for at, picture in zip(to.tolist(), pictures, strict=True):
                if at >= 0:
                    depth[at] = codes.depth(picture)
        else:
            u, v = elements.T
            rays = np.stack(pictures).reshape(len(elements), -1)
            depth[:, v, u] = codes.depth(rays[:, views]).T
    return depth


class _ColourReceiver:
    """Receives the colours of whole views, and reads their depths for the slicer."""

    def __init__(self, field: LightFieldFile, slicer: DepthSlicer):
        self.device, self._slicer, self._field = slicer.device, slicer, field
        self.open_samples = all_samples(slicer.views.slab)
        self._codes = (
            (tuple(place), picture)
            for elements, pictures in _elements(field)
            for place, picture in zip(elements.tolist(), pictures, strict=True)
        )
        self._shown = np.zeros(0)

    def group_size(self, width: int, height: int) -> int:
        return VIEWS_RAYS // (width * height)

    def add_fixed(self, views: cl.Buffer, samples: np.ndarray, region: tuple) -> None:
        top, rows = region[1] - self._field.extent.pixels[1], region[3]
        if not top:  # both streams have their elements in the same order
            places, codes = zip(*[next(self._codes) for _ in samples], strict=True)
            if list(places) != [tuple(sample) for sample in samples.tolist()]:
                raise AssertionError("the streams of colours and depths have different orders")
            self._shown = np.stack(codes) if len(codes) > 1 else codes[0][None]
        index = samples[:, 1] * self._field.layout.views + samples[:, 0]
        self._slicer.add_stored(index, views, self._shown[:, top : top + rows], top)


def _elements(field: LightFieldFile) -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
    """Yield, per frame, (E, 2) outer coordinates and E arrays (rows, columns) of depth codes."""
    video = field.require_depth_video()
    columns, rows = video.layout.inner
    for tile, number, (plane,) in frame_planes(video, field.segments):
        elements = tile.elements()
        places = tile.placement(elements)
        here = places[:, 0] == number
        shown = [plane[y : y + rows, x : x + columns] for _, x, y in places[here].tolist()]
        yield elements[here], shown

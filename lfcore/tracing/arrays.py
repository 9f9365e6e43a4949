"""Jobs whose sink is arrays of the host: hits, radiance, and the hits of given rays.

What comes from outside is checked here, and in :meth:`lfcore.tracing.packets.Groups.of`, before a
kernel sees it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.host_memory import collect, target_buffer
from lfcore.optics.bundles import Bundles
from lfcore.tracing.job import PacketJob
from lfcore.tracing.layouts import ADD, IMAGE_ARGUMENTS, STREAM, record
from lfcore.tracing.packets import Groups, PacketShape

CHUNK_RAYS = 1 << 24
"""Rays whose results a device with memory of its own holds at a time."""
LAUNCH_RAYS = 1 << 22
"""Rays of one launch where progress is asked for: it is told between launches."""
PER_RAY = {"triangle": 1, "depth": 1, "radiance": 3, "weights": 3}
"""Numbers per ray of each array that a job fills."""
STREAM_BYTES = 32 << 20
"""Images larger than this go past the caches, which would not hold them until they are read."""


def fill_arrays(
    job: PacketJob,
    sets: Sequence[Bundles],
    coordinates: np.ndarray | None,
    arrays: Mapping[str, np.ndarray],
    *,
    across: int = 1,
    progress: Callable[[int, int], None] | None = None,
    **inputs: Any,
) -> None:
    """Trace bundles into arrays of the host, whose parts follow each other as elements do.

    Parameters
    ----------
    sets : bundles of as many elements and equal inner grids; their radiance is added up.
    coordinates : of the elements, as for :meth:`lfcore.tracing.tracer.Tracer.bundle_hits`.
    arrays : the sink's arguments that are written.
    across : of an image: element e is at row e // across, column e % across.
    progress : called with (elements done, elements).
    inputs : the sink's other arguments.

    Raises
    ------
    OpticsError : bundles, coordinates or memory of another shape or type.
    """
    check_sets(sets, across)
    first, device = sets[0], job.scene.device
    count, rays = len(first.elements), first.columns * first.rows
    for name, array in arrays.items():
        check_target(array, count * rays * PER_RAY[name], name)
    # A CPU writes the host's own memory: nothing is copied, so nothing need be cut.
    step = count if device.is_cpu else max(1, CHUNK_RAYS // (across * rays)) * across
    for start in range(0, count, max(1, step)):
        stop = min(start + step, count)
        pieces = {
            name: array.reshape(-1)[start * array.size // count : stop * array.size // count]
            for name, array in arrays.items()
        }
        written: dict[str, Any] = {
            name: target_buffer(device, piece) for name, piece in pieces.items()
        }
        stream = "radiance" in pieces and pieces["radiance"].nbytes > STREAM_BYTES
        some = [one.part(slice(start, stop)) for one in sets]
        places = None if coordinates is None else np.asarray(coordinates)[start:stop]
        groups = Groups.of(job.shape, some[0], places)
        launches = groups.launches(_groups_per_launch(job.shape, first) if progress else count)
        for number, launch in enumerate(launches):
            for order, bundles in enumerate(some):
                if job.sink == "IMAGE":
                    mode = (ADD if order else 0) | (STREAM if stream else 0)
                    inputs["image"] = record(IMAGE_ARGUMENTS, across=across, mode=mode)
                one = launch if not order else replace(launch, centre_rays=bundles.elements)
                job.launch(bundles, one, **written, **inputs)
            if progress:
                device.queue.finish()
                progress(start + (stop - start) * (number + 1) // len(launches), count)
        for name, piece in pieces.items():
            collect(device, written[name], piece)


def _groups_per_launch(shape: PacketShape, bundles: Bundles) -> int:
    each = 256 * shape.blocks
    each *= shape.packets_per_group(bundles.columns, bundles.rows)
    return max(1, LAUNCH_RAYS // each)


def check_sets(sets: Sequence[Bundles], across: int = 1) -> None:
    """Raise :class:`OpticsError` for bundles that cannot be traced into one array."""
    for one in sets:
        for name, shape in (("elements", (len(one.elements), 4)), ("step", (4,))):
            array = getattr(one, name)
            if array.shape != shape or array.dtype != np.float32:
                raise OpticsError(
                    f"must be float32 of the shape {shape}, not {array.dtype} {array.shape}",
                    key=name,
                )
    inner = {(len(one.elements), one.rows, one.columns) for one in sets}
    if len(inner) != 1 or min(sets[0].rows, sets[0].columns) < 1:
        raise OpticsError(f"differ in elements or inner grids, or have none: {inner}", key="sets")
    count = len(sets[0].elements)
    if across < 1 or count % across:
        raise OpticsError(
            f"{count} elements are no whole rows of {across}",
            key="across", remedy="Give a divisor of the number of elements",
        )  # fmt: skip


def check_target(array: np.ndarray, size: int, name: str) -> None:
    """Raise :class:`OpticsError` unless ``array`` is contiguous memory of that size and type."""
    dtype = np.dtype(np.int32 if name == "triangle" else np.float32)
    if not array.flags.c_contiguous or array.dtype != dtype or array.size != size:
        raise OpticsError(
            f"must be {size} contiguous {dtype}, not {array.dtype} of the shape {array.shape}"
            + ("" if array.flags.c_contiguous else ", not contiguous"),
            key="out",
        )

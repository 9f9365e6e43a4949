"""Trace rays into arrays of the host: hits, radiance, and the hits of single rays.

Arguments are checked here, before a kernel reads them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.bundles import Bundles
from lfcore.tracing.job import PacketJob
from lfcore.tracing.packets import Groups, PacketShape

DEVICE_RAYS = 1 << 24
"""The rays whose results a device with its own memory holds at a time."""


def fill_arrays(
    job: PacketJob,
    sets: Sequence[Bundles],
    coordinates: np.ndarray | None,
    arrays: Mapping[str, np.ndarray],
    *,
    across: int = 1,
    **inputs: Any,
) -> None:
    """Trace bundles into arrays of the host, in the order of elements.

    Parameters
    ----------
    sets : bundles with equal numbers of elements and equal inner grids; their radiance is added.
    coordinates : of the elements, as for :meth:`lfcore.tracing.tracer.Tracer.bundle_hits`.
    arrays : the sink's output arguments.
    across : elements in a row of an image: element e is at row e // across, column e % across.
    inputs : the sink's other arguments.

    Raises
    ------
    OpticsError : bundles or coordinates of another shape or type.
    """
    check_sets(sets, across)
    first, device = sets[0], job.scene.device
    count, rays = len(first.elements), first.columns * first.traced_rows
    # A CPU writes the host's memory without copies, so one chunk suffices.
    step = count if device.is_cpu else max(1, DEVICE_RAYS // (across * rays)) * across
    for start in range(0, count, max(1, step)):
        stop = min(start + step, count)
        pieces = {
            name: array.reshape(-1)[start * array.size // count : stop * array.size // count]
            for name, array in arrays.items()
        }
        written: dict[str, Any] = {
            name: device.target_buffer(piece) for name, piece in pieces.items()
        }
        parts = [replace(whole, elements=whole.elements[start:stop]) for whole in sets]
        places = None if coordinates is None else np.asarray(coordinates)[start:stop]
        for order, bundles in enumerate(parts):
            groups = _groups(job.shape, bundles, places)
            job.launch(bundles, groups, across=across, add=order > 0, **written, **inputs)
        for name, piece in pieces.items():
            device.collect(written[name], piece)


def _groups(shape: PacketShape, bundles: Bundles, places: np.ndarray | None) -> Groups:
    if places is not None and places.shape != (len(bundles.elements), 2):
        raise OpticsError(
            f"must have the shape {(len(bundles.elements), 2)}, not {places.shape}",
            key="coordinates",
        )
    groups = Groups.of(shape, bundles, places)
    if np.count_nonzero(groups.members >= 0) != len(bundles.elements):
        raise OpticsError(
            "two elements have the same place", key="coordinates",
            remedy="Give each place once, or no coordinates",
        )  # fmt: skip
    return groups


def check_sets(sets: Sequence[Bundles], across: int = 1) -> None:
    """Raise :class:`OpticsError` for bundles that cannot be traced into one array."""
    for bundles in sets:
        for name, shape in (("elements", (len(bundles.elements), 4)), ("step", (4,))):
            array = getattr(bundles, name)
            if array.shape != shape or array.dtype != np.float32:
                raise OpticsError(
                    f"must be float32 of the shape {shape}, not {array.dtype} {array.shape}",
                    key=name,
                )
    inner = {(len(bundles.elements), bundles.rows, bundles.columns) for bundles in sets}
    if len(inner) != 1 or min(sets[0].rows, sets[0].columns) < 1:
        raise OpticsError(f"differ in elements or inner grids, or have none: {inner}", key="sets")
    count = len(sets[0].elements)
    if across < 1 or count % across:
        raise OpticsError(
            f"{count} elements do not fill rows of {across}",
            key="across", remedy="Give a divisor of the number of elements",
        )  # fmt: skip

"""Radiance of bundles as floats, written by the device straight to where the caller wants it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import cl
from lfcore.opencl.host_memory import check_target, collect, target_buffer
from lfcore.optics.bundles import Bundles
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.layouts import ADD, DEPTHS, IMAGE_ARGUMENTS, STREAM, record
from lfcore.tracing.packets import Groups, PacketShape

CHUNK_RAYS = 1 << 24
"""Rays whose radiance a device with memory of its own holds at a time."""
LAUNCH_RAYS = 1 << 22
"""Rays of one launch: progress is told between launches."""
STREAM_BYTES = 32 << 20
"""Results larger than this go past the caches, which would not hold them until they are read."""


class TraceRadiance:
    """Launches of ``trace_radiance`` (entry/radiance.cl) that make one image out of bundles.

    It has ``across`` elements to a row of tiles.

    Parameters
    ----------
    sets : bundles of as many elements and equal inner grids, whose radiance is added up.
    coordinates : of the elements, as for :meth:`Tracer.bundle_hits`.
    across : element e is tile (e // across, e % across).

    Raises
    ------
    OpticsError : sets that differ in shape, or elements that are no whole rows of tiles.
    """

    def __init__(
        self,
        scene: DeviceScene,
        shape: PacketShape,
        sets: Sequence[Bundles],
        coordinates: np.ndarray | None,
        across: int,
    ):
        inner = {(len(one.elements), one.rows, one.columns) for one in sets}
        if len(inner) != 1:
            raise OpticsError(f"differ in their elements or inner grids: {inner}", key="sets")
        if across < 1 or len(sets[0].elements) % across:
            raise OpticsError(
                f"{len(sets[0].elements)} elements are no whole rows of {across} tiles",
                key="across", remedy="Give a divisor of the number of elements",
            )  # fmt: skip
        self.scene, self.shape = scene, shape
        self.sets, self.coordinates, self.across = list(sets), coordinates, across
        self.kernel = scene.kernel("radiance.cl", "trace_radiance", shape, {})
        self.scratch = self.kernel.scratch(scene.shadow_lights)

    def run(
        self,
        image: np.ndarray,
        progress: Callable[[int, int], None] | None = None,
        depth: np.ndarray | None = None,
    ) -> None:
        """Write ``image``, (E / across rows, across columns, 3) float32 contiguous.

        ``depth`` (E, rows, columns) float32 contiguous receives those of the rays, of one set.
        The first axes of both may be split: only their sizes are checked.

        Raises :class:`OpticsError` for arrays that do not hold exactly that.
        """
        first, device = self.sets[0], self.scene.device
        count = len(first.elements)
        rays = count * first.rows * first.columns
        check_target(image, 3 * rays, "out")
        if depth is not None:
            check_target(depth, rays, "depth")
        row_of_tiles = self.across * first.rows * first.columns
        # A CPU writes the host's own memory; nothing is copied, so nothing need be cut.
        rows = max(1, count if device.is_cpu else CHUNK_RAYS // max(1, row_of_tiles))
        step, flat, far = rows * self.across, image.reshape(-1), np.empty(0, np.float32)
        for start in range(0, count, step):
            part = slice(start, min(start + step, count))
            size = 3 * first.rows * first.columns
            piece = flat[part.start * size : part.stop * size]
            if depth is not None:
                far = depth.reshape(-1)[part.start * size // 3 : part.stop * size // 3]
            tell = progress if step >= count else None
            self._chunk(part, piece, far, tell)
            if progress and tell is None:
                progress(part.stop, count)

    def _chunk(
        self,
        part: slice,
        piece: np.ndarray,
        far: np.ndarray,
        progress: Callable[[int, int], None] | None,
    ) -> None:
        """Trace elements of whole rows of tiles into their contiguous piece of the image.

        ``far`` are their depths, or none.
        """
        device = self.scene.device
        target = target_buffer(device, piece)
        depth = target_buffer(device, far) if far.size else device.empty(4)
        first, shape = self.sets[0], self.shape
        places = None if self.coordinates is None else self.coordinates[part]
        packets = Groups.of(shape, first.part(part), places).members
        each = shape.blocks * 256 * shape.packets_per_group(first.columns, first.rows)
        step = max(1, LAUNCH_RAYS // each)
        every = (STREAM if piece.nbytes > STREAM_BYTES else 0) | (DEPTHS if far.size else 0)
        for start in range(0, len(packets), step):
            for number, bundles in enumerate(self.sets):
                mode = every | (ADD if number else 0)
                groups = Groups(packets[start : start + step], bundles.elements[part])
                self._launch(bundles, groups, target, depth, mode)
            if progress:
                device.queue.finish()
                progress(min(start + step, len(packets)), len(packets))
        collect(device, target, piece)
        if far.size:
            collect(device, depth, far)

    def _launch(
        self,
        bundles: Bundles,
        groups: Groups,
        target: cl.Buffer,
        depth: cl.Buffer,
        mode: int,
    ) -> None:
        scene = self.scene
        self.kernel(
            scene.workers(len(groups.members)),
            **scene.tree,
            **scene.surfaces,
            **scene.rays(bundles, groups, self.shape, self.scratch),
            image=record(IMAGE_ARGUMENTS, across=self.across, mode=mode),
            radiance=target,
            depth=depth,
        )

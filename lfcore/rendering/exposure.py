"""Rays of an open shutter: each view of a light field at an instant of its own."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lfcore.opencl.device import Device, page_aligned
from lfcore.optics.bundles import Bundles
from lfcore.optics.ray_cells import radical_order
from lfcore.refocus.two_parts import Part
from lfcore.scene.model import Scene
from lfcore.tracing.bvh_refit import MovingTree
from lfcore.tracing.tracer import Tracer


class ExposedTracer(Tracer):
    """The tracer of a scene whose shutter is open for a while.

    It is the tracer of the middle instant, and gives those of the views.

    Parameters
    ----------
    scene : Scene
        A scene with ``shutter``, its light baked.
    tree : MovingTree
        The tree of its triangles.
    device : Device
        The device.
    before : Tracer, optional
        A tracer of the scene at another instant.
    """

    def __init__(
        self, scene: Scene, tree: MovingTree, device: Device, before: Tracer | None = None
    ):
        self.moving, self._tree = scene, tree
        now = self._scene_at(0.5)
        self._held: dict[float, Tracer] = {}
        super().__init__(now, tree.at(now.triangles), device, before=before)

    def each(self, shares: Sequence[float] | np.ndarray) -> Iterator[Tracer]:
        """The tracers at shares of the shutter's time, from 0 to 1."""
        for share in shares:
            now = self._scene_at(float(share))
            yield Tracer(now, self._tree.at(now.triangles), self.device, before=self)

    def parts_at(self, shares: np.ndarray, bundles: Bundles) -> list[Part]:
        """As :meth:`Tracer.parts`, at a share (1, 1) of the shutter's time, or at four (2, 2) for
        the rays of each square of pixels."""
        # Views that follow one another often have the same times.
        held, self._held = self._held, {}
        for share in shares.ravel().tolist():
            self._held[share] = held.get(share) or next(self.each([share]))
        if shares.size == 1:
            return self._held[shares.item()].parts(bundles)
        shape = len(bundles.elements), bundles.traced_rows, bundles.columns
        parts: list[Part] = []
        for (row, column), share in np.ndenumerate(shares):
            some = bundles.every_second(row, column)
            if not some.traced_rows * some.columns:
                continue
            place = np.s_[:, (row - bundles.first_row) % 2 :: 2, column::2]
            for number, found in enumerate(self._held[share].parts(some)):
                if number == len(parts):
                    parts.append((page_aligned((*shape, 3)), page_aligned(shape)))
                    for whole in parts[number]:
                        whole[:] = 0
                for whole, array in zip(parts[number], found, strict=True):
                    whole[place] = array
        return parts

    def _scene_at(self, share: float) -> Scene:
        assert self.moving.shutter is not None
        opened, closed = self.moving.shutter
        return self.moving.at(opened + share * (closed - opened))


IN_SQUARE = np.array([[0, 2], [3, 1]])
"""The order in time of the rays of a view's square of 2 x 2 pixels."""


def ray_times(views: int) -> np.ndarray:
    """When the rays of each square of 2 x 2 pixels of each view are seen, as :func:`view_times`:
    (N N, 2, 2).

    The four times of a square are a quarter of the shutter's time apart, so that what a view misses
    is seen beside it.
    """
    count = max(views**2, IN_SQUARE.size)
    first = np.floor(view_times(views) * views**2)[:, None, None]
    return ((first + IN_SQUARE * (count // IN_SQUARE.size)) % count + 0.5) / count


def view_times(views: int) -> np.ndarray:
    """When each of N x N views is seen, as a share of the shutter's time: (N N,), i fastest.

    The times are the middles of N^2 intervals.  Each row and each column of views has one in every
    Nth of the time, as in a Latin square, so that a blur from motion is not one across the lens.
    """
    order = radical_order(views)
    i, j = np.tile(np.arange(views), views), np.repeat(np.arange(views), views)
    return (order[(i + j) % views] * views + order[i] + 0.5) / views**2


def shifted(scene: Scene, time_s: float) -> Scene:
    """The scene with a shutter that opens later."""
    assert scene.shutter is not None
    opened, closed = scene.shutter
    return replace(scene, shutter=(opened + time_s, closed + time_s))

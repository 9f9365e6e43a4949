"""Rays of an open shutter: each view of a light field at an instant of its own."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from lfcore.opencl.device import Device
from lfcore.optics.ray_cells import radical_order
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
    """

    def __init__(self, scene: Scene, tree: MovingTree, device: Device):
        self.moving, self._tree = scene, tree
        now = self._scene_at(0.5)
        super().__init__(now, tree.at(now.triangles), device)

    def each(self, shares: Sequence[float] | np.ndarray) -> Iterator[Tracer]:
        """The tracers at shares of the shutter's time, from 0 to 1."""
        for share in shares:
            now = self._scene_at(float(share))
            yield Tracer(now, self._tree.at(now.triangles), self.device)

    def _scene_at(self, share: float) -> Scene:
        assert self.moving.shutter is not None
        opened, closed = self.moving.shutter
        return self.moving.at(opened + share * (closed - opened))


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

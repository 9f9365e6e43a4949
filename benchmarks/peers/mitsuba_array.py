"""Mitsuba 3: the pictures of a camera array, by its ``batch`` sensor and direct integrator.

Data cameras are its perspective pinholes on one film, a row of the array at a time: all
of them at once would not fit into memory.  What matches and what does not is as for
``mitsuba_picture``.
"""

from __future__ import annotations

import time
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import numpy as np

from lfcore.optics.array import CameraArray
from lfcore.scene.model import Scene
from peers import mitsuba_picture as one
from peers.method import Method, Run, SkippedError

ROWS = 1  # of the array in one run


def _load(array: CameraArray) -> str:
    describe = one._here["describe"]
    mitsuba, slab = describe.mitsuba, array.as_slab()
    description = describe.all(slab.camera, slab.pixels)
    description["sensor"] = _row(mitsuba, array, len(array.rows_m) // 2)
    one._here["scene"] = mitsuba.load_dict(description)
    return mitsuba.__version__


def _row(mitsuba, array: CameraArray, row: int) -> dict:
    """The data cameras of a row: a film as wide as all of them."""
    (count, _), (width, height) = array.cameras, array.tile
    place = mitsuba.ScalarTransform4f()
    y = array.rows_m[row]
    sensors = {
        f"camera_{k}": {
            "type": "perspective",
            "to_world": place.look_at([x, y, 0], [x, y, 1], [0, -1, 0]),
            "fov": array.fov_deg,
            "fov_axis": "smaller",
            "near_clip": 0.001,
            "far_clip": 1.0e5,
        }
        for k, x in enumerate(array.columns_m)
    }
    film = {
        "type": "hdrfilm",
        "width": count * width,
        "height": height,
        "rfilter": {"type": "box"},
        "pixel_format": "rgb",
    }
    return {"type": "batch", "film": film, "sampler": {"type": "independent"}, **sensors}


def _render(seed: int) -> tuple[float, float]:
    wall, cpu = time.perf_counter(), time.process_time()
    np.asarray(one._here["describe"].mitsuba.render(one._here["scene"], spp=1, seed=seed))
    return time.perf_counter() - wall, time.process_time() - cpu


class MitsubaArray(one.MitsubaPicture):
    """One scene in Mitsuba, in a process of its own."""

    def array_method(self, array: CameraArray, scene: Scene) -> Method:
        """The rate of one row of the array, one ray a pixel.

        Raises :class:`SkippedError` where Mitsuba does not run.
        """
        seeds = iter(range(1, 1 << 30))
        try:
            version = self._pool.submit(_load, array).result()
            self._pool.submit(_render, 0).result()
        except (BrokenProcessPool, RuntimeError, ImportError) as error:
            self.close()
            why = f"{error}; LLVM: {self.llvm or 'none found'}"
            raise SkippedError(f"it does not run here, see above ({why})") from None

        def run() -> Run:
            wall, cpu = self._pool.submit(_render, next(seeds)).result()
            return Run(wall, cpu, array.cameras[0] * array.tile[0] * array.tile[1])

        note = f"Mitsuba {version}, {self._threads} threads, {array.cameras[0]} cameras a run"
        return Method(one.NAME, "array", run, f"{note}, {Path(self.llvm or '').name}")


def open_peer(scene: Scene, threads: int) -> MitsubaArray:
    """Raises :class:`SkippedError` where the package is missing."""
    return MitsubaArray(scene, threads)

"""Embree through ``embreex``: single rays, one process per core."""

import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from importlib.metadata import version
from multiprocessing import get_context

import numpy as np

from benchmarks.peers.method import Method, Run, SkippedError
from lfcore.optics.bundles import macropixels
from lfcore.scene.model import Scene
from lfcore.timing import clocked

NAME = "embreex"
MOST_RAYS = 1 << 20

_here: dict = {}


def _open(triangles: np.ndarray) -> None:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    _here["scene"] = EmbreeScene()
    _here["mesh"] = TriangleMesh(_here["scene"], triangles)


def _set_rays(origins: np.ndarray, directions: np.ndarray) -> None:
    _here["rays"] = origins, directions
    _trace()


def _trace() -> tuple[float, int, float]:
    run = partial(_here["scene"].run, *_here["rays"], query="INTERSECT", output=1)
    found, cpu = clocked(run, clock=time.process_time)
    seen = found["primID"] >= 0
    return cpu, int(seen.sum()), float(found["tfar"][seen].sum(dtype=np.float64))


class EmbreexRays:
    """``threads`` processes that each hold the scene and their share of the rays."""

    def __init__(self, scene: Scene, threads: int):
        try:
            self._version = version("embreex")
        except ModuleNotFoundError:
            raise SkippedError("the package embreex is not installed") from None
        spawn = get_context("spawn")
        self._pools = [
            ProcessPoolExecutor(1, spawn, _open, (np.ascontiguousarray(scene.triangles),))
            for _ in range(threads)
        ]

    def methods(self, sample) -> list[Method]:
        """Visibility of at most MOST_RAYS rays of ``sample``, by evenly chosen pixels."""
        pixels = sample.thinned(MOST_RAYS)
        origins, directions = macropixels(sample.slab, pixels).rays()
        parts = len(self._pools)
        shares = [
            np.array_split(a.reshape(-1, 3).astype(np.float32), parts)
            for a in (origins, directions)
        ]
        ready = [
            pool.submit(_set_rays, *share)
            for pool, *share in zip(self._pools, *shares, strict=True)
        ]
        for one in ready:
            one.result()
        count, last = origins[..., 0].size, {}

        def run() -> Run:
            answers, wall = clocked(
                lambda: [one.result() for one in [pool.submit(_trace) for pool in self._pools]]
            )
            cpu, hits, depth = map(sum, zip(*answers, strict=True))
            last["check"] = hits / count, depth / max(hits, 1)
            return Run(wall, cpu, count)

        note = f"embreex {self._version}, single rays, {parts} processes, {count} of the rays"
        return [Method(NAME, "visibility", run, note, lambda: last.get("check"))]

    def close(self) -> None:
        for pool in self._pools:
            pool.shutdown()

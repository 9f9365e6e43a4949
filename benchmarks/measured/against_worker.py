"""One of two programs that take turns: run by ``benchmarks/against.py`` with a checkout's folder.

It reads cases as lines of JSON, and answers each with what it took.  Only what has long been public
is called, so that old commits can be asked, too.
"""

import functools
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

ROOT = Path(sys.argv[1]).resolve()
sys.path[0] = str(ROOT)

import numpy as np  # noqa: E402

import lfcore  # noqa: E402
from lfcore import load_scene  # noqa: E402
from lfcore.optics.bundles import macropixels, views  # noqa: E402
from lfcore.optics.planes import SensorPlane  # noqa: E402
from lfcore.optics.slab import Slab  # noqa: E402
from lfcore.scene.model import Scene  # noqa: E402
from lfcore.storage.layout import FrameLayout, Tile  # noqa: E402
from lfcore.tracing.bvh import build_bvh  # noqa: E402
from lfcore.tracing.tracer import Tracer  # noqa: E402

PLANES = 5
SQUARES = {"hits": 8, "radiance": 8, "frames": 4}
"""Along a side of the picture, one in the middle of each cell."""


@functools.cache
def opened(name: str) -> tuple[Scene, Tracer]:
    scene = load_scene(ROOT / "scenes" / name / "scene.yaml")
    return scene, Tracer(scene, build_bvh(scene.triangles))


def squares(count: int, pixels: int, rays: float, views: int) -> tuple[int, np.ndarray]:
    """The side of so many squares a side, and their first pixels (S, 2), multiples of four."""
    cell = pixels // count
    wanted = np.sqrt(rays / count**2) / views
    side = min(cell, max(4, 1 << max(0, round(float(np.log2(wanted))))))
    first = np.arange(count) * cell + (cell - side) // 2 // 4 * 4
    return side, np.stack(np.meshgrid(first, first), -1).reshape(-1, 2)


@functools.cache
def work_of(line: str) -> Callable[[], object]:
    """What to run of a case."""
    case = json.loads(line)
    scene, tracer = opened(case["scene"])
    slab = Slab(scene.camera, case["views"], case["pixels"])
    if case["work"] == "views":
        step = max(1, round(slab.views**2 * slab.pixels**2 / (case["mrays"] * 1e6)))
        j, i = np.divmod(np.arange(0, slab.views**2, step), slab.views)
        bundles = views(slab, np.stack([i, j], 1))
        return lambda: tracer.radiance_and_depth(bundles)
    count = SQUARES[case["work"]]
    side, corners = squares(count, slab.pixels, case["mrays"] * 1e6, slab.views)
    if case["work"] != "frames":
        v, u = np.divmod(np.arange(side**2), side)
        pixels = (corners[:, None] + np.stack([u, v], 1)).reshape(-1, 2).astype(np.int32)
        if case["work"] == "hits":
            return lambda: tracer.slab_hits(slab, pixels)
        return lambda: tracer.bundle_radiance(macropixels(slab, pixels), pixels)
    near, far = min(scene.focus_distances_m), max(scene.focus_distances_m)
    planes = [
        SensorPlane(float(1 / d), scene.camera.f_number, "circle" if k else "square")
        for k, d in enumerate(np.linspace(1 / near, 1 / far, PLANES))
    ]
    layout = FrameLayout("macropixels", slab.views, slab.pixels, "raster")
    tiles = [Tile(layout, 0, int(u), int(v), side, side) for u, v in corners]

    def frames() -> None:
        for tile in tiles:
            for _ in tracer.trace_tile(slab, tile, planes):
                pass

    return frames


def main() -> None:
    assert Path(lfcore.__file__).is_relative_to(ROOT), "another checkout was imported"
    for line in sys.stdin:
        work = work_of(line)
        begun = time.process_time()
        work()
        taken = time.process_time() - begun
        print(json.dumps({"seconds": taken}), flush=True)


if __name__ == "__main__":
    main()

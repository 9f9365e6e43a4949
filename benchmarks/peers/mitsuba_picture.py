"""Mitsuba 3: a picture through a thin lens, by its direct integrator.

The same: triangles, interpolated normals, texture coordinates and textures, diffuse colour, camera,
lens and focus, lights that cast shadows, one shadow ray per camera ray.
Different: Mitsuba has no Blinn-Phong lobe (materials with a highlight are rough plastic of about
that width), no ambient light (we add none, which saves Mitsuba a second ray) and no lights without
shadows (left out); it does not filter textures by their footprint, and draws points of the round
lens at random.
"""

import itertools
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.peers.method import Method, Run, SkippedError, check_installed
from lfcore.scene.mitsuba import Description, thin_lens
from lfcore.scene.model import Scene
from lfcore.timing import clocked

NAME = "mitsuba llvm_ad_rgb"
SAMPLES = 32
LLVM = "DRJIT_LIBLLVM_PATH"

_here: dict = {}


def newest_llvm() -> str | None:
    """The newest of the system's LLVM libraries: 15 cannot select some 16-wide instructions."""
    found = {}
    for path in Path("/usr/lib").glob("*/libLLVM*.so*"):
        digits = [part for part in path.name.replace("-", ".").split(".") if part.isdigit()]
        if digits:
            found[int(digits[0])] = str(path)
    return found[max(found)] if found else None


def _open(scene: Scene, threads: int, llvm: str | None) -> None:
    if llvm:
        os.environ[LLVM] = llvm
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    import drjit

    drjit.set_thread_count(threads)
    _here["describe"] = Description(mitsuba, scene, leave_out_ambient=True)


def _load(slab) -> str:
    describe = _here["describe"]
    sensor = thin_lens(describe.mitsuba, slab.camera, slab.pixels)
    _here["scene"] = describe.mitsuba.load_dict(describe.all(sensor))
    return describe.mitsuba.__version__


def _render(samples: int, seed: int) -> tuple[float, float, np.ndarray]:
    render = partial(_here["describe"].mitsuba.render, _here["scene"], spp=samples, seed=seed)
    work = partial(clocked, lambda: np.asarray(render()), clock=time.process_time)
    (picture, cpu), wall = clocked(work)
    return wall, cpu, picture


class MitsubaPicture:
    """One scene in Mitsuba, in a process of its own: a compiler that fails ends only that."""

    def __init__(self, scene: Scene, threads: int):
        check_installed("mitsuba")
        self.llvm, self._threads = os.environ.get(LLVM) or newest_llvm(), threads
        arguments = scene, threads, self.llvm
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), _open, arguments)

    def methods(self, sample) -> list[Method]:
        """The rate of one whole picture of the sample's slab, SAMPLES rays per pixel and run.

        The rate hardly depends on the samples per pixel; N x N would take minutes at large N.
        """
        slab = sample.slab
        count = min(SAMPLES, slab.views**2)
        rays, note = slab.pixels**2 * count, f"{count} samples per pixel"
        return [self.rendered("algorithm1", _load, slab, count, rays, note)]

    def rendered(
        self, work: str, load: Callable, what: object, samples: int, rays: int, note: str
    ) -> Method:
        """The rate of pictures of the scene that ``load(what)`` makes, with ``rays`` rays in all.

        Raises :class:`SkippedError` if Mitsuba does not run.
        """
        seeds = itertools.count(1)
        try:
            version = self._pool.submit(load, what).result()
            self._pool.submit(_render, 1, 0).result()
        except (BrokenProcessPool, RuntimeError, ImportError) as error:
            self.close()
            why = f"{error}; LLVM: {self.llvm or 'none found'}"
            raise SkippedError(f"it does not run here, see above ({why})") from None

        def run() -> Run:
            wall, cpu, _ = self._pool.submit(_render, samples, next(seeds)).result()
            return Run(wall, cpu, rays)

        parts = (f"Mitsuba {version}", f"{self._threads} threads", note, Path(self.llvm or "").name)
        return Method(NAME, work, run, ", ".join(parts))

    def close(self) -> None:
        self._pool.shutdown()

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
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

from benchmarks.peers.method import Method, Renderer, Run, Samples, check_installed, clocked
from lfcore.scene.mitsuba import Description, thin_lens
from lfcore.scene.model import Scene

NAME = "mitsuba llvm_ad_rgb"
SAMPLES = 32
LLVM = "DRJIT_LIBLLVM_PATH"
NEEDS = "mitsuba-oidn and LLVM 16 or later"
PASS_RAYS = 1 << 23
"""The most rays of a pass; more take Mitsuba tens of bytes each and are no faster."""

_here: dict = {}


def chosen_llvm() -> str | None:
    """The library of LLVM that is asked for, or the system's newest: 15 cannot select some 16-wide
    instructions."""
    if LLVM in os.environ:
        return os.environ[LLVM]
    found = {}
    for path in Path("/usr/lib").glob("*/libLLVM*.so*"):
        digits = [part for part in path.name.replace("-", ".").split(".") if part.isdigit()]
        if digits:
            found[int(digits[0])] = str(path)
    return found[max(found)] if found else None


def start(threads: int, llvm: str | None) -> ModuleType:
    """Mitsuba in this process."""
    if llvm:
        os.environ[LLVM] = llvm
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    import drjit

    drjit.set_thread_count(threads)
    return mitsuba


def render(
    mitsuba: ModuleType, scene: object, pixels: int, samples: Samples, seed: int, **how: object
) -> tuple[np.ndarray, float]:
    """((pixels, pixels, 3) float32 linear light, core seconds): in passes, denoised if asked.

    Channels after the first three are albedo and normals.
    """
    begun = time.process_time()
    passes = max(1, pixels**2 * samples.per_pixel // PASS_RAYS)
    spp = samples.per_pixel // passes
    picture = np.mean([
        np.array(mitsuba.render(scene, spp=spp, seed=passes * seed + number, **how))
        for number in range(passes)
    ], axis=0)  # fmt: skip
    parts = [np.ascontiguousarray(picture[..., k : k + 3], np.float32) for k in (0, 3, 6)]
    if samples.denoise:
        import mitsuba_oidn

        more = {"albedo": parts[1], "normal": parts[2]} if samples.denoise == "auxiliary" else {}
        parts[0] = mitsuba_oidn.denoise(parts[0], **more, hdr=True)
    return np.asarray(parts[0], np.float32), time.process_time() - begun


def _open(scene: Scene, threads: int, llvm: str | None) -> None:
    mitsuba = start(threads, llvm)
    _here["describe"] = Description(mitsuba, scene, leave_out_ambient=True)


def _load(slab) -> str:
    describe = _here["describe"]
    sensor = thin_lens(describe.mitsuba, slab.camera, slab.pixels)
    _here["scene"] = describe.mitsuba.load_dict(describe.all(sensor))
    return describe.mitsuba.__version__


def _clocked(samples: int, rays: int, seed: int) -> Run:
    render = partial(_here["describe"].mitsuba.render, _here["scene"], spp=samples, seed=seed)
    return clocked(lambda: np.asarray(render()), rays)


class MitsubaPicture(Renderer):
    """One scene in Mitsuba, whose rate is measured."""

    def __init__(self, scene: Scene, threads: int):
        check_installed("mitsuba")
        self.llvm, self._threads = chosen_llvm(), threads
        needs = f"LLVM, found: {self.llvm or 'none'}"
        super().__init__(_open, (scene, threads, self.llvm), render, needs)

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
        """The rate of pictures of the scene that ``load(what)`` makes, of ``rays`` in all."""
        version, seeds = self.ask(load, what), itertools.count(1)
        self.ask(_clocked, 1, 0, 0)
        parts = (f"Mitsuba {version}", f"{self._threads} threads", note, Path(self.llvm or "").name)
        run = lambda: self.ask(_clocked, samples, rays, next(seeds))  # noqa: E731
        return Method(NAME, work, run, ", ".join(parts))

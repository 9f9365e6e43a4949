"""Mitsuba 3: pictures through a thin lens, or of a camera array, by its direct integrator.

The same: triangles, interpolated normals, texture coordinates and textures, diffuse colour, camera,
lens and focus, lights that cast shadows, one shadow ray per camera ray.
Different: Mitsuba has no Blinn-Phong lobe (materials with a highlight are rough plastic of about
that width), no ambient light (we add none, which saves Mitsuba a second ray) and no lights without
shadows (left out); it does not filter textures by their footprint, and draws points of the round
lens at random.

Of an array a row of data cameras is on one film: the whole array would not fit into memory.
"""

import itertools
import os
import time
from functools import partial
from pathlib import Path
from types import ModuleType

import numpy as np

from benchmarks.peers.method import Method, Renderer, Samples, check_installed, core_seconds
from lfcore.optics.array import CameraArray
from lfcore.optics.slab import Slab
from lfcore.scene.mitsuba import Description, film, thin_lens
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


def _load(seen: Slab | CameraArray) -> str:
    describe = _here["describe"]
    mitsuba = describe.mitsuba
    if isinstance(seen, Slab):
        sensor = thin_lens(mitsuba, seen.camera, seen.pixels)
    else:
        sensor = _row(mitsuba, seen)
    _here["scene"] = mitsuba.load_dict(describe.all(sensor))
    return mitsuba.__version__


def _row(mitsuba: ModuleType, array: CameraArray) -> dict:
    """The data cameras of the middle row: a film as wide as all of them."""
    place, y = mitsuba.ScalarTransform4f(), array.rows_m[len(array.rows_m) // 2]
    sensors = {
        f"camera_{k}": {
            "type": "perspective", "fov": array.fov_deg, "fov_axis": "smaller",
            "to_world": place.look_at([x, y, 0], [x, y, 1], [0, -1, 0]),
            "near_clip": 0.001, "far_clip": 1.0e5,
        }
        for k, x in enumerate(array.columns_m)
    }  # fmt: skip
    width, height = array.cameras[0] * array.tile[0], array.tile[1]
    shared = {"film": film(width, height), "sampler": {"type": "independent"}}
    return {"type": "batch", **shared, **sensors}


def _clocked(samples: int, seed: int) -> float:
    render = partial(_here["describe"].mitsuba.render, _here["scene"], spp=samples, seed=seed)
    return core_seconds(lambda: np.asarray(render()))


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
        note = f"{count} samples per pixel"
        return [self._rendered("algorithm1", slab, count, slab.pixels**2 * count, note)]

    def of_array(self, array: CameraArray) -> Method:
        """The rate of one row of the array, one ray per pixel."""
        cameras, (width, height) = array.cameras[0], array.tile
        rays = cameras * width * height
        return self._rendered("array", array, 1, rays, f"{cameras} cameras per run")

    def _rendered(
        self, work: str, seen: Slab | CameraArray, samples: int, rays: int, note: str
    ) -> Method:
        """The rate of pictures of ``rays`` in all."""
        version, seeds = self.ask(_load, seen), itertools.count(1)
        self.ask(_clocked, 1, 0)
        parts = (f"Mitsuba {version}", f"{self._threads} threads", note, Path(self.llvm or "").name)
        run = lambda: self.ask(_clocked, samples, next(seeds))  # noqa: E731
        return Method(NAME, work, rays, run, ", ".join(parts))

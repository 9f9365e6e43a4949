"""Mitsuba 3 in a process: its compiler, and rendering in passes."""

import os
import time
from pathlib import Path
from types import ModuleType

import numpy as np

from benchmarks.peers.method import Samples

LLVM = "DRJIT_LIBLLVM_PATH"
NEEDS = "mitsuba-oidn and LLVM 16 or later"
PASS_RAYS = 1 << 24
"""The most rays of a pass, 64 per pixel of 512 x 512; each needs tens of bytes in Mitsuba."""


def chosen_llvm() -> str | None:
    """Return the environment's library of LLVM, or the system's newest: LLVM 15 cannot select some
    16-wide instructions."""
    if LLVM in os.environ:
        return os.environ[LLVM]
    versions = {}
    for path in Path("/usr/lib").glob("*/libLLVM*.so*"):
        digits = [part for part in path.name.replace("-", ".").split(".") if part.isdigit()]
        if digits:
            versions[int(digits[0])] = str(path)
    return versions[max(versions)] if versions else None


def start(threads: int, llvm: str | None) -> ModuleType:
    """Import Mitsuba in this process."""
    if llvm:
        os.environ[LLVM] = llvm
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    import drjit

    drjit.set_thread_count(threads)
    return mitsuba


def render(
    mitsuba: ModuleType, scene: object, pixels: int, samples: Samples, seed: int, **options: object
) -> tuple[np.ndarray, float]:
    """Render in passes; return ((pixels, pixels, 3) float32 linear light, core seconds).

    Channels after the first three are albedo and normals, for the denoiser.
    """
    begun = time.process_time()
    passes = max(1, pixels**2 * samples.per_pixel // PASS_RAYS)
    spp = samples.per_pixel // passes
    picture = np.mean([
        np.array(mitsuba.render(scene, spp=spp, seed=passes * seed + number, **options))
        for number in range(passes)
    ], axis=0)  # fmt: skip
    parts = [np.ascontiguousarray(picture[..., k : k + 3], np.float32) for k in (0, 3, 6)]
    if samples.denoise:
        more = {"albedo": parts[1], "normal": parts[2]} if samples.denoise == "auxiliary" else {}
        parts[0] = denoised(parts[0], **more)
    return np.asarray(parts[0], np.float32), time.process_time() - begun


def denoised(picture: np.ndarray, **more: np.ndarray) -> np.ndarray:
    """Denoise a picture of linear light, by Intel's denoiser."""
    import mitsuba_oidn

    return np.asarray(mitsuba_oidn.denoise(picture, **more, hdr=True))

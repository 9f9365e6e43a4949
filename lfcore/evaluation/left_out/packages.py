"""Packages that a job does not load: seconds and memory of a process with and without them.

The process traces two triangles, without a texture or a file.
"""

import json
import subprocess
import sys
from collections.abc import Iterator

import numpy as np

from lfcore.errors import LfcoreError
from lfcore.evaluation.stability.tested_tracer import CAMERA, bare_scene
from lfcore.opencl.device import open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_planes
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

TURNS = 2
TRIANGLES = np.array(
    [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]], np.float32
)
PROGRAM = """
import hashlib, json, os, pathlib, sys, time
begun = time.perf_counter()
for name in sys.argv[1:]:
    __import__(name)
from lfcore.evaluation.left_out.packages import picture
seconds = time.perf_counter() - begun
unwanted = [name for name in ("av", "cv2") if name in sys.modules]
pages = pathlib.Path("/proc/self/statm")  # Linux alone; elsewhere bytes are not measured
memory = int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if pages.exists() else 0
digest = hashlib.sha256(picture().tobytes()).hexdigest()
print(json.dumps([seconds, memory, digest, unwanted]))
"""


def picture() -> np.ndarray:
    """(16, 16, 3) float32 with 8 x 8 rays per pixel."""
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    plane = SensorPlane(CAMERA.focus_m, CAMERA.f_number)
    return trace_planes(tracer, Slab(CAMERA, 8, 16), [plane])[0]


def packages(scene: Scene) -> Iterator[dict]:
    """PyAV, where nothing is stored; OpenCV, where nothing is textured."""
    lean = [_run() for _ in range(TURNS)]
    yield _package("av", lean, "the video library, where the light field is not stored")
    if not Needs.of(scene).textures:
        yield _package("cv2", lean, "the picture library, where no texture is filtered")


def _package(name: str, lean: list[list], what: str) -> dict:
    full = [_run(name) for _ in range(TURNS)]
    if any(name in run[3] for run in lean):
        raise LfcoreError(f"{name} is loaded by a job that does not need it", key=name)
    seconds, memory = (
        [float(np.median([run[k] for run in runs])) for runs in (full, lean)] for k in (0, 1)
    )
    return {
        "feature": f"package: {name}",
        "what": f"{what}; seconds of loading, bytes of a process",
        "seconds_full": seconds[0],
        "seconds_left_out": seconds[1],
        "bytes_saved": int(memory[0] - memory[1]),
        "identical": len({run[2] for run in (*full, *lean)}) == 1,
    }


def _run(*names: str) -> list:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, *names], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise LfcoreError(f"a process without {names} failed: {done.stderr.strip()[-400:]}")
    return json.loads(done.stdout.splitlines()[-1])

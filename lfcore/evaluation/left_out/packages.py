"""Packages that a job does not load: seconds and memory of a process with and without them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator

import numpy as np

from lfcore.errors import LfcoreError
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs

TURNS = 2
PROGRAM = """
import hashlib, json, os, pathlib, sys, time
begun = time.perf_counter()
for name in sys.argv[1:]:
    __import__(name)
from lfcore.evaluation.left_out.minimal_job import plane_sums
seconds = time.perf_counter() - begun
unwanted = [name for name in ("av", "cv2") if name in sys.modules]
pages = pathlib.Path("/proc/self/statm")  # Linux alone; elsewhere bytes are not measured
memory = int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") if pages.exists() else 0
digest = hashlib.sha256(plane_sums().tobytes()).hexdigest()
print(json.dumps([seconds, memory, digest, unwanted]))
"""


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

"""What a job costs before its first ray: imports, driver, loading, building the program."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.measured.rows import say
from benchmarks.measured.scenes import SCENES
from lfcore.scene.build import build_scene
from lfcore.scene.files import save_scene
from lfcore.timing import clocked
from lfcore.tracing.bvh import build_bvh, save_bvh

ROOT = Path(__file__).resolve().parents[2]
JOB = """
import json, sys, time
clock = time.perf_counter
marks = [clock()]
from lfcore.optics.slab import Slab
from lfcore.scene.files import load_scene
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer
marks.append(clock())
from lfcore.opencl.device import open_device
device = open_device()
marks.append(clock())
scene, bvh = load_scene(sys.argv[1]), load_bvh(sys.argv[2])
marks.append(clock())
tracer = Tracer(scene, bvh, device)
marks.append(clock())
tile = FrameLayout("macropixels", 16, 64).tile(0, 0, 4, 4)
for _ in range(2):
    for _ in tracer.trace_tile(Slab(scene.camera, 16, 64), tile):
        pass
    marks.append(clock())
steps = [b - a for a, b in zip(marks, marks[1:])]
steps[4] -= steps[5]
names = ("imports", "driver", "load_files", "pack_and_upload", "program", "first_tile")
print(json.dumps(dict(zip(names, steps))))
"""


def _job(cache: Path, scene: Path, bvh: Path) -> dict[str, float]:
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", JOB, str(scene), str(bvh)]
    done, total = clocked(
        lambda: subprocess.run(
            command, env=environment, capture_output=True, text=True, check=False
        )
    )
    if done.returncode:
        raise SystemExit(f"the job of --fixed failed:\n{done.stderr}")
    steps = json.loads(done.stdout.splitlines()[-1])
    return {"start_and_exit": total - sum(steps.values()), **steps, "whole": total}


def fixed(options) -> list[dict]:
    """Seconds of each step of a job of one small tile, in processes of their own: the first with
    empty caches, then ``options.repeats`` with what it left (medians)."""
    rows = []
    for name in options.scenes:
        say(f"a job of {name}")
        built = build_scene(SCENES / name / "scene.yaml")
        with tempfile.TemporaryDirectory(prefix="fixed-cost-") as folder:
            scene, bvh = Path(folder) / "scene.npz", Path(folder) / "bvh.npz"
            save_scene(scene, built)
            save_bvh(bvh, build_bvh(built.triangles))
            cold = _job(Path(folder), scene, bvh)
            warm = [_job(Path(folder), scene, bvh) for _ in range(options.repeats)]
        middle = {key: float(np.median([one[key] for one in warm])) for key in cold}
        for label, steps, goal in (("cold", cold, None), ("warm", middle, 2.0)):
            rows.append(
                {"scene": name, "caches": label, **steps, "goal_seconds": goal, "work": "fixed"}
            )
    return rows

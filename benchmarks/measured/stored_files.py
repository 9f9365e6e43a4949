"""Memory to record and to retrieve whole files at several N, and the cost of random access."""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.measured.rows import say
from benchmarks.measured.scenes import SCENES
from lfcore.storage.lightfield import LightFieldFile
from lfcore.timing import clocked

ROOT = Path(__file__).resolve().parents[2]
GROWTH_LIMIT = 1.05
VIEWS, SIDE = (64, 128, 256, 512), 1 << 14
"""Each N, and M N: each has as many rays, more than the buffers hold."""
JOB = """
import sys
from pathlib import Path
from lfcore.api import load_scene, record
from lfcore.optics.planes import SensorPlane
from lfcore.refocus.slicing import form_planes
from lfcore.storage.codecs import Encoding
what, scene, path = sys.argv[1], Path(sys.argv[2]), sys.argv[5]
views, pixels = map(int, sys.argv[3:5])
scene_ = load_scene(scene)
if what == "record":
    record(scene_, path, views=views, pixels=pixels, encoding=Encoding(depth=False))
elif what == "retrieve":
    camera = scene_.camera
    planes = [SensorPlane(d, camera.f_number) for d in scene_.focus_distances_m]
    form_planes(path, (planes * 10)[:10])
# Not getrusage: its peak is that of the parent process, if larger.
status = Path("/proc/self/status").read_text().splitlines()
print(next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024)
"""


def memory(scene: str, folder: Path) -> list[dict]:
    """Peak resident memory of a process of its own for each N; the files stay in ``folder``."""
    rows = []
    for what in ("record", "retrieve"):
        first = None
        for n in VIEWS:
            pixels = SIDE // n
            peak = _peak_mib(what, scene, n, pixels, file_of(folder, n))
            first = peak if first is None else first
            say(f"{what} N = {n}, M = {pixels}: {peak:.0f} MiB")
            rows.append({
                "part": "memory", "scene": scene, "N": n, "M": pixels, "what": what,
                "peak_mib": peak, "against": f"N = {VIEWS[0]}", "ratio": peak / first,
                "limit": GROWTH_LIMIT, "holds": peak / first <= GROWTH_LIMIT,
            })  # fmt: skip
    return rows


def file_of(folder: Path, views: int) -> Path:
    return folder / f"N{views}.mkv"


def _peak_mib(what: str, scene: str, views: int, pixels: int, path: Path) -> float:
    arguments = [what, SCENES / scene / "scene.yaml", views, pixels, path]
    done = subprocess.run(
        [sys.executable, "-c", JOB, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        sys.exit(f"{what} at N = {views} failed: {done.stderr[-2000:]}")
    return float(done.stdout.splitlines()[-1])


def random_access(scene: str, folder: Path) -> list[dict]:
    """One view, one macropixel and a rectangle of (u, v) of each file, opened afresh."""
    rows = []
    for n in VIEWS:
        path = file_of(folder, n)
        for what, read in _reads(LightFieldFile.open(path)):
            field = LightFieldFile.open(path)
            picture, seconds = clocked(partial(read, field))
            touched = sorted(field.decoded_segments)
            size = sum(field.metadata.segments[k].bytes for k in touched)
            whole = field.layout.frame_bytes * field.metadata.frames
            rows.append({
                "part": "random access", "scene": scene, "N": n, "M": field.layout.pixels,
                "what": what, "seconds": seconds, "segments": len(touched),
                "segments_of": len(field.segments), "frames_decoded": field.count.frames,
                "frames_needed": _needed(field, what), "frames_of": field.metadata.frames,
                "kib_of_segments": size / 1024, "pixels": int(np.prod(picture.shape[:-1])),
                "share_of_raw": picture.nbytes / whole,
            })  # fmt: skip
            say(f"N = {n} {what}: {seconds * 1e3:.1f} ms, {field.count.frames} frames")
    return rows


def _reads(field: LightFieldFile) -> list[tuple]:
    size, views = field.layout.pixels, field.layout.views
    u, v = size * 3 // 5, size * 2 // 3
    side = max(1, size // 8)
    return [
        ("macropixel", lambda f: f.macropixel(u, v, codes=True)),
        (f"rectangle {side} x {side}", lambda f: f.rectangle(u, v, u + side, v + side, codes=True)),
        ("view", lambda f: f.view(views // 3, views // 2, codes=True)),
    ]


def _needed(field: LightFieldFile, what: str) -> int:
    """The number of frames with a requested ray: a store of single pictures would read these."""
    layout = field.layout
    if (what == "view") == (layout.kind == "views"):
        return 1
    if what == "view":
        return field.metadata.frames
    if layout.kind == "views":
        return layout.views**2
    if what == "macropixel":
        return 1
    size, side = layout.pixels, max(1, layout.pixels // 8)
    spans = [
        (low + side - 1) // layout.pack - low // layout.pack + 1
        for low in (size * 3 // 5, size * 2 // 3)
    ]
    return spans[0] * spans[1]

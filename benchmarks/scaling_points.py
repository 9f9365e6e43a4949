"""What the scaling model is made of, and runs that it is held to: measured on this machine.

Rates of rays come from tiles that are drawn from the light field and traced in this process;
overheads from runs of the workflow with so few rays that nothing else is left.  Points are whole
runs, of other sizes, on one and two cores and through a throw-away SLURM of one and two.  Core
seconds are those of all processes below this one, SLURM's among them; wall seconds say something
where ``others`` (cores that other programs used meanwhile) is near 0.
"""

from __future__ import annotations

import ctypes
import os
import re
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from benchmarks.publish import RESULTS, ROOT, read_result
from lfcore import load_scene, record
from lfcore.optics.camera import Camera
from lfcore.optics.plane_pictures import save_stack, write_plane_pictures
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.slicing import form_planes
from lfcore.rendering.direct import finished
from lfcore.rendering.record import record_tile
from lfcore.storage.layout import Tile
from lfcore.timing import clocked
from lfcore.tracing.tile import TileTracing
from lfcore.workflow import cases, costs, scaling
from lfcore.workflow.settings import check_settings
from lfcore.workflow.tracers import open_tracer
from robustness.cluster_runs import snakemake
from robustness.kills import stat_of
from robustness.local_slurm import LocalSlurm, local_slurm

SCENES = ("bike", "cabin")
VIEWS, PIXELS, BATCHES, TILE_MIB = 64, 256, 8, 32
PILOT_PIXELS, PILOT_BATCHES = 32, (2, 8)
CAMERA = Camera(0.05, 0.036, 2.0, 3.0)
DISK_MIB = 256
"""That the disk is given to write."""
MEMORY_MIB = 12000
"""Of the node of the throw-away SLURM."""
FIRST_POLL = 5.0
"""profiles/slurm: slurm-init-seconds-before-status-checks."""
SUBREAPER = 36
STAMP = re.compile(r"\[([^]]+)\]")
EVENTS = {
    "came": "_slurm_rpc_submit_batch_job:", "began": "sched: Allocate", "ended": "_job_complete:",
}  # fmt: skip


@dataclass(frozen=True)
class Size:
    """One light field of a scene, and how the workflow is told to make it."""

    scene: str
    pixels: int
    batches: int
    tile_mib: int

    @property
    def settings(self) -> dict:
        rays = (self.pixels * VIEWS) ** 2
        minutes = rays * costs.nanoseconds_a_ray(VIEWS) * 1e-9 / 60 / self.batches
        return {
            "scenes": [self.scene], "angular_resolutions": [VIEWS],
            "spatial_resolution": self.pixels, "tile_mib": self.tile_mib,
            "job_minutes": minutes * (1 + 1e-9),
        }  # fmt: skip

    @property
    def words(self) -> list[str]:
        """Of Snakemake's command line."""
        slab = f"results/{self.scene}/M{self.pixels}/N{VIEWS}"
        settings = [f"{key}={value}" for key, value in self.settings.items()]
        made = [f"{slab}/lightfield.mkv", f"{slab}/planes/on_the_fly.npz"]
        return ["--config", *settings, "--", *made]

    @property
    def field(self) -> scaling.Recording:
        return scaling.Recording((self.pixels * VIEWS) ** 2, VIEWS, self.batches)


@dataclass(frozen=True)
class Taken:
    """Seconds of one run, cores that others used meanwhile, and what Snakemake said."""

    core_s: float
    wall_s: float
    others: float
    said: str


class Account:
    """Core seconds of all that this process has started, whoever waits for it."""

    def __init__(self) -> None:
        # What SLURM starts is nobody's child by then: it becomes ours.
        ctypes.CDLL(None).prctl(SUBREAPER, 1, 0, 0, 0)

    def seconds(self, alive: list[int]) -> float:
        """Of what has ended, and of the servers ``alive`` with what they waited for."""
        for child in _children():
            if child not in alive:
                with suppress(ChildProcessError):
                    os.waitpid(child, os.WNOHANG)
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        ticks = sum(int(part) for one in alive for part in stat_of(one)[11:15])
        return used.ru_utime + used.ru_stime + ticks / os.sysconf("SC_CLK_TCK")

    def run(self, work: Callable[[], tuple[int, str]], slurm: LocalSlurm | None = None) -> Taken:
        """What ``work`` takes, which returns a status and words."""
        alive = slurm.servers() if slurm else []
        core, wall, busy = self.seconds(alive), time.monotonic(), _busy()
        status, said = work()
        wall = time.monotonic() - wall
        busy = _busy() - busy
        if slurm:
            time.sleep(1.5)  # what kept watch over the last step has ended, too
        if status:
            raise RuntimeError(said[-3000:])
        core = self.seconds(alive) - core
        return Taken(core, wall, max(0.0, busy - core) / wall, said)


def _children() -> list[int]:
    text = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text()
    return [int(child) for child in text.split()]


def _busy() -> float:
    """Core seconds of all programs since the start of the system."""
    words = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    user, nice, system, _, _, interrupts, soft, *_ = map(int, words)
    return (user + nice + system + interrupts + soft) / os.sysconf("SC_CLK_TCK")


def local(account: Account, folder: Path, size: Size, cores: int, *more: str) -> Taken:
    """A run on this machine alone, in a folder that must be new."""

    def work() -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, "-m", "lfcore.workflow.run", "--cores", str(cores),
             "--directory", str(folder), *more, *size.words],
            cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout

    folder.mkdir(parents=True)
    return account.run(work)


def through_slurm(account: Account, slurm: LocalSlurm, folder: Path, size: Size) -> Taken:
    """A run through SLURM, with the project's profile."""
    return account.run(lambda: snakemake(slurm, folder, *size.words), slurm)


def rates_of(scene_folder: Path, size: Size, views: int = VIEWS, tiles: int = 4) -> scaling.Rates:
    """Of tiles spread over the light field, CPU seconds of this process with one thread."""
    settings = check_settings(size.settings | {"angular_resolutions": [views]})
    files = {name: str(scene_folder / f"{name}.npz") for name in ("scene", "bvh")}
    tracer = open_tracer(SimpleNamespace(**files), "", 1, lean=True)
    scene = tracer.scene
    slab = Slab(scene.camera, views, size.pixels)
    planes = cases.sensor_planes("scene", scene.camera, scene.focus_distances_m)
    cut = cases.tiles(settings, views)
    spec = cases.codec_spec(settings, views)
    drawn = [cut[(2 * place + 1) * len(cut) // (2 * tiles)] for place in range(tiles)]

    def trace(tile: Tile, frames: bool = False) -> TileTracing:
        return finished(tracer.trace_tile(slab, tile, planes, frames=frames))

    for frames in (True, False):  # programs are built
        trace(cut[0], frames)
    rays = size_bytes = 0
    traced = stored = 0.0
    wider = []
    with tempfile.TemporaryDirectory() as name:
        segment = Path(name) / "segment.mp4"
        for tile in drawn:
            part, seconds = clocked(
                partial(trace, tile),
                clock=time.process_time,
            )
            traced += seconds
            _, seconds = clocked(
                partial(record_tile, tracer, slab, tile, segment, spec, planes),
                clock=time.process_time,
            )
            stored += seconds
            rays += tile.rays
            size_bytes += segment.stat().st_size
            assert part.plane_sums
            high = part.plane_sums.sums.shape[2] / size.pixels
            wider.append(max(0.0, high - tile.rows / tile.layout.outer))
    each = 1e9 / rays
    return scaling.Rates(
        trace_ns=traced * each,
        encode_ns=(stored - traced) * each,
        bytes_a_ray=size_bytes / rays,
        blur=statistics.fmean(wider),
        planes=len(planes),
    )


def retrieve_ns(scene: str, views: int = 512, pixels: int = 32) -> float:
    """Core time of a ray while a scene's sensor planes are formed from a stored light field."""
    loaded = load_scene(ROOT / "scenes" / scene)
    planes = cases.sensor_planes("scene", loaded.camera, loaded.focus_distances_m)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "field.mkv"
        record(loaded, path, views=views, pixels=pixels).close()
        _, seconds = clocked(lambda: form_planes(path, planes, threads=1), clock=time.process_time)
    return seconds * 1e9 / (views * pixels) ** 2


def sum_bytes_s(pixels: int = 512, planes: int = 5, parts: int = 8) -> float:
    """Bytes of parts of planes that a core reads and adds up in a second."""
    slab = Slab(CAMERA, 8, pixels)
    wanted = [SensorPlane(2.0 + place, 2.0) for place in range(planes)]
    part = PlaneSums(slab, wanted, np.ones((planes, 3, pixels // 2, pixels), np.uint64))
    with tempfile.TemporaryDirectory() as name:
        files = [Path(name) / f"{place}.npz" for place in range(parts)]
        for file in files:
            part.save(file)
        _, seconds = clocked(
            lambda: total(slab, wanted, (PlaneSums.load(file, slab, wanted) for file in files)),
            clock=time.process_time,
        )
    return parts * part.sums.nbytes / seconds


def picture_ns(pixels: int = 512, planes: int = 5) -> float:
    """Core time of a pixel of a plane from its sums to its picture on the disk, of noise: PNG takes
    longest over it."""
    slab = Slab(CAMERA, VIEWS, pixels)
    wanted = [SensorPlane(2.0 + place, 2.0) for place in range(planes)]
    sums = np.random.default_rng(7).integers(0, VIEWS**2 << 20, (planes, 3, pixels, pixels))
    whole = PlaneSums(slab, wanted, sums.astype(np.uint64))
    with tempfile.TemporaryDirectory() as name:

        def write() -> None:
            pictures = whole.pictures()
            write_plane_pictures(Path(name) / "planes", pictures, wanted, suffix="png")
            save_stack(Path(name) / "stack.npz", pictures, wanted)

        _, seconds = clocked(write, clock=time.process_time)
    return seconds * 1e9 / (planes * pixels**2)


def disk_bytes_s() -> float:
    """Bytes a second that this disk takes and says it has; wall seconds."""
    block = os.urandom(1 << 20)
    with tempfile.NamedTemporaryFile() as file:

        def write() -> None:
            for _ in range(DISK_MIB):
                file.write(block)
            file.flush()
            os.fsync(file.fileno())

        _, seconds = clocked(write)
    return DISK_MIB * 2**20 / seconds


def overheads_here(account: Account, folder: Path, size: Size) -> dict[str, float]:
    """Of a small light field of a scene: its plan, 2 batches of it and 8, on one core."""
    few, many = (Size(size.scene, PILOT_PIXELS, batches, 1) for batches in PILOT_BATCHES)
    plan = local(account, folder / "plan", few, 1, "--dry-run", "--quiet", "reason")
    least = local(account, folder / "few", few, 1)
    most = local(account, folder / "many", many, 1)
    return {
        "plan_s": plan.core_s,
        "start_s": (most.core_s - least.core_s) / (many.batches - few.batches),
        "few_s": least.core_s,
        "many_s": most.core_s,
    }


def overheads_of_slurm(account: Account, folder: Path, scene: str, many_s: float) -> dict:
    """Of the same 8 batches through SLURM: what its submissions took more."""
    size = Size(scene, PILOT_PIXELS, PILOT_BATCHES[1], 1)
    with local_slurm(folder / "s", cores=1, memory_mib=MEMORY_MIB) as slurm:
        taken = through_slurm(account, slurm, folder / "slurm", size)
        times = submissions(folder / "s" / "slurmctld.log")
    scene_job, *traced, _ = times
    submit = (traced[-1][0] - traced[0][0]) / (len(traced) - 1)
    return {
        "submission_s": (taken.core_s - many_s) / len(times) - submit,
        "submit_s": submit,
        "queue_s": scene_job[1] - scene_job[0],
    }


def submissions(log: Path) -> list[tuple[float, float, float]]:
    """When each submission came, began and ended, seconds: slurmctld's log has milliseconds."""
    found: dict[str, dict[str, float]] = {}
    for line in log.read_text().splitlines():
        for event, words in EVENTS.items():
            if (number := re.search(words + r" JobId=(\d+)", line)) and (
                time_of := STAMP.match(line)
            ):
                moment = datetime.fromisoformat(time_of[1]).timestamp()
                found.setdefault(number[1], {}).setdefault(event, moment)
    return sorted((one["came"], one["began"], one["ended"]) for one in found.values())


def published_rates() -> dict[str, float]:
    """What other benchmarks have measured: planning and joining."""
    planning = read_result(RESULTS / "planning.csv").rows
    jobs, seconds = (planning[key].astype(float) for key in ("jobs", "core s"))
    large = read_result(RESULTS / "large_file.csv").rows["GB a core s"].astype(float)
    return {
        "plan_job_s": (seconds.iloc[-1] - seconds.iloc[0]) / (jobs.iloc[-1] - jobs.iloc[0]),
        "join_bytes_s": large.iloc[-1] * 1e9,
    }

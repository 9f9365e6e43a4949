"""Cost and quality of data sets: python -m benchmarks.datasets --out FILE.csv

Scenes of the shipped descriptions are made as one job makes them, with one thread, and each picture
is compared with its true picture: of stacks as in ``quality.py``, of light fields views of 200 rays
per pixel.  Disparities are compared with single rays.

With --cycles, stacks of three pictures of 96 pixels, of scenes without highlights, are made in turn
with Cycles and its denoiser, at the number of samples whose worst plane is as good.  Its pictures
are compared with its own of 2048 samples, denoised, too.
"""

import argparse
import math
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.measured.rows import report, say
from benchmarks.peers.cycles_lens import CyclesLens, matt
from benchmarks.peers.method import Samples
from benchmarks.quality import true_picture
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.datasets import items, views
from lfcore.datasets.description import Description
from lfcore.datasets.items import StoredItem, make_batch, stored_items
from lfcore.datasets.sample import sample
from lfcore.evaluation import metrics
from lfcore.opencl.device import open_device
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice, Slab
from lfcore.rendering.depth import all_samples, disparity
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.prepared import open_tracer
from lfcore.tracing.tracer import Tracer

CONFIG = Path(__file__).resolve().parents[1] / "config/datasets"
TRUTH = Lattice(16, 2)
"""Its error is about 10 dB below that of stacks of 45 dB."""
TRUE_PATTERN, VIEWS, RAYS = (10, 2), (0, 13, 40, 67, 80), 20_000
"""The rays of true views; the views that are compared; rays that check disparity."""
CYCLES_PIXELS, CYCLES_SAMPLES, CONVERGED = 96, (64, 256, 512), 2048


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    return metrics.psnr(*(srgb_encode(each.astype(np.float64)) for each in (one, other)), peak=1)


def errors_of(of: Description, item: StoredItem, tracer: Tracer) -> list[float]:
    """dB of each picture of a stack, or of some views of a light field."""
    if of.kind == "light_fields":
        slab = Slab(tracer.scene.camera, of.lens.views, of.pixels)
        true = {f"input_Cam{k:03d}.png": views.view(tracer, slab, k, TRUE_PATTERN) for k in VIEWS}
    else:
        planes = [SensorPlane(focus, of.lens.f_number) for focus in of.lens.focus_m]
        true = {
            f"focus{k:02d}.tif": true_picture(tracer, plane, of.pixels, TRUTH)
            for k, plane in enumerate(planes)
        }
    return [psnr(srgb_decode(item.codes(name)), picture) for name, picture in true.items()]


def disparity_error(of: Description, item: StoredItem, tracer: Tracer) -> float:
    """The largest error of disparity in pixels, by single rays, of pixels that are no edges."""
    slab = Slab(tracer.scene.camera, of.lens.views, of.pixels)
    worst, rng = 0.0, np.random.default_rng(1)
    for number in VIEWS:
        stored = item.floats(f"gt_disp_lowres_Cam{number:03d}.pfm")
        flat = np.ones(stored.shape, bool)
        for axis in (0, 1):
            step = np.abs(np.diff(stored, axis=axis, append=stored.take([-1], axis))) > 0.05
            flat &= ~step & ~np.roll(step, 1, axis)
        where = rng.choice(np.flatnonzero(flat), RAYS)
        origins, directions = (
            each.reshape(-1, 3)[where]
            for each in bundles.views(slab, all_samples(slab)[number : number + 1]).rays()
        )
        depth = tracer.closest_hit(origins, directions)[1]
        worst = max(worst, float(np.abs(disparity(slab, depth) - stored.ravel()[where]).max()))
    return worst


def row_of(name: str, count: int) -> dict:
    """A row of the shipped description ``name``."""
    of, device = Description.read(CONFIG / f"{name}.yaml"), open_device(threads=1)
    chosen = np.linspace(0, of.count - 1, count).astype(int).tolist()
    with tempfile.TemporaryDirectory() as folder:
        shard, listed, drafts = (Path(folder) / each for each in ("tar", "records", "drafts"))
        begun = time.process_time()
        records = make_batch(of, chosen, shard, listed, drafts, device)
        seconds = time.process_time() - begun
        made = [one for one in records if "refused" not in one]
        errors, apart = [], []
        for item in stored_items([shard], chosen):
            tracer = open_tracer(sample(of, item.index)[0], device)
            errors += (found := errors_of(of, item, tracer))
            if of.kind == "light_fields":
                apart.append(disparity_error(of, item, tracer))
            expected = item.record["expected_db"]
            say(f"{item.index}: {min(found):.1f} dB, expected {expected:.1f} {apart[-1:]}")
    parts = pd.DataFrame(made)[["scene_core_seconds", "files_core_seconds"]].mean()
    return {
        "data set": name, "made": f"{len(made)} of {count}", "core s": f"{seconds / len(made):.2f}",
        "scene s": f"{parts.iloc[0]:.2f}", "files s": f"{parts.iloc[1]:.2f}",
        "rays per pixel": f"{np.mean([one['rays_per_pixel'] for one in made]):.0f}",
        "asked dB": f"{of.quality_db:g}", "worst dB": f"{min(errors):.1f}",
        "median dB": f"{np.median(errors):.1f}",
        "as asked": f"{100 * np.mean(np.array(errors) >= of.quality_db):.0f}% of {len(errors)}",
        "disparity px": f"{max(apart):.4f}" if apart else "",
    }  # fmt: skip


def cycles_row(count: int) -> dict:
    """Core seconds of stacks by Cycles and by us, of equal quality."""
    of = Description.read(CONFIG / "focal_stacks.yaml")
    of = of.model_copy(update={"lights": of.lights.model_copy(update={"kinds": ["sun", "point"]})})
    rows = []
    for index in range(count):
        scene = matt(sample(of, index)[0])
        tracer, peer = open_tracer(scene, open_device(threads=1)), CyclesLens(scene, 1)
        planes = [SensorPlane(focus, of.lens.f_number) for focus in of.lens.focus_m[::2]]
        try:
            worst, seconds = _cycles_curve(peer, scene.camera, planes)
        finally:
            peer.close()
        target = min(max(of.quality_db, worst[0]), worst[-1])
        small = of.model_copy(update={"pixels": CYCLES_PIXELS, "quality_db": target})
        for _ in range(2):  # the first builds programs
            begun = time.process_time()
            made = items.formed(small, tracer, [plane.focus_m for plane in planes])
        own = time.process_time() - begun
        reached = min(
            psnr(picture, true_picture(tracer, plane, CYCLES_PIXELS, TRUTH))
            for picture, plane in zip(made.pictures, planes, strict=True)
        )
        same = math.exp(np.interp(reached, worst, np.log(seconds)))
        say(f"Cycles, {index}: {worst} dB in {seconds} s; lfcore {reached:.1f} dB in {own:.2f} s")
        rows.append((own, same, same / own, reached))
    ours, theirs, times, levels = np.array(rows).T
    return {
        "data set": f"3 x {CYCLES_PIXELS}², matt; Cycles {theirs.mean():.0f} s, "
        f"{times.min():.0f} to {times.max():.0f} times", "made": str(count),
        "core s": f"{ours.mean():.2f}", "worst dB": f"{levels.min():.1f}",
        "median dB": f"{np.median(levels):.1f}",
    }  # fmt: skip


def _cycles_curve(peer, camera, planes) -> tuple[list[float], list[float]]:
    """dB of the worst plane, ascending, and core seconds of all planes, by samples per pixel."""
    cameras = [focused_camera(camera, plane) for plane in planes]
    true = [
        peer.picture(one, CYCLES_PIXELS, Samples(CONVERGED, "", "picture"), seed=1)[0]
        for one in cameras
    ]
    worst, seconds = [], []
    for count in CYCLES_SAMPLES:
        made = [peer.picture(one, CYCLES_PIXELS, Samples(count, "", "picture")) for one in cameras]
        worst.append(min(psnr(one[0], other) for one, other in zip(made, true, strict=True)))
        seconds.append(sum(one[1] for one in made))
    return np.maximum.accumulate(worst).tolist(), seconds


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.datasets", description=__doc__.splitlines()[0])
    parser.add_argument("--stacks", type=int, default=20)
    parser.add_argument("--fields", type=int, default=5)
    parser.add_argument("--cycles", type=int, default=0, metavar="SCENES")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows: list[dict] = []
    for name, count in (("focal_stacks", options.stacks), ("light_fields", options.fields)):
        if count:
            rows.append(row_of(name, count))
    if options.cycles:
        rows.append(cycles_row(options.cycles))
    report(options.out, "python -m benchmarks.datasets", rows)


if __name__ == "__main__":
    main()

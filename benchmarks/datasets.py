"""Cost and quality of data sets: python -m benchmarks.datasets --out FILE.csv

We make items of the shipped descriptions as a job does, with one thread, and compare each picture
with its true picture: for stacks as in ``quality.py``, for light fields views with 200 rays per
pixel.  Disparities are compared with single rays.  ``Stacks`` makes the same items in a worker.
"""

import argparse
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.quality import true_picture
from benchmarks.results import report, say
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.datasets import views
from lfcore.datasets.batches import make_batch
from lfcore.datasets.description import Description
from lfcore.datasets.metering import metered
from lfcore.datasets.sample import sample
from lfcore.datasets.stacks import Stacks
from lfcore.datasets.stored import StoredItem, stored_items
from lfcore.evaluation import metrics
from lfcore.opencl.device import open_device
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice, Slab
from lfcore.rendering.depth import all_samples, disparity
from lfcore.rendering.prepared import open_tracer
from lfcore.tracing.tracer import Tracer

CONFIG = Path(__file__).resolve().parents[1] / "config/datasets"
TRUTH = Lattice(16, 2)
"""The lens samples of true pictures; their error is about 10 dB below that of stacks of 45 dB."""
TRUE_PATTERN = (10, 2)
"""The pattern of a true view's rays: 200 per pixel."""
VIEWS = (0, 13, 40, 67, 80)
"""The views that are compared."""
RAYS = 20_000
"""The rays per view that check disparity."""


def psnr(picture: np.ndarray, truth: np.ndarray) -> float:
    return metrics.psnr(*(srgb_encode(x.astype(np.float64)) for x in (picture, truth)), peak=1)


def errors_of(description: Description, item: StoredItem, tracer: Tracer) -> list[float]:
    """Return the dB of each picture of a stack, or of some views of a light field."""
    lens = description.lens
    if description.kind == "light_fields":
        slab = Slab.of(tracer.scene.camera, lens.views, description.size)
        true = {f"input_Cam{k:03d}.png": views.view(tracer, slab, k, TRUE_PATTERN) for k in VIEWS}
    else:
        planes = [SensorPlane(focus, tracer.scene.camera.f_number) for focus in lens.focus_m]
        true = {
            f"focus{k:02d}.tif": true_picture(tracer, plane, description.size, TRUTH)
            for k, plane in enumerate(planes)
        }
    return [psnr(srgb_decode(item.codes(name)), picture) for name, picture in true.items()]


def disparity_error(description: Description, item: StoredItem, tracer: Tracer) -> float:
    """Return the largest error of disparity, pixels, by single rays away from edges."""
    slab = Slab.of(tracer.scene.camera, description.lens.views, description.size)
    worst, rng = 0.0, np.random.default_rng(1)
    for number in VIEWS:
        stored = item.floats(f"gt_disp_lowres_Cam{number:03d}.pfm")
        flat = np.ones(stored.shape, bool)
        for axis in (0, 1):
            step = np.abs(np.diff(stored, axis=axis, append=stored.take([-1], axis))) > 0.05
            flat &= ~step & ~np.roll(step, 1, axis)
        chosen = rng.choice(np.flatnonzero(flat), RAYS)
        rays = bundles.views(slab, all_samples(slab)[number : number + 1]).rays()
        depth = tracer.closest_hit(*(part.reshape(-1, 3)[chosen] for part in rays))[1]
        worst = max(worst, float(np.abs(disparity(slab, depth) - stored.ravel()[chosen]).max()))
    return worst


SHOWN = ["data set", "core s", "in a worker", "rays per pixel", "asked dB", "worst dB", "median dB"]
"""The published columns."""
ROOM_STACKS = {"kind": "focal_stacks", "truth": False}
"""The keys of stacks at one f-number of the shipped rooms, nine focuses and all in focus."""


def in_a_job(description: Description, chosen: list[int], folder: Path) -> tuple[float, list[dict]]:
    """Return the core seconds of items as a job makes them, and their records."""
    device, begun = open_device(threads=1), time.process_time()
    shard, table, drafts = (folder / part for part in ("tar", "records", "drafts"))
    records = make_batch(description, chosen, shard, table, drafts, device)
    return time.process_time() - begun, records


def in_a_worker(description: Description, chosen: list[int]) -> float:
    """Return the core seconds of the same items by ``Stacks``."""
    stacks, begun = Stacks(description), time.process_time()
    for index in chosen:
        stacks[index]
    return time.process_time() - begun


def in_new_process(run: Any, *words: Any) -> Any:
    with get_context("spawn").Pool(1) as pool:
        return pool.apply(run, words)


def row_of(name: str, count: int, **change: Any) -> dict:
    """Return a row for the shipped description ``name`` with other keys, from ``count`` items."""
    description, device = Description.read(CONFIG / f"{name}.yaml"), open_device(threads=1)
    description = Description.check(description.model_dump() | change)
    chosen = np.linspace(0, description.count - 1, count).astype(int).tolist()
    with tempfile.TemporaryDirectory() as folder:
        in_new_process(in_a_job, description, chosen[:1], Path(folder) / "warm")  # builds programs
        seconds, records = in_new_process(in_a_job, description, chosen, Path(folder))
        facts = pd.DataFrame([record for record in records if "refused" not in record])
        in_worker = in_new_process(in_a_worker, description, facts["index"].tolist())
        errors, disparities = [], []
        for item in stored_items([Path(folder) / "tar"], chosen):
            drawn = sample(description, item.index)
            scene = metered(drawn.scene, device)[0] if drawn.is_room else drawn.scene
            tracer = open_tracer(scene, device)
            item_errors = errors_of(description, item, tracer)
            errors += item_errors
            if description.kind == "light_fields":
                disparities.append(disparity_error(description, item, tracer))
            expected = item.record["expected_db"]
            say(f"{item.index}: {min(item_errors):.1f} dB, expected {expected:.1f}")
    reached = np.mean(np.array(errors) >= description.quality_db)
    return {
        "data set": name, "made": f"{len(facts)} of {count}",
        "core s": f"{seconds / len(facts):.2f}",
        "in a worker": f"{in_worker / seconds:.2f} times",
        "scene s": f"{facts['scene_core_seconds'].mean():.2f}",
        "files s": f"{facts['files_core_seconds'].mean():.2f}",
        "rays per pixel": f"{facts['rays_per_pixel'].mean():.0f}",
        "asked dB": f"{description.quality_db:g}", "worst dB": f"{min(errors):.1f}",
        "median dB": f"{np.median(errors):.1f}",
        "as asked": f"{100 * reached:.0f}% of {len(errors)}",
        "disparity px": f"{max(disparities):.4f}" if disparities else "",
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.datasets", description=__doc__.splitlines()[0])
    parser.add_argument("--stacks", type=int, default=20)
    parser.add_argument("--fields", type=int, default=5)
    parser.add_argument("--rooms", type=int, default=3)
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows: list[dict] = []
    for name, count in (("focal_stacks", options.stacks), ("light_fields", options.fields)):
        if count:
            rows.append(row_of(name, count))
    if options.rooms:
        rows.append(row_of("rooms", options.rooms, **ROOM_STACKS))
    table = pd.DataFrame(rows)
    report(options.out, "python -m benchmarks.datasets", table, shown={"": table[SHOWN]})


if __name__ == "__main__":
    main()

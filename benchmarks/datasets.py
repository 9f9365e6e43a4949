"""Cost and quality of data sets: python -m benchmarks.datasets --out FILE.csv

We make items of the shipped descriptions as a job does, with one thread, and compare each picture
with its true picture: for stacks as in ``quality.py``, for light fields views with 200 rays per
pixel.  Disparities are compared with single rays.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.quality import true_picture
from benchmarks.results import report, say
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.datasets import views
from lfcore.datasets.description import Description
from lfcore.datasets.items import make_batch
from lfcore.datasets.sample import sample
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
    lens, pixels = description.lens, description.size.shorter
    if description.kind == "light_fields":
        slab = Slab.of(tracer.scene.camera, lens.views, description.size)
        true = {f"input_Cam{k:03d}.png": views.view(tracer, slab, k, TRUE_PATTERN) for k in VIEWS}
    else:
        planes = [SensorPlane(focus, tracer.scene.camera.f_number) for focus in lens.focus_m]
        true = {
            f"focus{k:02d}.tif": true_picture(tracer, plane, pixels, TRUTH)
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


SHOWN = ["data set", "core s", "rays per pixel", "asked dB", "worst dB", "median dB"]
"""The published columns."""


def row_of(name: str, count: int) -> dict:
    """Return a row for the shipped description ``name``, from ``count`` items."""
    description, device = Description.read(CONFIG / f"{name}.yaml"), open_device(threads=1)
    chosen = np.linspace(0, description.count - 1, count).astype(int).tolist()
    with tempfile.TemporaryDirectory() as folder:
        shard, listed, drafts = (Path(folder) / part for part in ("tar", "records", "drafts"))
        begun = time.process_time()
        records = make_batch(description, chosen, shard, listed, drafts, device)
        seconds = time.process_time() - begun
        facts = pd.DataFrame([record for record in records if "refused" not in record])
        errors, disparities = [], []
        for item in stored_items([shard], chosen):
            tracer = open_tracer(sample(description, item.index)[0], device)
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
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows: list[dict] = []
    for name, count in (("focal_stacks", options.stacks), ("light_fields", options.fields)):
        if count:
            rows.append(row_of(name, count))
    table = pd.DataFrame(rows)
    report(options.out, "python -m benchmarks.datasets", table, shown={"": table[SHOWN]})


if __name__ == "__main__":
    main()

"""Cost and quality of data sets: python -m benchmarks.datasets --out FILE.csv

Scenes of the shipped descriptions are made as one job makes them, with one thread, and each picture
is compared with its true picture: of stacks as in ``quality.py``, of light fields views of 200 rays
per pixel.  Disparities are compared with single rays.
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
"""Its error is about 10 dB below that of stacks of 45 dB."""
TRUE_PATTERN, VIEWS, RAYS = (10, 2), (0, 13, 40, 67, 80), 20_000
"""The rays of true views; the views that are compared; rays that check disparity."""


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


SHOWN = ["data set", "core s", "rays per pixel", "asked dB", "worst dB", "median dB"]
"""The published columns."""


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

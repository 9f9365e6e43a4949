"""Requested and reached quality: python -m benchmarks.quality --out FILE.csv

For each scene, open and stopped down, we request five planes of its focal stack at several
qualities (as by ``lfcore render --quality``).  A row says what the worst plane has against the
average over pixel and lens, what was expected of it, the rays that it took, and the fewest that
reach as much: between single lattices of slicing by depth, by the logarithm of their rays.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from benchmarks.measured.scenes import SCENES
from benchmarks.publish import Result, of_this_run
from lfcore.api import load_scene
from lfcore.errors import OpticsError
from lfcore.evaluation.true_picture import Reference, true_pictures
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.quality import Quality, QualitySearch
from lfcore.tracing.tracer import Tracer

TRUTH = Lattice(12, 4), Lattice(10, 5)
LATTICES = [
    Lattice(*each)
    for each in (
        (2, 1), (3, 1), (4, 1), (4, 1.25), (4, 1.5), (4, 2), (5, 2), (6, 2), (8, 2), (8, 2.5),
        (8, 3), (8, 4), (12, 4),
    )
]  # fmt: skip
TARGETS_DB = (35, 40, 45, 50, 55)
STOPS = (0, 4)
NEAR_DB = 0.1
"""By how much less counts as reached: what the truth itself is uncertain by."""


def fewest_rays(tracer: Tracer, truth: Reference, targets: list[float]) -> np.ndarray:
    """Rays a pixel of single lattices that reach each target; NaN beyond them."""
    camera, pixels = tracer.scene.camera, truth.pictures.shape[1]
    found = [
        min(truth.psnr(pictures_by_depth(tracer, camera, truth.planes, pixels, count)))
        for count in LATTICES
    ]
    best = np.maximum.accumulate(found)
    rays = np.log([count.rays_per_pixel for count in LATTICES])
    return np.exp(np.interp(targets, best, rays, left=rays[0], right=np.nan))


def rows_of(tracer: Tracer, pixels: int, targets: list[float]) -> Iterator[dict]:
    scene = tracer.scene
    for stops in STOPS:
        f_number = scene.camera.f_number * 2 ** (stops / 2)
        planes = [SensorPlane(focus, f_number) for focus in scene.focus_distances_m]
        truth = true_pictures(tracer, planes, pixels, TRUTH)
        for target, fewest in zip(targets, fewest_rays(tracer, truth, targets), strict=True):
            row = {"scene": scene.name, "f_number": f"{f_number:g}", "asked_db": target}
            try:
                made = QualitySearch(
                    tracer, scene.camera, planes, pixels, Quality(target)
                ).pictures()
            except OpticsError as error:
                yield row | {"refused": error.problem}
                continue
            found = min(truth.psnr(made.pictures))
            yield row | {
                "expected_db": f"{made.expected_db.min():.1f}",
                "worst_db": f"{found:.1f}",
                "reached": found >= target - NEAR_DB,
                "rays_per_pixel": f"{made.rays_per_pixel:.0f}",
                "fewest": f"{fewest:.0f}",
                "times_fewest": f"{made.rays_per_pixel / fewest:.2f}",
                "truth_known_db": f"{truth.known_db.min():.1f}",
            }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--pixels", type=int, default=128)
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom", "chart"])
    asked = parser.parse_args()
    rows: list[dict] = []
    for name in asked.scenes:
        tracer = open_tracer(load_scene(SCENES / name))
        for row in rows_of(tracer, asked.pixels, list(TARGETS_DB)):
            print(row, flush=True)
            rows.append(row)
    table = pd.DataFrame(rows)
    said = table[table.reached.notna()]
    reached = said.reached.astype(bool).mean()
    thrift = (said.times_fewest.astype(float) <= 2).mean()
    provenance = of_this_run(
        f"python -m benchmarks.quality --pixels {asked.pixels} --scenes {' '.join(asked.scenes)}",
        note=f"Reached in {reached:.0%} of {len(said)} cases, with at most twice the fewest rays "
        f"in {thrift:.0%}; the others were refused, with the rays that they need.",
    )
    Result(provenance, table.fillna("")).write(asked.out)


if __name__ == "__main__":
    main()

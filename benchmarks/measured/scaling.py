"""Time against the number of triangles, and seconds to build the hierarchy."""

from __future__ import annotations

import math
from pathlib import Path

from matplotlib.figure import Figure

from benchmarks.measured import ours
from benchmarks.measured.rows import in_turn, rates, say
from benchmarks.measured.sample import sample_slab
from benchmarks.measured.scenes import SCENES, Loaded, resampled
from lfcore.evaluation.figures import save_figure
from lfcore.optics.slab import Slab

SIZES = (10_000, 30_000, 100_000, 207_000, 500_000, 1_000_000, 2_000_000, 5_000_000)
GOAL_SECONDS = {207_000: 2.0, 2_000_000: 30.0}


def scaling(options) -> list[dict]:
    """One scene (the first named) with its triangles split finer and finer: the surfaces, and so
    what every ray meets, stay the same.

    ``growth_over_log`` is time per ray over that of the first row, divided by the growth of the
    logarithm of the triangle count: at most 1 is no faster than the logarithm.
    """
    from lfcore.scene.build import build_scene

    name = options.scenes[0]
    scene = build_scene(SCENES / name / "scene.yaml")
    rows, first = [], dict[int, tuple[float, int]]()
    for size in options.triangles or SIZES:
        say(f"{name} in {size} triangles")
        scene = resampled(scene, size)
        loaded = Loaded.of(name, scene)
        for views in options.angular:
            sample = sample_slab(Slab(scene.camera, views, options.size), options.mrays)
            method = ours.visibility(loaded.tracer, sample)
            row = rates(in_turn([method], options.repeats)[method.name])
            nanoseconds = 1e3 / row["mrays_per_core_second"]
            start = first.setdefault(views, (nanoseconds, scene.triangle_count))
            growth = math.log(scene.triangle_count) / math.log(start[1])
            rows.append({
                "scene": name,
                "triangles": scene.triangle_count,
                "N": views,
                "M": options.size,
                "work": "visibility",
                "bvh_seconds": loaded.bvh_seconds,
                "bvh_goal_seconds": GOAL_SECONDS.get(size),
                **row,
                "core_nanoseconds_per_ray": nanoseconds,
                "growth": nanoseconds / start[0],
                "growth_of_logarithm": growth,
                "growth_over_log": nanoseconds / start[0] / growth,
            })  # fmt: skip
    return rows


def draw(path: Path, rows: list[dict]) -> None:
    """Time per ray and seconds of the tree against triangle count, of ``rows`` of :func:`scaling`,
    as PNG; dashed, the logarithm from each curve's first point, and crosses, the tree's goals."""
    figure = Figure(figsize=(8.8, 3.7), layout="constrained")
    rays, tree = figure.subplots(1, 2)
    for index, views in enumerate(dict.fromkeys(row["N"] for row in rows)):
        curve = [row for row in rows if row["N"] == views]
        sizes = [row["triangles"] for row in curve]
        times = [row["core_nanoseconds_per_ray"] for row in curve]
        goal = [times[0] * row["growth_of_logarithm"] for row in curve]
        rays.plot(sizes, times, "o-", color=f"C{index}", label=f"N = {views}", markersize=5)
        rays.plot(sizes, goal, "--", color=f"C{index}", linewidth=1)
    rays.plot([], [], "--", color="0.5", linewidth=1, label="logarithm")
    rays.set_ylabel("core-nanoseconds a ray")
    built = {row["triangles"]: row["bvh_seconds"] for row in rows}
    tree.plot(list(built), list(built.values()), "o-", color="C7", label="measured", markersize=5)
    tree.plot(list(GOAL_SECONDS), list(GOAL_SECONDS.values()), "kx", label="goal, at most")
    tree.set_ylabel("seconds to build the tree")
    for axis in (rays, tree):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter("{x:g}")
        axis.set_xlabel(f"triangles ({rows[0]['scene']})")
        axis.grid(alpha=0.3)
        axis.legend(frameon=False)
    save_figure(path, figure)

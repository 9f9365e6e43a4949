"""Time against the number of triangles, and seconds to build the hierarchy."""

from __future__ import annotations

import math

from lfcore.optics.slab import Slab
from measured import ours
from measured.rows import in_turn, rates, say
from measured.sample import sample_slab
from measured.scenes import SCENES, Loaded, resampled

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
    rows, first = [], {}
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

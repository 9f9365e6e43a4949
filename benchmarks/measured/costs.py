"""Ours against itself: threads, sensor planes, features, lanes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from benchmarks.measured import ours
from benchmarks.measured.rows import in_turn, rates, say
from benchmarks.measured.sample import Sample, sample_slab
from benchmarks.measured.scenes import Loaded
from benchmarks.peers.method import Method
from lfcore.opencl.device import open_device
from lfcore.optics.slab import Slab


def each(options) -> Iterator[tuple[Loaded, Sample, dict]]:
    """Scene, sample and the columns that name them."""
    for name in options.scenes:
        loaded = Loaded.open(name)
        for views in options.angular:
            say(f"{name}, N = {views}")
            sample = sample_slab(Slab(loaded.scene.camera, views, options.size), options.mrays)
            head = {
                "scene": name,
                "triangles": loaded.scene.triangle_count,
                "N": views,
                "M": options.size,
            }
            yield loaded, sample, head


def race(head: dict, column: str, methods: dict, repeats: int) -> list[dict]:
    """Rows of ``methods`` (label -> Method) measured in turn; times relative to the first."""
    for label, method in methods.items():
        method.name = str(label)
    found = {name: rates(runs) for name, runs in in_turn(list(methods.values()), repeats).items()}
    first = next(iter(found.values()))
    rows = []
    for label, method in methods.items():
        row = found[str(label)]
        rows.append({
            **head,
            "work": method.work,
            column: label,
            **row,
            "relative_seconds": first["mrays_per_second"] / row["mrays_per_second"],
            "relative_core_seconds": first["mrays_per_core_second"] / row["mrays_per_core_second"],
        })  # fmt: skip
    return rows


def both_works(tracer, sample: Sample, scene) -> tuple[Method, Method]:
    return (
        ours.visibility(tracer, sample),
        ours.algorithm1(tracer, sample, ours.planes_of(scene)),
    )


def threads(options) -> list[dict]:
    """One thread and two; the second row's relative seconds are the inverse of the speed-up."""
    rows = []
    for loaded, sample, head in each(options):
        tracers = [loaded.with_device(open_device(threads=count)) for count in (1, 2)]
        pairs = [both_works(tracer, sample, loaded.scene) for tracer in tracers]
        for methods in zip(*pairs, strict=True):
            rows += race(head, "threads", dict(zip((1, 2), methods, strict=True)), options.repeats)
    return rows


def planes(options) -> list[dict]:
    """1, 20 and 100 sensor planes against 5."""
    rows = []
    for loaded, sample, head in each(options):
        methods = {
            count: ours.algorithm1(loaded.tracer, sample, ours.planes_of(loaded.scene, count))
            for count in (5, 1, 20, 100)
        }
        rows += race(head, "planes", methods, options.repeats)
    return rows


def variants(loaded: Loaded) -> dict[str, Callable]:
    """Programs with features left out; the pictures change, and that is the point."""
    lights = loaded.scene.lights
    open_lights = [replace(light, casts_shadows=False) for light in lights]
    one = [light for light in lights if light.casts_shadows][:1] or lights[:1]
    bare = {"textures": False, "smooth_normals": False, "vertex_colours": False}
    return {
        "all of the scene's": lambda: loaded.tracer,
        "no textures": lambda: loaded.with_needs(textures=False),
        "flat normals": lambda: loaded.with_needs(smooth_normals=False),
        "no specular": lambda: loaded.with_needs(specular=False),
        "no emission": lambda: loaded.with_needs(emission=False),
        "no shadows": lambda: loaded.with_lights(open_lights),
        "one light": lambda: loaded.with_lights(one),
        "no lights": lambda: loaded.with_lights([]),
        "bare": lambda: Loaded(
            loaded.name,
            replace(loaded.scene, lights=open_lights[:1]),
            loaded.bvh,
            0.0,
            loaded.tracer,
        ).with_needs(specular=False, emission=False, **bare),
    }


def needs(options) -> list[dict]:
    """What leaving a feature out saves: relative seconds below 1."""
    rows = []
    for loaded, sample, head in each(options):
        planes_ = ours.planes_of(loaded.scene)
        methods = {
            label: ours.algorithm1(make(), sample, planes_)
            for label, make in variants(loaded).items()
        }
        rows += race(head, "features", methods, options.repeats)
    return rows


def lanes(options) -> list[dict]:
    """The same kernels at every width, and how their hits compare with those at 16."""
    rows = []
    for loaded, sample, head in each(options):
        tracers = {width: loaded.with_device(open_device(lanes=width)) for width in (16, 8, 4, 1)}
        pairs = {width: both_works(t, sample, loaded.scene) for width, t in tracers.items()}
        pixels = sample.thinned(1 << 20)
        hits = {width: t.slab_hits(sample.slab, pixels) for width, t in tracers.items()}
        for work in (0, 1):
            methods = {width: pair[work] for width, pair in pairs.items()}
            for row in race(head, "lanes", methods, options.repeats):
                rows.append({**row, **_compared(hits[row["lanes"]], hits[16])})
    return rows


def _compared(found: tuple, reference: tuple) -> dict[str, float]:
    """Shares of rays with the same triangle and the same depth, to the last bit; and the largest
    relative difference of depth where the triangle is the same."""
    same, hit = found[0] == reference[0], reference[0] >= 0
    depth, expected = found[1][same & hit], reference[1][same & hit]
    return {
        "same_triangle": float(same.mean()),
        "same_depth": float((found[1] == reference[1]).mean()),
        "depth_difference": float(np.max(np.abs(depth / expected - 1), initial=0.0)),
    }

"""All that is left out for a scene, measured against the program with it.

Both programs run on the same rays in turn, and ``identical`` says whether frames and plane sums
agree to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from lfcore.evaluation.left_out.bench import Bench, same, scene_bytes
from lfcore.evaluation.left_out.features import FEATURES, NO_LIGHT, full_needs
from lfcore.evaluation.left_out.packages import packages
from lfcore.evaluation.left_out.stages import stages
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing import reach
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.tracer import Tracer


def left_out(
    scene: Scene,
    bvh: Bvh,
    device,
    *,
    views: int,
    pixels: int,
    repeats: int = 5,
    features: str | Sequence[str] = "all",
) -> list[dict]:
    """Rows with :data:`bench.COLUMNS` of everything that is left out for ``scene``.

    ``features`` are fields of :class:`Needs`, ``all`` of which are compared unless some are named.
    """
    bench = Bench(scene, bvh, device, Slab(scene.camera, views, pixels), repeats)
    rows = [*lacking(bench, features), *beyond_reach(bench), *unwanted(bench), *stages(bench)]
    rows += packages(bench)
    return [{"scene": scene.name, **row} for row in rows]


def lacking(bench: Bench, names: str | Sequence[str] = "all") -> Iterator[dict]:
    """Code and buffers of features that the scene lacks."""
    needs = Needs.of(bench.scene)
    lean = Tracer(bench.scene, bench.bvh, bench.device, needs)
    planes = [bench.plane]
    frames, sums = bench.run(lean, planes, frames=True)
    for feature in FEATURES:
        if not feature.missing(needs) or (names != "all" and feature.field not in names):
            continue
        filled = feature.fill(bench.scene)
        full = Tracer(filled, bench.bvh, bench.device, full_needs(filled, feature.field))
        full_frames, full_sums = bench.run(full, planes, frames=True)
        saved = _bytes(bench, full, planes) - _bytes(bench, lean, planes)
        yield bench.row(
            feature.field,
            feature.what,
            bench.tracing(full, planes, frames=True),
            bench.tracing(lean, planes, frames=True),
            saved,
            same(full_frames, frames) and same([full_sums], [sums]),
        )


def _bytes(bench: Bench, tracer: Tracer, planes) -> int:
    """Buffers of the scene, and memory of all workers."""
    return scene_bytes(tracer, bench.bvh) + tracer.scratch_bytes(bench.slab, bench.tile, planes)


def beyond_reach(bench: Bench) -> Iterator[dict]:
    """Triangles that no ray meets and none of whose shadows is seen; lights that light nothing."""
    planes = [bench.plane]
    full = Tracer(bench.scene, bench.bvh, bench.device)
    scene, bvh = reach.lean(bench.scene, bench.bvh, bench.slab.camera)
    lean = Tracer(scene, bvh, bench.device)
    (frames, sums), (lean_frames, lean_sums) = (
        bench.run(tracer, planes, frames=True) for tracer in (full, lean)
    )
    gone = bench.scene.triangle_count - scene.triangle_count
    leaves = bench.bvh.leaf_count - bvh.leaf_count
    yield bench.row(
        "triangles",
        f"{gone} of {bench.scene.triangle_count} triangles and {leaves} of "
        f"{bench.bvh.leaf_count} leaves beyond the rays and their shadows",
        bench.tracing(full, planes, frames=True),
        bench.tracing(lean, planes, frames=True),
        scene_bytes(full, bench.bvh) - scene_bytes(lean, bvh),
        same(frames, lean_frames) and same([sums], [lean_sums]),
    )
    idle = Light(DIRECTIONAL, (0.0, -1.0, 0.0), (0.0,) * 3)
    black = replace(bench.scene, lights=[*bench.scene.lights, idle])
    strong = [replace(light, colour=(NO_LIGHT,) * 3) for light in black.lights[-1:]]
    filled = replace(black, lights=[*bench.scene.lights, *strong])
    tracer = Tracer(black, bench.bvh, bench.device)
    with_light = Tracer(filled, bench.bvh, bench.device)
    yield bench.row(
        "dark_lights",
        "a light of no strength, its shadow rays, and lights on the far side of all that is seen",
        bench.tracing(with_light, planes, frames=True),
        bench.tracing(tracer, planes, frames=True),
        _bytes(bench, with_light, planes) - _bytes(bench, tracer, planes),
        same(bench.run(with_light, planes, frames=True)[0], frames),
    )


def unwanted(bench: Bench) -> Iterator[dict]:
    """Frames that nobody stores, planes that nobody looks at, lens blocks that no ray needs."""
    camera, slab = bench.slab.camera, bench.slab
    tracer = Tracer(bench.scene, bench.bvh, bench.device)
    whole = SensorPlane(camera.focus_distance_m, camera.f_number, shape="square")
    stopped = SensorPlane(camera.focus_distance_m, 4 * camera.f_number)
    frame_bytes = bench.tile.frame_count * bench.tile.layout.frame_bytes
    plane_bytes = 32 * slab.pixels**2 * bench.device.threads

    def part(feature, what, full, lean, saved, agree):
        full, lean = (
            bench.tracing(tracer, planes, frames=frames) for planes, frames in (full, lean)
        )
        return bench.row(feature, what, full, lean, saved, agree)

    def scratch(planes, frames=True):
        return tracer.scratch_bytes(slab, bench.tile, planes, frames=frames)

    both, with_planes = [whole, stopped], bench.run(tracer, [whole], frames=True)
    agree = same([with_planes[1]], [bench.run(tracer, [whole], frames=False)[1]])
    what = "video frames, where the light field is not stored"
    yield part("frames", what, ([whole], True), ([whole], False), frame_bytes, agree)
    agree = same(with_planes[0], bench.run(tracer, [], frames=True)[0])
    what = "sensor planes and their tables, where only the light field is wanted"
    saved = plane_bytes + scratch([whole]) - scratch([])
    yield part("planes", what, ([whole], True), ([], True), saved, agree)
    of_all = bench.run(tracer, both, frames=False)[1][1]
    agree = same([of_all], [bench.run(tracer, [stopped], frames=False)[1][0]])
    what = "lens blocks outside every aperture (a plane at f/4 of the lens; full: a square plane)"
    yield part("lens_blocks", what, ([whole], False), ([stopped], False), 0, agree)

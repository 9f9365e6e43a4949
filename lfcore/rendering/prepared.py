"""Tracers of scenes: hierarchies are built once for a scene, devices opened by name."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

from lfcore.opencl.device import Device, open_device
from lfcore.opencl.programs import build_early
from lfcore.progress import BAKING, Progress, stage
from lfcore.rendering.exposure import ExposedTracer, shifted
from lfcore.scene.baked import NO_SKY
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import Bvh, build_bvh
from lfcore.tracing.bvh_refit import MovingTree
from lfcore.tracing.job import BLOCKS, SINGLE, program_of
from lfcore.tracing.tracer import Tracer

_built = WeakKeyDictionary[Scene, Bvh]()
_lit = WeakKeyDictionary[Scene, Scene]()


def hierarchy_of(scene: Scene) -> Bvh:
    """The scene's bounding volume hierarchy, cached for the scene's lifetime."""
    if scene not in _built:
        _built[scene] = build_bvh(scene.triangles)
    return _built[scene]


def relit(scene: Scene, **fields: Any) -> Scene:
    """The scene with other lights or materials, and with the hierarchy that it has."""
    made = replace(scene, **fields)
    _built[made] = hierarchy_of(scene)
    return made


def opened(device: Device | str | None) -> Device:
    """An open device, or the device of a name; raises :class:`DeviceError`."""
    return device if isinstance(device, Device) else open_device(device)


def lit(scene: Scene, device: Device, progress: Progress | None = None) -> Scene:
    """The scene with baked light of its sky and bounces, if it has settings for that.

    The light is cached for the scene's lifetime.
    """
    if scene.bake is None or scene.light is not None:
        return scene
    if scene not in _lit:
        from lfcore.baking.bake import bake_light  # seldom needed

        bvh = hierarchy_of(scene)
        with stage(BAKING):
            light = bake_light(scene, bvh, device, scene.bake, progress=progress)
        _lit[scene] = replace(scene, light=light)
        _built[_lit[scene]] = bvh
    return _lit[scene]


def open_tracer(
    scene: Scene,
    device: Device | str | None = None,
    progress: Progress | None = None,
    *,
    by_depth: bool = False,
) -> Tracer:
    """A tracer of the scene on all of a device; light is baked if the scene has settings for
    that.

    Programs for pictures ``by_depth`` are built while the hierarchy is made and light is baked.
    """
    whole = opened(device)
    if by_depth:
        _build_early(scene, whole)
    scene = lit(scene, whole, progress)
    if scene.shutter and scene.instants:
        return ExposedTracer(scene, MovingTree(), whole)
    return Tracer(scene, hierarchy_of(scene), whole)


def _build_early(scene: Scene, device: Device) -> None:
    """Start to build the programs of a bake and of pictures by depth, in the order of their use."""
    needs, programs = Needs.of(scene), []
    if scene.bake is not None and scene.light is None:
        from lfcore.baking.gather import PROGRAM  # seldom needed

        matt = replace(needs, smooth_normals=False)
        programs = [program_of("HITS", matt, BLOCKS), program_of("GIVEN", matt, SINGLE), PROGRAM,
                    program_of("GIVEN_SURFACE", matt, SINGLE)]  # fmt: skip
        needs = replace(needs, baked=True)
    build_early(device, [*programs, program_of("IMAGE", needs, BLOCKS)])


def tracers_at(
    scene: Scene,
    times: Iterable[float],
    device: Device | str | None = None,
    *,
    bake_each: bool = False,
    progress: Progress | None = None,
) -> Iterator[Tracer]:
    """A tracer of the scene at each instant, in seconds, one after another.

    What does not move is set up once; light is baked as the scene stands, or for every instant.
    A scene at rest has one tracer.  An open shutter's times are from each instant.
    """
    whole, tree = opened(device), MovingTree()
    if scene.instants is None:
        tracer = open_tracer(scene, whole, progress)
        yield from (tracer for _ in times)
        return
    scene = scene if bake_each else lit(scene, whole, progress)
    before: Tracer | None = None
    for time in times:
        if scene.shutter:
            before = ExposedTracer(shifted(scene, time), tree, whole, before)
        else:
            now = lit(scene.at(time), whole)
            before = Tracer(now, tree.at(now.triangles), whole, before=before)
        yield before


def open_dark_tracer(scene: Scene, device: Device | str | None = None) -> Tracer:
    """A tracer of hits alone, without baked light."""
    dark = replace(scene, bake=None, light=None, sky=NO_SKY)
    return Tracer(dark, hierarchy_of(scene), opened(device))


def open_tracers(scene: Scene, device: Device | str | None = None) -> list[Tracer]:
    """One tracer per core, each of one thread; a single one for a device other than the CPU."""
    whole = opened(device)
    scene = lit(scene, whole)
    if not whole.is_cpu:
        return [Tracer(scene, hierarchy_of(scene), whole)]
    return [
        Tracer(scene, hierarchy_of(scene), open_device(whole.name, threads=1))
        for _ in range(whole.threads)
    ]

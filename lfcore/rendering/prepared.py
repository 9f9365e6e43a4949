"""Tracers of scenes: hierarchies are built once for a scene, devices opened by name."""

from __future__ import annotations

import weakref

from lfcore.opencl.device import Device, open_device
from lfcore.scene.model import Scene
from lfcore.tracing.bvh import Bvh, build_bvh
from lfcore.tracing.tracer import Tracer

_built: dict[int, tuple[weakref.ref[Scene], Bvh]] = {}


def hierarchy_of(scene: Scene) -> Bvh:
    """The scene's bounding volume hierarchy; it is kept as long as the scene is."""
    found = _built.get(id(scene))
    if found is None or found[0]() is not scene:
        key = id(scene)
        gone = weakref.ref(scene, lambda _: _built.pop(key, None))
        found = _built[key] = (gone, build_bvh(scene.triangles))
    return found[1]


def opened(device: Device | str | None) -> Device:
    """A device that is open already, or the one of that name; raises :class:`DeviceError`."""
    return device if isinstance(device, Device) else open_device(device)


def open_tracer(scene: Scene, device: Device | str | None = None) -> Tracer:
    """A tracer of the scene on all of a device."""
    return Tracer(scene, hierarchy_of(scene), opened(device))


def open_tracers(scene: Scene, device: Device | str | None = None) -> list[Tracer]:
    """One tracer a core, each of one thread, or a single one for a device beside the CPU."""
    whole = opened(device)
    if not whole.is_cpu:
        return [Tracer(scene, hierarchy_of(scene), whole)]
    return [
        Tracer(scene, hierarchy_of(scene), open_device(whole.name, threads=1))
        for _ in range(whole.threads)
    ]

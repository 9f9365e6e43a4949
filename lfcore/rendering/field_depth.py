"""Depth of a stored light field's views, and its picture with everything in focus."""

import math
from collections.abc import Iterator

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.slab import Extent, Slab, all_samples
from lfcore.progress import Progress
from lfcore.refocus.free_views import FreeViews, views_at
from lfcore.refocus.stored_views import read_views
from lfcore.rendering.depth import all_in_focus, check_samples, depth_of_views
from lfcore.rendering.prepared import open_dark_tracer
from lfcore.scene.model import Scene
from lfcore.storage.lightfield import LightFieldFile

GROUP_RAYS = 1 << 26
"""Rays of a group of views: few, large groups, as each decodes all macropixels."""


def field_depth(
    field: LightFieldFile,
    scene: Scene | None,
    samples: np.ndarray | None,
    device: Device | str | None,
    progress: Progress | None,
    *,
    virtual: bool = False,
) -> np.ndarray:
    """As :meth:`lfcore.LightField.depth`."""
    slab = field.made_views
    if scene is not None:
        tracer = open_dark_tracer(scene, device)
        return depth_of_views(tracer, slab, samples, virtual=virtual, progress=progress)
    samples = check_samples(slab, samples)
    if field.metadata.depth is None:
        raise _needs_scene(field)
    views, lens = FreeViews(field, virtual=virtual), slab.lens_positions()
    depth = np.empty((len(samples), *slab.size[::-1]), np.float32)
    for number, point in enumerate(lens[samples]):
        inverse = views.inverse_depth(point)
        if virtual:  # images are beyond the farthest surface
            depth[number] = np.divide(1, inverse, np.full_like(inverse, np.inf), where=inverse > 0)
        else:
            depth[number] = field.metres(inverse)
        if progress:
            progress(number + 1, len(samples))
    return depth


def field_in_focus(
    field: LightFieldFile,
    scene: Scene | None,
    device: Device | str | None,
    progress: Progress | None,
) -> np.ndarray:
    """As :meth:`lfcore.LightField.all_in_focus`."""
    if field.metadata.depth is not None:
        return views_at(field, np.zeros((1, 2)), device=device, progress=progress)[0]
    if scene is None:
        raise _needs_scene(field)
    slab, tracer = field.require_grid(), open_dark_tracer(scene, device)
    middle_view = Extent((0, 0, 1, 1), slab.held.pixels)
    centre = depth_of_views(tracer, Slab(slab.camera, 1, slab.pixels, middle_view))[0]
    samples = all_samples(slab)
    step = max(1, GROUP_RAYS // math.prod(slab.size))

    def groups() -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        for start in range(0, len(samples), step):
            group = samples[start : start + step]
            light = read_views(field, group, device=tracer.device)
            yield group, light, depth_of_views(tracer, slab, group)
            if progress:
                progress(start + len(group), len(samples))

    picture = all_in_focus(slab, centre, groups())
    return picture if field.white == 1.0 else picture * np.float32(field.white)


def _needs_scene(field: LightFieldFile) -> OpticsError:
    return OpticsError("holds no depth", file=field.path, key="scene", remedy="Give the scene")

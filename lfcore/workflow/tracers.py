"""The tracer of a job."""

from __future__ import annotations

from typing import Any

from lfcore.opencl.device import open_device
from lfcore.scene.files import load_scene
from lfcore.tracing import reach
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer


def open_tracer(files: Any, device: str, threads: int, *, lean: bool = False) -> Tracer:
    """A tracer of ``files.scene`` and ``files.bvh`` on the device of this name.

    ``lean`` leaves out triangles that no ray through the scene's own camera can meet, nor its
    shadow rays.
    """
    scene, bvh = load_scene(files.scene), load_bvh(files.bvh)
    if lean:
        scene, bvh = reach.lean(scene, bvh, scene.camera)
    return Tracer(scene, bvh, open_device(device or None, threads=threads))

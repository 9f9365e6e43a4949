"""The tracer of a job."""

from __future__ import annotations

from typing import Protocol

from lfcore.opencl.device import open_device
from lfcore.scene.files import load_scene
from lfcore.tracing import reach
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer


class Prepared(Protocol):
    """Files that a job reads its scene from: Snakemake's input, for one."""

    scene: str
    bvh: str


def open_tracer(files: Prepared, device: str, threads: int, *, lean: bool = False) -> Tracer:
    """A tracer of ``files.scene`` and ``files.bvh`` on the device of this name.

    ``lean`` leaves out what rays through the scene's own camera, and their shadows, cannot meet.
    """
    scene, bvh = load_scene(files.scene), load_bvh(files.bvh)
    if lean:
        scene, bvh = reach.lean(scene, bvh, scene.camera)
    return Tracer(scene, bvh, open_device(device or None, threads=threads))

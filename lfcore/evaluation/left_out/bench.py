"""Programs with and without something, on the same rays in the same run."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from lfcore.errors import LfcoreError
from lfcore.evaluation.timing import measure_in_turn
from lfcore.opencl.device import Device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import finished
from lfcore.scene.model import Scene
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.tracer import Tracer

COLUMNS = (
    "scene", "feature", "what", "seconds_full", "seconds_left_out", "bytes_saved", "identical",
)  # fmt: skip


class LeftOutError(LfcoreError):
    """What a scene does not need changes its picture when it is left out."""


@dataclass
class Bench:
    """A scene, and the rays that all of its programs trace."""

    scene: Scene
    bvh: Bvh
    device: Device
    slab: Slab
    repeats: int

    @property
    def plane(self) -> SensorPlane:
        """The recorded picture through the whole lens."""
        camera = self.slab.camera
        return SensorPlane(camera.focus_distance_m, camera.f_number)

    @property
    def tile(self):
        layout = FrameLayout("macropixels", self.slab.views, self.slab.pixels)
        return layout.tile(0, 0, self.slab.pixels, self.slab.pixels)

    def run(self, tracer: Tracer, planes, *, frames: bool) -> tuple[list[np.ndarray], np.ndarray]:
        """Frames, copied, and plane sums of the whole slab."""
        tracing = tracer.trace_tile(self.slab, self.tile, planes, frames=frames)
        made = [chunk.frames.copy() for chunk in tracing]
        return made, tracing.plane_sums.sums

    def tracing(self, tracer: Tracer, planes, *, frames: bool) -> Callable[[], object]:
        """Work to be timed: the whole slab."""

        return lambda: finished(tracer.trace_tile(self.slab, self.tile, planes, frames=frames))

    def row(self, feature: str, what: str, full, lean, saved: int, identical: bool) -> dict:
        """A row of the report; ``full`` and ``lean`` take turns under the clock."""
        full_time, lean_time = measure_in_turn((full, lean), repeats=self.repeats)
        return {
            "feature": feature,
            "what": what,
            "seconds_full": full_time.median,
            "seconds_left_out": lean_time.median,
            "bytes_saved": int(saved),
            "identical": identical,
        }


def same(one: Iterable[np.ndarray], other: Iterable[np.ndarray]) -> bool:
    """Whether arrays agree to the last bit."""
    one, other = list(one), list(other)
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def check_identical(rows: Iterable[dict]) -> None:
    """Raises :class:`LeftOutError` that names the rows whose two programs differ in a bit."""
    differ = [f"{row['scene']}, {row['feature']}" for row in rows if not row["identical"]]
    if differ:
        raise LeftOutError(
            f"frames or plane sums change when what is not needed is left out: {'; '.join(differ)}",
            remedy="lfcore/evaluation/left_out/features.py says what each feature switches",
        )


def scene_bytes(tracer: Tracer, bvh: Bvh) -> int:
    """Bytes of a scene's buffers on the device: surfaces and hierarchy."""
    s = pack_surfaces(tracer.scene, tracer.needs)
    arrays = (s.corners, s.attributes, s.material_ids, s.materials, s.lights, s.images, s.texels)
    tree = (bvh.boxes, bvh.children, bvh.leaves, bvh.leaf_ids)
    return sum(array.nbytes for array in (*arrays, *tree))

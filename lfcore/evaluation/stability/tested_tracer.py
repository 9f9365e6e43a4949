"""The tracer under test, behind four methods: lfcore's, or another."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError
from lfcore.opencl.device import Device, open_device
from lfcore.optics.bundles import Bundles
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.appearance import Material
from lfcore.scene.assemble import sound
from lfcore.scene.model import Scene

CAMERA = Camera(focal_length_m=0.05, sensor_width_m=0.036, f_number=2.0, focus_m=2.0)

Found = tuple[np.ndarray, np.ndarray]
"""Triangle (-1 for a miss) and t or depth of each ray."""
ClosestHit = Callable[[np.ndarray, np.ndarray, np.ndarray], Found]


def bare_scene(triangles: ArrayLike, **changes: Any) -> Scene:
    """Grey triangles without lights; ``changes`` are fields of :class:`Scene`."""
    triangles = np.asarray(triangles, np.float32)
    values: dict[str, Any] = {
        "name": "stability",
        "camera": CAMERA,
        "triangles": triangles,
        "normals": np.zeros((0, 3, 3), np.float32),
        "uvs": np.zeros((0, 3, 2), np.float32),
        "colours": np.zeros((0, 3, 3), np.float32),
        "material_ids": np.zeros(len(triangles), np.int32),
        "materials": [Material("grey")],
        "textures": [],
        "lights": [],
    }
    return Scene(**{**values, **changes})


def check_kept(triangles: np.ndarray) -> None:
    """Raise :class:`SceneError` if a scene's loader drops triangles for their size."""
    _, dropped = sound(np.asarray(triangles, np.float64))
    for reason in ("out of range", "too small"):
        if reason in dropped:
            raise SceneError(f"{dropped[reason]} triangles were left out: {reason}")


def kept(triangles: np.ndarray) -> np.ndarray:
    """(T,) bool: the triangles that a scene's loader keeps."""
    with np.errstate(invalid="ignore"):  # random bits may be signalling NaN
        return sound(triangles.astype(np.float64))[0]


@dataclass(frozen=True)
class TracerUnderTest:
    """The OpenCL tracer behind the cases' interface; another tracer is a class with these methods.

    ``rays`` is the number of random rays per step of a sweep.
    """

    device: Device = field(default_factory=open_device)
    rays: int = 1500

    def closest(self, triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> Found:
        """The triangle (R,), -1 for a miss, and t (R,) for triangles (T, 3, 3) and rays (R, 3),
        (R, 3), all float32.  Origins have z = 0 and directions z = 1: each ray is a bundle of the
        kernel for slabs."""
        keep = np.flatnonzero(kept(triangles))
        elements = np.concatenate([origins[:, :2], directions[:, :2]], axis=1)
        bundles = Bundles(elements.astype(np.float32), np.zeros(4, np.float32), 1, 1, 0.0)
        triangle, depth = open_tracer(bare_scene(triangles[keep]), self.device).bundle_hits(bundles)
        return np.append(keep, -1)[triangle[:, 0, 0]], depth[:, 0, 0]

    def any_closest(
        self, triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray
    ) -> Found:
        """The same for any origins and directions, by the kernel for single rays."""
        keep = np.flatnonzero(kept(triangles))
        tracer = open_tracer(bare_scene(triangles[keep]), self.device)
        triangle, t, *_ = tracer.closest_hit(origins, directions)
        return np.append(keep, -1)[triangle], t

    def slab_hits(self, triangles: np.ndarray, slab: Slab, pixels: np.ndarray) -> Found:
        """Triangle and depth, (P, N, N), for triangles, a slab and pixels (P, 2)."""
        return open_tracer(bare_scene(triangles), self.device).slab_hits(slab, pixels)

    def specular(
        self, scene: Scene, origins: np.ndarray, directions: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The light (R, 3) that the first surfaces of rays, as of :meth:`closest`, show, and the
        depth (R,) at which it appears."""
        elements = np.concatenate([origins[:, :2], directions[:, :2]], axis=1)
        bundles = Bundles(elements.astype(np.float32), np.zeros(4, np.float32), 1, 1, 0.0)
        _, (light, depth) = open_tracer(scene, self.device).parts(bundles)
        return light[:, 0, 0], depth[:, 0, 0]

    def picture(self, scene: Scene, slab: Slab, plane: SensorPlane) -> np.ndarray:
        """(M, M, 3) linear light."""
        return trace_planes(open_tracer(scene, self.device), slab, [plane])[0]

"""The tracer under test: lfcore's, or any other, behind four functions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
from lfcore.scene.appearance import Material
from lfcore.scene.assemble import sound
from lfcore.scene.model import Scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

CAMERA = Camera(focal_length_m=0.05, sensor_width_m=0.036, f_number=2.0, focus_distance_m=2.0)

Found = tuple[np.ndarray, np.ndarray]
"""Triangle (-1 for a miss) and t or depth of each ray."""
ClosestHit = Callable[[np.ndarray, np.ndarray, np.ndarray], Found]
SlabHits = Callable[[np.ndarray, Slab, np.ndarray], Found]
Picture = Callable[[Scene, Slab, SensorPlane], np.ndarray]


@dataclass(frozen=True)
class TracerUnderTest:
    """What the cases ask of a tracer.

    Attributes
    ----------
    closest : of triangles (T, 3, 3) and rays (R, 3), (R, 3), all float32: the triangle (R,),
        -1 for a miss, and t (R,).  Origins have z = 0 and directions z = 1, as in a slab.
    any_closest : the same for any origins and directions.
    slab_hits : of triangles, a slab and pixels (P, 2): triangle and depth, (P, N, N).
    picture : of a scene, a slab and a plane: (M, M, 3) linear light.
    rays : how many of them a step of a sweep has, where a case draws them at random.
    """

    closest: ClosestHit
    any_closest: ClosestHit
    slab_hits: SlabHits
    picture: Picture
    rays: int = 1500


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
    """Raises :class:`SceneError` where a scene's loader leaves triangles out for their size."""
    _, dropped = sound(np.asarray(triangles, np.float64))
    for reason in ("out of range", "too small"):
        if reason in dropped:
            raise SceneError(f"{dropped[reason]} triangles were left out: {reason}")


def kept(triangles: np.ndarray) -> np.ndarray:
    """(T,) bool: the triangles that a scene's loader keeps."""
    with np.errstate(invalid="ignore"):  # random bits may be signalling NaN
        return sound(triangles.astype(np.float64))[0]


def tracer_under_test(
    device: Device | None = None, *, general: bool = False, rays: int = 1500
) -> TracerUnderTest:
    """The OpenCL tracer on ``device``.

    Lone rays go through the slab's kernel, each a bundle of its own, or with ``general`` through
    the kernel for rays of any direction.
    """
    device = device or open_device()

    def tracer(scene: Scene) -> Tracer:
        return Tracer(scene, build_bvh(scene.triangles), device)

    def any_closest(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> Found:
        keep = np.flatnonzero(kept(triangles))
        found = tracer(bare_scene(triangles[keep])).closest_hit(origins, directions)
        return np.append(keep, -1)[found[0]], found[1]

    def closest(triangles: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> Found:
        keep = np.flatnonzero(kept(triangles))
        elements = np.concatenate([origins[:, :2], directions[:, :2]], axis=1)
        bundles = Bundles(elements.astype(np.float32), np.zeros(4, np.float32), 1, 1, 0.0)
        triangle, depth = tracer(bare_scene(triangles[keep])).bundle_hits(bundles)
        return np.append(keep, -1)[triangle[:, 0, 0]], depth[:, 0, 0]

    def slab_hits(triangles: np.ndarray, slab: Slab, pixels: np.ndarray) -> Found:
        return tracer(bare_scene(triangles)).slab_hits(slab, pixels)

    def picture(scene: Scene, slab: Slab, plane: SensorPlane) -> np.ndarray:
        return trace_planes(tracer(scene), slab, [plane])[0]

    lone = any_closest if general else closest
    return TracerUnderTest(lone, any_closest, slab_hits, picture, rays)

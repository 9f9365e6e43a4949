"""Rays that are given one by one: their hits, and the light or the surfaces at hits.

Hits may come from anywhere: the tracer, mirrors, a bake, or another program.
"""

from typing import Any, NamedTuple

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import page_aligned
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.job import launch_given
from lfcore.tracing.layouts import RAY_HIT


class RayHits(NamedTuple):
    """The hits of R rays.

    Attributes
    ----------
    triangle : (R,) int32
        -1 for a miss; at equal distance the lowest number.
    distance : (R,) float32
        The hit is ``origin + distance * direction``; infinity for a miss.
    barycentric : (R, 3) float32
        Weights of the corners p, q, r; equal triangles have the corner order of the first.  NaN for
        a miss.
    """

    triangle: np.ndarray
    distance: np.ndarray
    barycentric: np.ndarray


def records_of(hits: RayHits) -> np.ndarray:
    """The hits as RAY_HIT (R,)."""
    records = page_aligned((len(hits.triangle),), RAY_HIT)
    for name, part in zip(RAY_HIT.names or (), hits, strict=True):
        records[name] = part
    return records


class HitSurfaces(NamedTuple):
    """Surfaces at hits, (..., 3) float32 each.

    Attributes
    ----------
    emission : linear RGB radiance; that of the background or of the sky for a miss.
    albedo : the reflected share of ambient light, linear RGB; 0 for a miss.
    normal : unit shading normals, towards the viewer; 0 for a miss.
    """

    emission: np.ndarray
    albedo: np.ndarray
    normal: np.ndarray


class GivenRays:
    """Rays on a device.

    Parameters
    ----------
    origins, directions : (R, 3) float32; directions need not be of unit length.

    Raises
    ------
    OpticsError
        for unequal numbers of origins and directions.
    """

    def __init__(self, scene: DeviceScene, origins: np.ndarray, directions: np.ndarray):
        self._scene = scene
        parts = [np.ascontiguousarray(part, np.float32).reshape(-1, 3)
                 for part in (origins, directions)]  # fmt: skip
        if parts[0].shape != parts[1].shape:
            raise OpticsError(f"{len(parts[0])} origins for {len(parts[1])} directions")
        self._count, self._rays = len(parts[0]), parts

    def hits(self) -> RayHits:
        """Trace the rays; those that are not finite, or have no direction, miss."""
        hits = page_aligned((self._count,), RAY_HIT)
        self._fill("GIVEN", {"hits": hits})
        return RayHits(*(hits[name] for name in RAY_HIT.names or ()))

    def radiance(self, hits: RayHits, filtered: float | np.ndarray) -> np.ndarray:
        """(R, 3) float32 linear RGB radiance; ``filtered`` as for :meth:`surfaces`."""
        radiance = page_aligned((self._count, 3))
        self._shade("GIVEN_LIGHT", hits, filtered, {"radiance": radiance})
        return radiance

    def surfaces(
        self, hits: RayHits, filtered: float | np.ndarray, *, normals: bool
    ) -> HitSurfaces:
        """The surfaces at hits, without ``normals`` if these are not wanted.

        ``filtered``: textures are filtered over this tangent, or widths (R,) across the rays, in
        metres.

        Raises :class:`OpticsError` for hits of other rays or of another scene.
        """
        counts = self._count, self._count, self._count if normals else 0
        values = HitSurfaces(*(page_aligned((count, 3)) for count in counts))
        names = "radiance", "albedo", "normal"
        self._shade("GIVEN_SURFACE", hits, filtered, dict(zip(names, values, strict=True)))
        return values

    def _shade(
        self, sink: str, hits: RayHits, filtered: float | np.ndarray, results: dict[str, np.ndarray]
    ) -> None:
        device, count, triangles = self._scene.device, self._count, self._scene.triangle_count
        if [np.shape(part) for part in hits] != [(count,), (count,), (count, 3)]:
            raise OpticsError(f"has other numbers than {count} rays", key="hits")
        triangle = np.asarray(hits.triangle)
        if count and not -1 <= triangle.min() <= triangle.max() < triangles:
            raise OpticsError(f"names a triangle that is none of {triangles}", key="hits")
        pitch, footprints = 0.0, None
        if isinstance(filtered, np.ndarray):
            widths = np.ascontiguousarray(filtered, np.float32)
            if widths.shape != (count,):
                raise OpticsError(f"must have the shape ({count},)", key="filtered")
            footprints = device.shared(widths) if count else None
        else:
            pitch = filtered
        if count:
            shown = device.shared(records_of(hits))
            self._fill(sink, results, pitch, hits=shown, footprints=footprints)

    def _fill(
        self, sink: str, results: dict[str, np.ndarray], pitch: float = 0.0, **arguments: Any
    ) -> None:
        if not self._count:
            return
        device = self._scene.device
        origins, directions = map(device.shared, self._rays)
        targets = {
            name: device.target_buffer(array) if array.size else None
            for name, array in results.items()
        }
        launch_given(
            self._scene, sink, self._count, pitch,
            origins=origins, directions=directions, **arguments, **targets,
        )  # fmt: skip
        for target, array in zip(targets.values(), results.values(), strict=True):
            if target:
                device.collect(target, array)

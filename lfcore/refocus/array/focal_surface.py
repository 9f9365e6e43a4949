"""Focal surfaces: the surfaces on which a synthetic picture is sharp.

A surface gives the inverse ray parameter ``q = 1 / z`` at which it intersects a ray ``O + z D``.
Focus at infinity is then 0, and nothing overflows at a tilted plane's horizon.  The space is the
camera array's: data cameras in z = 0, x right, y down, z forward, metres.
"""

from dataclasses import dataclass

import numpy as np

from lfcore.errors import OpticsError
from lfcore.refocus.array.virtual_camera import VirtualCamera

PLANE, SPHERE, DEPTH_MAP = 0, 1, 2


@dataclass(frozen=True, eq=False)
class PlaneSurface:
    """The plane through ``point`` with the normal ``normal``, at any tilt.

    Rays that move away from it are focused at infinity.
    """

    point: np.ndarray
    normal: np.ndarray

    def __post_init__(self) -> None:
        point, normal = (np.asarray(v, np.float64) for v in (self.point, self.normal))
        if not np.isfinite(point).all() or not np.linalg.norm(normal) > 0:
            raise OpticsError("a focal plane needs a finite point and a normal of some length")
        object.__setattr__(self, "point", point)
        object.__setattr__(self, "normal", normal / np.linalg.norm(normal))

    def inverse_depth(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(...,) float64 q >= 0 of rays (..., 3)."""
        towards = directions @ self.normal
        distance = (self.point - origins) @ self.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            q = towards / distance
        # A ray that starts on the plane intersects it at once: q is the largest value.
        return np.where(distance == 0, _NEAREST, np.clip(q, 0.0, _NEAREST))


@dataclass(frozen=True, eq=False)
class SphereSurface:
    """The far side of a sphere, as seen by the rays.

    A ray that misses the sphere is focused where it is nearest to the centre, which continues the
    surface without a jump.  A ray with the sphere behind it is focused at infinity.
    """

    centre: np.ndarray
    radius: float

    def __post_init__(self) -> None:
        centre = np.asarray(self.centre, np.float64)
        if not np.isfinite(centre).all() or not self.radius > 0:
            raise OpticsError("a focal sphere needs a finite centre and a radius above 0")
        object.__setattr__(self, "centre", centre)

    def inverse_depth(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(...,) float64 q >= 0 of rays (..., 3)."""
        offset = self.centre - origins
        square = (directions**2).sum(-1)
        along = (offset * directions).sum(-1)
        root = np.maximum(along**2 - square * ((offset**2).sum(-1) - self.radius**2), 0.0)
        far = along + np.sqrt(root)
        with np.errstate(divide="ignore"):
            q = np.where(far > 0, square / np.where(far > 0, far, 1.0), 0.0)
        return np.clip(q, 0.0, _NEAREST)


@dataclass(frozen=True, eq=False)
class DepthMapSurface:
    """A depth per place on the film.

    ``depth`` is (H, W), metres along the virtual camera's axis, ``inf`` included, row 0 on top.
    The map covers the whole film, whatever its resolution; it is bilinear between texel centres.
    """

    depth: np.ndarray

    def __post_init__(self) -> None:
        depth = np.asarray(self.depth, np.float64)
        if depth.ndim != 2 or not depth.size or not (depth > 0).all():
            raise OpticsError("a depth map is two-dimensional and above 0 everywhere")
        object.__setattr__(self, "depth", depth)


FocalSurface = PlaneSurface | SphereSurface | DepthMapSurface
_NEAREST = 1e6
"""The largest inverse depth, dioptres: nearer points are as good as at the lens."""


def parallel(z: float) -> PlaneSurface:
    """The plane z metres before the data cameras and parallel to their plane.

    Raises :class:`OpticsError` for a plane behind them.
    """
    if not z > 0:
        raise OpticsError(f"a focal plane at z = {z} is behind the cameras", key="focalplanez")
    return PlaneSurface(np.array([0.0, 0.0, z]), np.array([0.0, 0.0, 1.0]))


def at_distance(camera: VirtualCamera, distance: float) -> PlaneSurface:
    """The plane perpendicular to the virtual camera's axis, ``distance`` metres along it."""
    if not distance > 0:
        raise OpticsError(f"a focus at {distance} m is behind the camera", key="focaldistance")
    axis = camera.rotation[:, 2]
    return PlaneSurface(camera.position_m + distance * axis, axis)


def inverse_depth(
    surface: FocalSurface,
    camera: VirtualCamera,
    origins: np.ndarray,
    directions: np.ndarray,
    film: np.ndarray,
) -> np.ndarray:
    """q of rays (..., 3) at film positions (..., 2) in pixels; the float64 reference."""
    if isinstance(surface, DepthMapSurface):
        from scipy.ndimage import map_coordinates  # seldom needed, slow to import

        inverse, share = 1.0 / surface.depth, film / np.array(camera.size, np.float64)
        place = np.moveaxis(share[..., ::-1] * inverse.shape - 0.5, -1, 0)
        near = map_coordinates(inverse, place, order=1, mode="nearest")
        axis = camera.rotation[:, 2]  # the depth 1 / near is measured along it from the lens
        start = (origins - camera.position_m) @ axis
        forward = directions @ axis
        return np.clip(near * forward / np.maximum(1.0 - near * start, 1e-12), 0.0, _NEAREST)
    return surface.inverse_depth(origins, directions)

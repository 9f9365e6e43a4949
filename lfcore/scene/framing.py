"""A camera for a scene that does not say: pose, lens and focus from the geometry's extent.

Everything is chosen relative to the size of the scene, so a ring of 2 cm and a house of 20 m
give the same picture with the same defocus.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError, SceneError
from lfcore.optics.camera import Camera
from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.scene.gltf import FoundCamera
from lfcore.scene.surface_mesh import SurfaceMesh
from lfcore.scene.transforms import look_at, pose_from_matrix, rigid_to_camera

# Tangent extent of the field of a fitted lens (39 degrees), the share of it that the scene may
# fill, and the focal length per distance: at f/2 the lens is an eighth of the distance wide.
FIELD_WIDTH = 0.7
FILLED = 0.9
FOCAL_PER_DISTANCE = 0.25
VIEW_DIRECTION = (0.45, 0.35, 1.0)
NEAREST_FOCUS = 1.05
WIDEST_F_NUMBER = 2.0
BLUR = 0.01
"""Share of the picture's width that a mesh without a description is blurred by, at most."""
# From a camera that looks along -z with +y up to ours.
TURNED = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Bounds:
    """The finite vertices and their axis-aligned box, world space, metres."""

    low: np.ndarray
    high: np.ndarray
    points: np.ndarray  # (V, 3), the vertices themselves

    @property
    def centre(self) -> np.ndarray:
        return (self.low + self.high) / 2

    @property
    def radius(self) -> float:
        return float(np.linalg.norm(self.high - self.low) / 2)


def bounds(parts: list[SurfaceMesh], *, file: str | Path) -> Bounds:
    """Raises :class:`SceneError` when no triangle has finite corners."""
    corners = [_finite(part.triangles) for part in parts]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    if not len(points):
        raise SceneError(
            "the scene is empty: no triangle has finite corners",
            file=file,
            key="objects",
            remedy="Check the meshes for NaN or infinite coordinates",
        )
    return Bounds(points.min(0), points.max(0), points)


def _finite(triangles: np.ndarray) -> np.ndarray:
    flat = triangles.reshape(len(triangles), 9)
    good = (np.isfinite(flat) & (np.abs(np.nan_to_num(flat)) <= 1e18)).all(1)
    return triangles[good].reshape(-1, 3)


def place_camera(
    description: dict,
    parts: list[SurfaceMesh],
    *,
    file: str | Path,
    found: FoundCamera | None = None,
) -> tuple[Camera, np.ndarray]:
    """The lens and the (4, 4) world-to-camera matrix of a checked ``camera`` mapping.

    ``found`` is a camera of a glTF file, for a description that gives no pose.

    Raises :class:`SceneError` for a pose that cannot be, a scene wholly behind the lens when
    the focus must be found, and a focus inside the focal length.
    """
    extent = bounds(parts, file=file)
    pose = description.get("pose")
    if pose is None and found is not None:
        to_camera = rigid_to_camera(TURNED @ found.to_world[:3, :3].T, found.to_world[:3, 3])
    elif pose is None:
        to_camera = _framing_pose(description, extent)
    elif "matrix" in pose:
        to_camera = pose_from_matrix(pose["matrix"], file=file, key="camera.pose.matrix")
    else:
        to_camera = look_at(pose["position_m"], pose["look_at_m"], pose["up"], file=file)
    middle = float((to_camera[:3, :3] @ extent.centre + to_camera[:3, 3])[2])
    if found is not None and pose is None:
        middle = _depth_before(extent, to_camera, middle)
    focus = description.get("focus_m", middle)
    focus = math.inf if focus == "infinity" else float(focus)
    if not focus > 0:
        raise SceneError(
            "the scene's middle lies behind the lens, so there is nothing to focus on",
            file=file,
            key="camera.pose",
            remedy="Turn the camera round, or give camera.focus_m",
        )
    fit = focus if math.isfinite(focus) else max(middle, extent.radius, 1e-6)
    width = FIELD_WIDTH if found is None or pose is not None else found.field_width
    focal_m, sensor_m = _lens(description, fit, width)
    f_number = description["f_number"]
    if f_number is None:
        points = extent.points @ to_camera[:3, :3].T + to_camera[:3, 3]
        f_number = sharp_f_number(points, focal_m, focus, width)
    try:
        return Camera(focal_m, sensor_m, float(f_number), focus), to_camera
    except OpticsError as error:
        raise error.named(SceneError, file=file, key=f"camera.{error.key}") from None


def sharp_f_number(points: np.ndarray, focal_m: float, focus_m: float, width: float) -> float:
    """The widest aperture, f/2 at most, that blurs nothing by more than :data:`BLUR`.

    ``points`` (V, 3) are in camera space, ``width`` is the field's at 1 m; those beside it and the
    nearest and farthest 2 percent do not count.  A lens of diameter A blurs what lies at depth z
    over the tangent A |1 / z - 1 / focus|.
    """
    depth = _seen_depths(points, width, 1e-6 * focus_m)
    if not len(depth):
        return WIDEST_F_NUMBER
    unsharp = float(np.abs(1 / np.percentile(depth, [2, 98]) - 1 / focus_m).max())
    return max(WIDEST_F_NUMBER, focal_m * unsharp / (BLUR * width))


def _seen_depths(points: np.ndarray, width: float, nearest: float) -> np.ndarray:
    """Depths beyond ``nearest`` of points (V, 3) within a field of ``width`` at 1 m."""
    depth = points[:, 2]
    across = np.abs(points[:, :2]).max(axis=1, initial=0.0)
    return depth[(depth > nearest) & (across <= width / 2 * depth)]


def _depth_before(extent: Bounds, to_camera: np.ndarray, middle: float) -> float:
    """Of what lies before a camera that may stand within the scene: the median of its vertices."""
    depth = extent.points @ to_camera[2, :3] + to_camera[2, 3]
    before = depth[depth > 1e-3 * extent.radius]
    return float(np.median(before)) if len(before) else middle


def _framing_pose(description: dict, extent: Bounds) -> np.ndarray:
    """Just far enough along :data:`VIEW_DIRECTION` that every vertex lies in the picture, and so
    that the picture of all of them lies in its middle."""
    width = FIELD_WIDTH
    if "focal_length_mm" in description or "sensor_width_mm" in description:
        focal_m, sensor_m = _lens(description, 0.0)
        width = sensor_m / focal_m
    direction = np.asarray(VIEW_DIRECTION) / np.linalg.norm(VIEW_DIRECTION)
    turn = look_at(direction, (0, 0, 0))[:3, :3]
    *across, z = turn @ (extent.points - extent.centre).T
    # From (x0, y0, -distance) a vertex is in the picture when |x - x0| <= k (z + distance) and y
    # alike.  The sum of what bounds k distance from above and below does not hold x0.
    k = FILLED * width / 2
    bounds_of = [((x - k * z).max() + (-x - k * z).max()) / 2 / k for x in across]
    distance = max(*map(float, bounds_of), 1.5 * extent.radius, 1e-6)
    aside = turn[:2].T @ [_balanced(x, z + distance) for x in across]
    middle = extent.centre + aside
    return look_at(middle + distance * direction, middle)


def _balanced(x: np.ndarray, depth: np.ndarray) -> float:
    """Where a camera sees (V,) places ``x`` at ``depth`` as far to one side as to the other."""
    middle = 0.0
    for _ in range(50):
        seen = (x - middle) / depth
        middle += float(seen.max() + seen.min()) / 2 * float(depth.min())
    return middle


def _lens(
    description: dict, distance: float, field_width: float = FIELD_WIDTH
) -> tuple[float, float]:
    """Focal length and sensor width in metres; fitted to ``distance`` when neither is given."""
    focal, sensor = description.get("focal_length_mm"), description.get("sensor_width_mm")
    if focal is None and sensor is None:
        focal_m = FOCAL_PER_DISTANCE * distance
        return focal_m, field_width * focal_m / (1 - FOCAL_PER_DISTANCE)
    return float(focal or 50.0) / 1000, float(sensor or 36.0) / 1000


def default_lights() -> list[Light]:
    """In camera space: a key light with shadows over the camera's left shoulder, and a faint one
    from the right that fills them."""
    key, fill = ([-0.5, -0.8, -0.7], [0.8, -0.15, -0.6])
    return [
        Light(DIRECTIONAL, _unit(key), (0.85, 0.83, 0.8)),
        Light(DIRECTIONAL, _unit(fill), (0.18, 0.19, 0.21), casts_shadows=False),
    ]


def _unit(towards: list[float]) -> tuple[float, float, float]:
    x, y, z = (np.array(towards) / np.linalg.norm(towards)).tolist()
    return x, y, z


def default_focus_distances(camera: Camera, triangles: np.ndarray, number: int = 5) -> tuple:
    """``number`` distances in metres, near to far, even in dioptres over the visible depths.

    ``triangles`` is (T, 3, 3) in camera space.  Depths are those of the vertices inside the
    field, without the nearest and farthest 2 percent; the recorded focus when there are none.
    """
    points = triangles.reshape(-1, 3).astype(np.float64)
    nearest = max(NEAREST_FOCUS * camera.focal_length_m, 1e-9)
    depth = _seen_depths(points, camera.field_width, nearest)
    if not len(depth):
        return (camera.focus_m,)
    near, far = np.percentile(depth, [2, 98])
    return tuple(float(1 / d) for d in np.linspace(1 / near, 1 / far, number))

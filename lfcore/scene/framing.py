"""A camera for a scene without one: pose, lens and focus from the geometry's extent.

Everything is chosen relative to the size of the scene, so a ring of 2 cm and a house of 20 m
give the same picture with the same defocus.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera, check_focus, image_distance
from lfcore.optics.focus import DepthRange, check_words, f_number_of_blur, focus_distance
from lfcore.optics.size import Size
from lfcore.reading import Where
from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.scene.arrays import columnwise
from lfcore.scene.seen import depth_range, focus_at
from lfcore.scene.surface_mesh import SurfaceMesh, normalise, triple
from lfcore.scene.transforms import look_at, pose_from_matrix, rigid_to_camera

FIELD_WIDTH = 0.7
"""The tangent extent of a fitted lens's field: 39 degrees."""
FILLED = 0.9
"""The share of one of the picture's sides that a framed scene fills."""
BLUR = 0.02
"""The blur's diameter at the far end of the visible depths, through a fitted lens that is focused
in their middle, as a share of the picture's shorter side."""
F_NUMBER = 2.0
"""The f-number of a lens whose focal length is fitted as well."""
WIDEST = 1 / 8
"""The largest diameter of a fitted lens per distance to the near end: flat scenes set no other
bound."""
SQUARE = Size(1, 1)
FRONT_LEFT = "24,18"
"""The default direction from a scene to its camera."""
DIRECTIONS = {
    "front": (0.0, 0.0), "right": (90.0, 0.0), "back": (180.0, 0.0), "left": (-90.0, 0.0),
    "top": (0.0, 90.0),
}  # fmt: skip
"""Words for azimuth and elevation of a camera, degrees: from +z, to the right and upwards."""
NEAREST_FOCUS = 1.05
"""The nearest distance of a focal stack, in focal lengths."""
# From a camera that looks along -z with +y up, to camera space.
TURNED = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True)
class FoundCamera:
    """A perspective camera: (4, 4) camera to world, looking along -z with +y up.

    ``field_width`` is the tangent extent of its shorter side.
    """

    to_world: np.ndarray
    field_width: float

    def moved(self, matrix: np.ndarray) -> "FoundCamera":
        """The camera after an affine (4, 4) ``matrix``; a scale does not enlarge it."""
        pose = matrix @ self.to_world
        pose[:3, :3] = normalise(pose[:3, :3].T).T
        return replace(self, to_world=pose)


def pose_of(camera: FoundCamera) -> np.ndarray:
    """(4, 4) world to camera space."""
    return rigid_to_camera(TURNED @ camera.to_world[:3, :3].T, camera.to_world[:3, 3])


def moved_light(light: Light, matrix: np.ndarray) -> Light:
    """A light after an affine (4, 4) ``matrix``; its strength stays."""
    turn = matrix[:3, :3]
    if light.kind == DIRECTIONAL:
        return replace(light, vector=triple(normalise(turn @ light.vector)))
    if light.is_spot:
        light = replace(light, normal=triple(normalise(turn @ light.normal)))
    return replace(light, vector=triple(turn @ light.vector + matrix[:3, 3]))


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
    flat = np.concatenate([np.zeros((0, 9)), *(part.triangles.reshape(-1, 9) for part in parts)])
    finite = columnwise(np.maximum, np.abs(flat)) <= 1e18  # NaN is not
    points = (flat if finite.all() else flat[finite]).reshape(-1, 3)
    if not len(points):
        problem = "the scene is empty: no triangle has finite corners"
        remedy = "Check the meshes for NaN or infinite coordinates"
        raise Where(file, "objects").error(problem, remedy)
    low, high = (np.array([of(axis) for axis in points.T]) for of in (np.min, np.max))
    return Bounds(low, high, points)


def place_camera(
    description: dict,
    extent: Bounds,
    where: Where,
    found: FoundCamera | None = None,
    lens: Camera | None = None,
    size: Size = SQUARE,
) -> tuple[Camera, np.ndarray]:
    """The lens and the (4, 4) world-to-camera matrix of a checked ``camera`` mapping.

    ``found`` is a glTF file's camera, for a description without pose and direction; ``lens``
    replaces the description's.  A framed scene fills a picture of the shape of ``size``: by the
    focal length of a fitted lens, by the distance of a given one.
    """
    zoom = description["zoom"]
    if not (zoom > 0 and math.isfinite(zoom)):
        raise where["zoom"].error(f"must be positive, not {zoom:g}", "Give 2 for twice")
    pose, at = description.get("pose"), where["camera"]["pose"]
    if pose is not None or "view_from" in description:
        found = None
    if found is not None:
        to_camera = pose_of(found)
    elif pose is None:
        own = _own_width(description, lens)
        shape = np.array(size) / size.shorter
        to_camera = _framing_pose(description, extent, where, own, shape if own else np.ones(2))
    elif "matrix" in pose:
        to_camera = pose_from_matrix(pose["matrix"], at["matrix"])
    else:
        to_camera = look_at(pose["position_m"], pose["look_at_m"], pose["up"], at)
    if lens is not None:
        return replace(lens, pose=None), to_camera
    triangles = extent.points.reshape(-1, 3, 3) @ to_camera[:3, :3].T
    triangles += to_camera[:3, 3]
    width = (FIELD_WIDTH if found is None else found.field_width) / zoom
    if found is None and pose is None:
        width *= _share_needed(triangles.reshape(-1, 3), size)
    try:
        return _lens(description, triangles, width), to_camera
    except OpticsError as error:
        key = "pose" if error.key == "focus_m" and "focus_m" not in description else error.key
        raise where["camera"][key].error(error.problem, error.remedy) from None


def _lens(description: dict, triangles: np.ndarray, width: float) -> Camera:
    """The camera of a description; missing keys are fitted to the visible depths of
    ``triangles``."""
    lens = _given_lens(description)
    if lens is not None:
        width = lens[1] / lens[0]
    visible = depth_range(triangles, width)
    focus_key = description.get("focus_m", "middle")
    if "focus_at" in description:
        focus = focus_at(triangles, width, description["focus_at"])
    elif visible is None and isinstance(check_words(focus_key), str):
        problem = "the camera sees nothing that it could focus on"
        remedy = "Turn the camera round, or give camera.focus_m in metres"
        raise OpticsError(problem, key="focus_m", remedy=remedy)
    else:
        focus = focus_distance(focus_key, visible)
    depths = visible or DepthRange(focus, focus)
    if lens is None:
        camera = fitted_lens(depths, width, focus)
    else:
        focal, sensor = lens
        camera = Camera(focal, sensor, focal / fitted_diameter(depths, width), focus)
    f_number = float(description.get("f_number", camera.f_number))
    if "blur" in description:
        f_number = f_number_of_blur(
            description["blur"], camera.focal_length_m, focus, width, visible
        )
    return replace(camera, f_number=f_number)


def fitted_lens(seen: DepthRange, width: float, focus_m: float) -> Camera:
    """A lens of :data:`F_NUMBER` and :func:`fitted_diameter` with a field of ``width``."""
    focal = F_NUMBER * fitted_diameter(seen, width)
    check_focus(focus_m, focal, key="focus_m")
    return Camera(focal, width * image_distance(focal, focus_m), F_NUMBER, focus_m)


def _given_lens(description: dict) -> tuple[float, float] | None:
    """Focal length and sensor width, metres, of a description that gives one of them."""
    focal, sensor = description.get("focal_length_mm"), description.get("sensor_width_mm")
    if focal is None and sensor is None:
        return None
    return float(focal or 50.0) / 1000, float(sensor or 36.0) / 1000 / description["zoom"]


def fitted_diameter(seen: DepthRange, width: float) -> float:
    """The diameter, metres, of a lens that blurs both ends by :data:`BLUR` from the middle."""
    defocus = seen.defocus(seen.middle_m)
    widest = WIDEST * seen.near_m if math.isfinite(seen.near_m) else 1.0
    return min(widest, BLUR * width / defocus) if defocus > 0 else widest


def _own_width(description: dict, lens: Camera | None) -> float | None:
    """The tangent extent of a lens's field that is given, without the zoom."""
    if lens is not None:
        return lens.field_width
    fixed = _given_lens({**description, "zoom": 1.0})
    return fixed and fixed[1] / fixed[0]


def _share_needed(points: np.ndarray, size: Size) -> float:
    """The field of the shorter side of a picture that frames ``points`` (V, 3), in camera space.

    It is a share of the field of a square picture.
    """
    x, y, z = points.T
    sides = np.array([np.abs(across / z).max() for across in (x, y)])
    needed = sides * size.shorter / np.array(size)
    return float(needed.max() / sides.max()) if sides.max() > 0 else 1.0


def _framing_pose(
    description: dict, extent: Bounds, where: Where, own: float | None, shape: np.ndarray
) -> np.ndarray:
    """The nearest pose in the chosen direction that has every vertex in the picture, centred.

    ``own`` is the field of a given lens, and ``shape`` the picture's sides over the shorter one.
    """
    direction, up = _direction(description.get("view_from", FRONT_LEFT), where["view_from"])
    turn = look_at(direction.tolist(), (0, 0, 0), up.tolist())[:3, :3]
    *across, z = turn @ (extent.points - extent.centre).T
    # From (x0, y0, -distance) a vertex is in the picture when |x - x0| <= k (z + distance) and y
    # likewise.  The sum of the upper and the lower bound of k distance is free of x0.
    halves = FILLED * (own or FIELD_WIDTH) / 2 * shape
    bounds_of = [
        ((x - k * z).max() + (-x - k * z).max()) / 2 / k
        for x, k in zip(across, halves, strict=True)
    ]
    distance = max(*map(float, bounds_of), 1.5 * extent.radius) or 1.0
    aside = turn[:2].T @ [_balanced(x, z + distance) for x in across]
    middle = extent.centre + aside
    place = middle + distance * direction
    if np.array_equal(place, middle):
        problem = f"the scene is too small, {2 * extent.radius:.3g} m, so far from the origin"
        raise where["objects"].error(problem, "Move it to the origin")
    return look_at(place.tolist(), middle.tolist(), up.tolist())


def _direction(view_from: str, where: Where) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (3,) from a scene towards a camera, and upwards in its picture."""
    text = str(view_from).strip().lower()
    try:
        azimuth, elevation = DIRECTIONS.get(text) or map(float, text.split(","))
        valid = abs(elevation) <= 90 and math.isfinite(azimuth)
    except ValueError:
        valid = False
    if not valid:
        remedy = f"Give {', '.join(DIRECTIONS)}, or azimuth,elevation in degrees such as 30,20"
        raise where.error(f"{view_from!r} is no direction", remedy)
    turn, rise = math.radians(azimuth), math.radians(elevation)
    aside, ahead = math.sin(turn), math.cos(turn)
    level, steep = math.cos(rise), math.sin(rise)
    towards = np.array([aside * level, steep, ahead * level])
    return towards, np.array([-aside * steep, level, -ahead * steep])


def _balanced(x: np.ndarray, depth: np.ndarray) -> float:
    """The camera's x from which (V,) places ``x`` at ``depth`` reach equally far to both sides."""
    middle, near, far = 0.0, float(depth.min()), float(depth.max())
    for _ in range(50):
        tangents = (x - middle) / depth
        low, high = float(tangents.min()), float(tangents.max())
        lacking = (high + low) / 2
        # The middle moves on by at most |lacking| far: few places can come to reach farthest.
        change = 1.001 * abs(lacking) * (far / near - 1)
        outer = (tangents >= high - change) | (tangents <= low + change)
        x, depth = x[outer], depth[outer]
        middle += lacking * near
    return middle


def default_lights() -> list[Light]:
    """In camera space: a key light with shadows over the camera's left shoulder, and a faint one
    from the right that fills them."""
    key, fill = (
        triple(np.array(towards) / np.linalg.norm(towards))
        for towards in ([-0.5, -0.8, -0.7], [0.8, -0.15, -0.6])
    )
    return [
        Light(DIRECTIONAL, key, (0.85, 0.83, 0.8)),
        Light(DIRECTIONAL, fill, (0.18, 0.19, 0.21), casts_shadows=False),
    ]


def default_focus_distances(camera: Camera, triangles: np.ndarray) -> tuple:
    """Five distances in metres, near to far, even in dioptres over the visible depths, or the
    recorded focus; ``triangles`` are in camera space."""
    visible = depth_range(triangles, camera.field_width)
    nearest = NEAREST_FOCUS * camera.focal_length_m
    if visible is None or visible.far_m <= nearest:
        return (camera.focus_m,)
    visible = DepthRange(max(visible.near_m, nearest), visible.far_m)
    return tuple(visible.at(float(share)) for share in np.linspace(0, 1, 5))

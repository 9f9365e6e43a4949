"""What a scene's own camera photographs: film, pinholes, thin lens, shutter.

One place for pbrt's cameras and for scene.yaml's ``lightfield``, so that both mean the same.
Conventions and defaults of the light field camera are those of CS348b's third assignment.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray, thin_lens
from lfcore.optics.camera import Camera

PERSPECTIVE, LIGHTFIELD = "perspective", "lightfield"
# Defaults of the assignment's starter code, and pbrt's own.
FOV_DEG = 90.0
CAMERAS_PER_DIM = (16, 16)
CAMERA_GRID_BOUNDS_M = (-0.6, 0.6, -0.6, 0.6)
SHUTTER = (0.0, 1.0)


@dataclass(frozen=True)
class View:
    """What a camera and its film ask for.

    Parameters
    ----------
    kind : str
        ``perspective`` or ``lightfield``.
    camera : Camera
        The thin lens; of a light field one that is as wide as the grid.
    array : CameraArray
        Every pinhole of the film: one camera for ``perspective``, the grid for ``lightfield``.
    film : (int, int)
        Width and height of the whole picture, pixels.
    shutter : (float, float)
        Its opening and closing, in the scene's unit of time.
    lens_radius_m : float
        Radius of the thin lens; 0 is a pinhole.
    samples_per_pixel : int
        Rays per pixel, as the scene asks for.
    motion_times : (float, float)
        The times of moving objects' first and last pose.

    Raises
    ------
    OpticsError
        The shutter closes before it opens.
    """

    kind: str
    camera: Camera
    array: CameraArray
    film: tuple[int, int]
    shutter: tuple[float, float] = SHUTTER
    lens_radius_m: float = 0.0
    samples_per_pixel: int = 1
    motion_times: tuple[float, float] = (0.0, 1.0)

    def __post_init__(self) -> None:
        opened, closed = self.shutter
        if closed < opened:
            problem, remedy = f"closes at {closed:g}, before it opens", "Let it open first"
            raise OpticsError(problem, key="shutter", remedy=remedy)

    def to_json(self) -> dict:
        camera = self.camera.to_json()
        if math.isinf(self.camera.focus_m):
            camera["focus_distance_m"] = "infinity"  # JSON has no infinity
        return {**vars(self), "camera": camera, "array": self.array.to_json()}

    @classmethod
    def from_json(cls, data: dict) -> View:
        """Raises :class:`OpticsError` or ``TypeError`` for what :meth:`to_json` does not write."""
        camera = Camera.from_json(data["camera"])
        array, pairs = CameraArray.from_json(data["array"]), ("film", "shutter", "motion_times")
        rest = {key: tuple(data[key]) for key in pairs}
        return cls(**{**data, "camera": camera, "array": array, **rest})


def lightfield_view(
    film: Sequence[int],
    fov_deg: float = FOV_DEG,
    cameras_per_dim: Sequence[int] = CAMERAS_PER_DIM,
    grid_bounds_m: Sequence[float] = CAMERA_GRID_BOUNDS_M,
    spacing: str = "ends",
) -> View:
    """A grid of pinholes that share one film; bounds are minX maxX minY maxY, y up."""
    for length, count, name in zip(film, cameras_per_dim, ("width", "height"), strict=True):
        if count < 1:
            raise OpticsError(f"must be at least 1, not {count}", key="cameras_per_dim")
        if length % count:
            problem = f"divides a film {name} of {length} into {count} tiles with a remainder"
            remedy = "Make the film a multiple of the cameras"
            raise OpticsError(problem, key="cameras_per_dim", remedy=remedy)
    tile = tuple(length // count for length, count in zip(film, cameras_per_dim, strict=True))
    array = CameraArray.on_grid(cameras_per_dim, grid_bounds_m, fov_deg, tile, spacing)
    widest = max(abs(bound) for bound in grid_bounds_m)
    camera = thin_lens(array.field_width, widest, math.inf)
    return View(LIGHTFIELD, camera, array, (film[0], film[1]))

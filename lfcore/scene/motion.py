"""Motions of a scene's triangles, and the scene at an instant.

Poses are computed in float64 and rounded to the scene's float32 once.  Source: pbrt for rigid
motions, on the shortest arc.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.arrays import check_array
from lfcore.scene.assemble import Geometry, sound
from lfcore.scene.surface_mesh import SurfaceMesh
from lfcore.scene.transforms import affine

if TYPE_CHECKING:
    from lfcore.scene.model import Scene

Moving = tuple[SurfaceMesh, tuple[np.ndarray, np.ndarray]]
"""A part in its first pose, and its object's first and last (4, 4) poses in camera space."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A rigid motion of some triangles while the shutter is open.

    Parameters
    ----------
    first, count : int
        The first triangle and the number of triangles.
    start, end : ndarray
        (4, 4) float64: the first and last pose in camera space.  The scene's arrays have the
        triangles in the first pose.
    """

    first: int
    count: int
    start: np.ndarray
    end: np.ndarray

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            check_array(name, getattr(self, name), (4, 4))

    def pose(self, time: float) -> np.ndarray:
        """(4, 4) that moves the stored triangles to ``time`` in [0, 1]."""
        from scipy.spatial.transform import Rotation, Slerp  # seldom needed, slow to import

        move = self.end @ np.linalg.inv(self.start)
        slerp = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([np.eye(3), move[:3, :3]])))
        turn = slerp(time).as_matrix()
        # Objects turn about their own origin, not about the camera.
        pivot = self.start[:3, 3]
        return affine(turn, pivot + time * (self.end[:3, 3] - pivot) - turn @ pivot)


@dataclass(frozen=True, eq=False)
class Animation:
    """The animation of a scene's files, from ``start_s`` to ``end_s``; it rests before and after.

    ``at(scene, time_s)`` gives the scene at an instant.
    """

    start_s: float
    end_s: float
    at: Callable[[Scene, float], Scene]


def motions(
    geometry: Geometry, static: Sequence[SurfaceMesh], moving: Sequence[Moving]
) -> tuple[Motion, ...]:
    """The motions of ``moving`` parts, whose triangles follow those of ``static`` parts.

    All parts are in camera space; dropped triangles do not count.
    """
    first = sum(int(sound(part.triangles)[0].sum()) for part in static)
    intervals = []
    for part, (start, end) in moving:
        count = int(sound(part.triangles)[0].sum())
        intervals.append(Motion(first, count, start, end))
        first += count
    assert not moving or first == len(geometry.triangles)
    return tuple(intervals)


def is_rigid(start: np.ndarray, end: np.ndarray) -> bool:
    """Whether the motion between two poses neither scales, shears nor mirrors."""
    try:
        move = (end @ np.linalg.inv(start))[:3, :3]
    except np.linalg.LinAlgError:  # a pose that flattens
        return False
    return bool(np.allclose(move @ move.T, np.eye(3), atol=1e-6) and np.linalg.det(move) > 0)


def scene_at(scene: Scene, time_s: float) -> Scene:
    """:meth:`Scene.at`."""
    if not math.isfinite(time_s):
        raise SceneError(f"must be a finite number, not {time_s!r}", key="time_s")
    if scene.animation:
        scene = scene.animation.at(replace(scene, animation=None), time_s)
    if not scene.motions:
        return scene
    start, end = scene.motion_times
    share = min(max((time_s - start) / (end - start), 0.0), 1.0)
    triangles, normals = scene.triangles.copy(), scene.normals.copy()
    for motion in scene.motions:
        rows = slice(motion.first, motion.first + motion.count)
        pose = motion.pose(share)
        moved = scene.triangles[rows].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        triangles[rows] = moved.astype(np.float32)
        if len(normals):
            turned = scene.normals[rows].astype(np.float64) @ pose[:3, :3].T
            normals[rows] = turned.astype(np.float32)
    return replace(scene, triangles=triangles, normals=normals, motions=())

"""Rigid motion during the shutter: the moving triangles, and the scene at one instant.

An object has a first and a last pose; between them it turns on the shortest arc and its origin
moves on a straight line, as in pbrt.  :meth:`View.motion_time` is the time of a shutter position.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.assemble import Geometry, sound
from lfcore.scene.model import Motion, Scene
from lfcore.scene.surface_mesh import SurfaceMesh

Moving = tuple[SurfaceMesh, tuple[np.ndarray, np.ndarray]]
"""A part in its first pose, and its object's first and last (4, 4) poses in camera space."""


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


def scene_at(scene: Scene, time: float) -> Scene:
    """The scene when its motions are at ``time``, 0 first pose and 1 last; it moves no more.

    Averaging traces at stratified times samples the camera equation's time dimension.
    """
    if not 0 <= time <= 1:
        raise SceneError(f"time {time} is outside the motion", remedy="Use 0 to 1")
    if not scene.motions:
        return scene
    triangles, normals = scene.triangles.copy(), scene.normals.copy()
    for motion in scene.motions:
        rows = slice(motion.first, motion.first + motion.count)
        pose = motion.pose(time)
        moved = scene.triangles[rows].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        triangles[rows] = moved.astype(np.float32)
        if len(normals):
            turned = scene.normals[rows].astype(np.float64) @ pose[:3, :3].T
            normals[rows] = turned.astype(np.float32)
    return replace(scene, triangles=triangles, normals=normals, motions=())

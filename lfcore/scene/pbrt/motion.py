"""Rigid motion during the shutter: which triangles move, and the scene at one instant.

pbrt gives the pose at shutter open and close (``ActiveTransform``) and interpolates between:
rotation on the shortest arc, translation on a straight line, as here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from lfcore.errors import SceneError
from lfcore.scene.model import Scene


@dataclass(frozen=True, eq=False)
class Motion:
    """Triangles ``first .. first + count`` move rigidly.

    ``start`` and ``end`` are (4, 4) float64 poses in camera space at shutter open and close; the
    scene's arrays hold the triangles at shutter open.
    """

    first: int
    count: int
    start: np.ndarray
    end: np.ndarray

    def pose(self, time: float) -> np.ndarray:
        """(4, 4) that moves the stored triangles to ``time`` in [0, 1] of the shutter."""
        move = self.end @ np.linalg.inv(self.start)
        turn = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([np.eye(3), move[:3, :3]])))(time)
        # Objects turn about their own origin, not about the camera.
        pivot = self.start[:3, 3]
        matrix = np.eye(4)
        matrix[:3, :3] = turn.as_matrix()
        matrix[:3, 3] = pivot + time * (self.end[:3, 3] - pivot) - matrix[:3, :3] @ pivot
        return matrix


def is_rigid(start: np.ndarray, end: np.ndarray) -> bool:
    """Whether the motion between two poses neither scales, shears nor mirrors."""
    move = (end @ np.linalg.inv(start))[:3, :3]
    return bool(np.allclose(move @ move.T, np.eye(3), atol=1e-6) and np.linalg.det(move) > 0)


def scene_at(scene: Scene, motions: tuple[Motion, ...], time: float) -> Scene:
    """The scene at ``time`` of the shutter, 0 open and 1 closed.

    Averaging traces at stratified times samples the camera equation's time dimension.

    Raises
    ------
    SceneError : a time outside [0, 1].
    """
    if not 0 <= time <= 1:
        raise SceneError(f"time {time} lies outside the shutter", remedy="Use 0 to 1")
    if not motions:
        return scene
    triangles, normals = scene.triangles.copy(), scene.normals.copy()
    for motion in motions:
        rows = slice(motion.first, motion.first + motion.count)
        pose = motion.pose(time)
        moved = scene.triangles[rows].astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        triangles[rows] = moved.astype(np.float32)
        if len(normals):
            turned = scene.normals[rows].astype(np.float64) @ pose[:3, :3].T
            normals[rows] = turned.astype(np.float32)
    return replace(scene, triangles=triangles, normals=normals)

"""Scenes at an instant: curves through keys, rigid motions, and animations of files.

Poses are computed in float64 and rounded to the scene's float32 once.  Sources: Khronos, "glTF 2.0
Specification", appendix C, for curves; pbrt for rigid motions, on the shortest arc.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.assemble import Geometry, sound
from lfcore.scene.model import Motion, Scene
from lfcore.scene.surface_mesh import SurfaceMesh

Moving = tuple[SurfaceMesh, tuple[np.ndarray, np.ndarray]]
"""A part in its first pose, and its object's first and last (4, 4) poses in camera space."""
STEP, LINEAR, CUBIC = "STEP", "LINEAR", "CUBICSPLINE"
"""The kinds of curves, by glTF's names."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A quantity over time, through keys; it rests before the first and after the last.

    Attributes
    ----------
    times : (K,) float64, seconds, ascending; K >= 1.
    values : (K, ...) float64, at the keys; of a cubic spline (K, 3, ...): the tangent before each
        key, per second, the value, and the tangent after it.
    kind : :data:`STEP`, :data:`LINEAR` or :data:`CUBIC`.
    turns : whether values are quaternions, w last, which move on the shortest arc.
    """

    times: np.ndarray
    values: np.ndarray
    kind: str = LINEAR
    turns: bool = False

    def at(self, time_s: float) -> np.ndarray:
        """The value at an instant; quaternions have the length 1."""
        values = self.values[:, 1] if self.kind == CUBIC else self.values
        key = int(np.searchsorted(self.times, time_s, side="right")) - 1
        if key < 0 or key == len(self.times) - 1 or self.kind == STEP:
            return self._unit(values[max(key, 0)])
        span = self.times[key + 1] - self.times[key]
        share = (time_s - self.times[key]) / span
        before, after = values[key], values[key + 1]
        if self.kind == CUBIC:
            leaving, arriving = self.values[key, 2] * span, self.values[key + 1, 0] * span
            return self._unit(_hermite(share, before, leaving, after, arriving))
        if self.turns:
            return _on_arc(share, self._unit(before), self._unit(after))
        return before + share * (after - before)

    def _unit(self, value: np.ndarray) -> np.ndarray:
        return value / (np.linalg.norm(value) or 1.0) if self.turns else value


def _hermite(
    t: float, before: np.ndarray, leaving: np.ndarray, after: np.ndarray, arriving: np.ndarray
) -> np.ndarray:
    """The cubic through two values with tangents, at ``t`` from 0 to 1."""
    square, cube = t * t, t * t * t
    return (
        (2 * cube - 3 * square + 1) * before + (cube - 2 * square + t) * leaving
        + (3 * square - 2 * cube) * after + (cube - square) * arriving
    )  # fmt: skip


def _on_arc(share: float, before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """The quaternion between two unit ones, on the shorter arc."""
    if before @ after < 0:
        after = -after
    # From the chord: the cosine of a small angle has lost it.
    angle = 2 * math.atan2(np.linalg.norm(after - before), np.linalg.norm(after + before))
    if angle == 0:
        return before
    parts = math.sin((1 - share) * angle) * before + math.sin(share * angle) * after
    return parts / math.sin(angle)


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

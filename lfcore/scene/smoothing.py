"""Smooth shading normals for a triangle soup, with creases kept sharp."""

import numpy as np

from lfcore.scene.surface_mesh import normalise

MAX_VALENCE = 512


def crease_normals(triangles: np.ndarray, crease_deg: float = 40.0) -> np.ndarray:
    """(T, 3, 3) unit normals, the area-weighted mean of the faces that share a corner's position
    and whose normal is within ``crease_deg`` of its own face's.

    Corners where more than :data:`MAX_VALENCE` faces meet stay flat: pairs grow with its square.
    """
    triangles = np.asarray(triangles, np.float64)
    faces = len(triangles)
    if faces == 0:
        return np.zeros((0, 3, 3))
    area_vectors = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    unit = normalise(area_vectors)
    points = triangles.reshape(-1, 3)
    corners = np.lexsort(points.T)  # those of one place side by side
    apart = (points[corners[1:]] != points[corners[:-1]]).any(1)
    starts = np.flatnonzero(np.r_[True, apart])
    valence = np.diff(np.r_[starts, len(corners)])

    usable = np.where(valence <= MAX_VALENCE, valence, 0)
    # Every ordered pair of corners at one vertex: corner a gathers from the face of corner b.
    repeats = np.repeat(usable, valence)
    first = np.repeat(np.arange(len(corners)), repeats)
    offset = np.arange(len(first)) - np.repeat(np.cumsum(repeats) - repeats, repeats)
    second = np.repeat(np.repeat(starts, valence), repeats) + offset
    corner_a, face_b = corners[first], corners[second] // 3
    together = (unit[corner_a // 3] * unit[face_b]).sum(1) >= np.cos(np.radians(crease_deg))
    corner_a, face_b = corner_a[together], face_b[together]
    sums = np.stack(
        [np.bincount(corner_a, area_vectors[face_b, k], 3 * faces) for k in range(3)], axis=1
    )
    flat = np.repeat(unit, 3, axis=0)
    smooth = normalise(sums)
    return np.where((sums != 0).any(1, keepdims=True), smooth, flat).reshape(faces, 3, 3)

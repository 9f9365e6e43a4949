"""Loop subdivision surfaces (Loop 1987; weights and limit rules as pbrt section 3.8 gives them)."""

import numpy as np
from scipy import sparse

from lfcore.errors import SceneError


def loop_subdivide(
    points: np.ndarray, faces: np.ndarray, levels: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Subdivide (P, 3) points and (F, 3) faces ``levels`` times, then push every vertex to the
    limit surface, and give it a unit normal."""
    for _ in range(levels):
        points, faces = _subdivide(points, faces)
    limit = _limit(points, faces)
    return limit, faces, _normals(limit, faces)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unique edges (E, 2), the edge of each face side (F, 3), and which edges are boundary."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2), 1)
    edges, inverse, uses = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    if (uses > 2).any():
        raise SceneError("a subdivision mesh has an edge shared by more than two triangles")
    return edges, inverse.reshape(-1, 3), uses == 1


def _neighbours(edges: np.ndarray, count: int) -> sparse.csr_matrix:
    ones = np.ones(len(edges))
    half = sparse.coo_matrix((ones, (edges[:, 0], edges[:, 1])), (count, count))
    return (half + half.T).tocsr()


def _boundary(
    edges: np.ndarray, open_edge: np.ndarray, count: int
) -> tuple[sparse.csr_matrix, np.ndarray]:
    """Neighbours along the boundary (matrix) and which vertices lie on it."""
    along = _neighbours(edges[open_edge], count)
    return along, np.diff(along.indptr) > 0


def _beta(valence: np.ndarray) -> np.ndarray:
    return np.where(valence == 3, 3.0 / 16.0, 3.0 / (8.0 * np.maximum(valence, 1)))


def _subdivide(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    count = len(points)
    edges, side_edge, open_edge = _edges(faces)
    ring = _neighbours(edges, count)
    along, on_boundary = _boundary(edges, open_edge, count)
    valence = np.diff(ring.indptr)[:, None]
    beta = _beta(valence)
    even = (1 - valence * beta) * points + beta * (ring @ points)
    even = np.where(on_boundary[:, None], 0.75 * points + 0.125 * (along @ points), even)
    # An edge point: 3/8 of its ends and 1/8 of the two corners opposite; the middle on a boundary.
    opposite = np.zeros((len(edges), 3))
    for side in range(3):
        np.add.at(opposite, side_edge[:, side], points[faces[:, (side + 2) % 3]])
    ends = points[edges].sum(1)
    odd = np.where(open_edge[:, None], 0.5 * ends, 0.375 * ends + 0.125 * opposite)
    a, b, c = faces.T
    ab, bc, ca = (count + side_edge).T
    corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([even, odd]), np.concatenate([np.stack(f, -1) for f in corners])


def _limit(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    count = len(points)
    edges, _, open_edge = _edges(faces)
    ring = _neighbours(edges, count)
    along, on_boundary = _boundary(edges, open_edge, count)
    valence = np.diff(ring.indptr)[:, None]
    gamma = 1.0 / (valence + 3.0 / (8.0 * _beta(valence)))
    inside = (1 - valence * gamma) * points + gamma * (ring @ points)
    edge = 0.6 * points + 0.2 * (along @ points)
    return np.where(on_boundary[:, None], edge, inside)


def _normals(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Area-weighted vertex normals of the limit mesh, unit."""
    corners = points[faces]
    face_normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    for corner in range(3):
        np.add.at(normals, faces[:, corner], face_normal)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0, length, 1.0)

"""Loop subdivision surfaces (Loop 1987; weights and limit rules as pbrt section 3.8 gives them)."""

import numpy as np
from scipy import sparse

from lfcore.errors import SceneError
from lfcore.scene.surface_mesh import normalise


def loop_subdivide(
    points: np.ndarray, faces: np.ndarray, levels: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Subdivide (P, 3) points and (F, 3) faces ``levels`` times, then push every vertex to the
    limit surface, and give it a unit normal."""
    for _ in range(levels):
        points, faces = _subdivide(points, faces)
    edges, _, is_open = _edges(faces)
    limit = _moved(points, edges, is_open, limit=True)
    a, b, c = limit[faces].swapaxes(0, 1)
    normals = np.zeros_like(limit)
    np.add.at(normals, faces, np.cross(b - a, c - a)[:, None])
    return limit, faces, normalise(normals)


def _edges(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unique edges (E, 2), the edge of each face side (F, 3), and which edges are boundary."""
    sides = np.sort(np.stack([faces, np.roll(faces, -1, 1)], -1).reshape(-1, 2), 1)
    edges, inverse, uses = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    if (uses > 2).any():
        raise SceneError("a subdivision mesh has an edge shared by more than two triangles")
    return edges, inverse.reshape(-1, 3), uses == 1


def _moved(
    points: np.ndarray, edges: np.ndarray, is_open: np.ndarray, *, limit: bool = False
) -> np.ndarray:
    """The vertices after a subdivision, or on the limit surface: means with their neighbours, on a
    boundary with those along it."""

    def neighbours(edges: np.ndarray) -> sparse.csr_matrix:
        shape = len(points), len(points)
        half = sparse.coo_matrix((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape)
        return (half + half.T).tocsr()

    ring, along = neighbours(edges), neighbours(edges[is_open])
    valence = np.diff(ring.indptr)[:, None]
    share = np.where(valence == 3, 3.0 / 16.0, 3.0 / (8.0 * np.maximum(valence, 1)))
    if limit:
        share = 1.0 / (valence + 3.0 / (8.0 * share))
    rim = 0.2 if limit else 0.125
    inside = (1 - valence * share) * points + share * (ring @ points)
    edge = (1 - 2 * rim) * points + rim * (along @ points)
    return np.where((np.diff(along.indptr) > 0)[:, None], edge, inside)


def _subdivide(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    edges, side_edge, is_open = _edges(faces)
    # An edge point: 3/8 of its ends and 1/8 of the two corners opposite; the middle on a boundary.
    opposite = np.zeros((len(edges), 3))
    np.add.at(opposite, side_edge, points[np.roll(faces, -2, 1)])
    ends = points[edges].sum(1)
    odd = np.where(is_open[:, None], 0.5 * ends, 0.375 * ends + 0.125 * opposite)
    a, b, c = faces.T
    ab, bc, ca = (len(points) + side_edge).T
    corners = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    even = _moved(points, edges, is_open)
    return np.concatenate([even, odd]), np.concatenate([np.stack(f, -1) for f in corners])

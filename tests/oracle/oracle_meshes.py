"""Meshes for the oracle's tests."""

import numpy as np
import trimesh


def soup(count, seed=0, size=0.05):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1, 1, (count, 1, 3)) + [0, 0, 3]
    return (centres + rng.normal(0, size, (count, 3, 3))).astype(np.float32)


def sphere(rows=8, columns=12, radius=1.0, centre=(0, 0, 0)):
    """Closed: vertices (V, 3) float32 and faces (F, 3), many of which meet at the poles."""
    mesh = trimesh.creation.uv_sphere(radius, (rows, columns))
    return np.float32(mesh.vertices + centre), mesh.faces


def aimed(vertices, faces, origin):
    """Rays from ``origin`` at all vertices and at points of all edges, float32."""
    p = vertices.astype(np.float64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    points = [p] + [p[edges[:, 0]] * w + p[edges[:, 1]] * (1 - w) for w in (0.5, 0.3, 0.01)]
    origin = np.float32(origin)
    directions = (np.concatenate(points) - origin).astype(np.float32)
    return np.broadcast_to(origin, directions.shape), directions

"""Meshes for the oracle's tests."""

import numpy as np


def soup(count, seed=0, size=0.05):
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-1, 1, (count, 1, 3)) + [0, 0, 3]
    return (centres + rng.normal(0, size, (count, 3, 3))).astype(np.float32)


def sphere(rows=8, columns=12, radius=1.0, centre=(0, 0, 0)):
    """Closed: vertices (V, 3) float32 and faces (F, 3), poles of valence ``columns``."""
    theta = np.linspace(0, np.pi, rows + 1)[1:-1, None]
    phi = np.linspace(0, 2 * np.pi, columns, endpoint=False) + 0 * theta
    ring = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi)], -1)
    ring = np.concatenate([ring, (np.cos(theta) + 0 * phi)[..., None]], -1).reshape(-1, 3)
    vertices = np.concatenate([ring, [[0, 0, 1], [0, 0, -1]]]) * radius + centre
    north, south = len(ring), len(ring) + 1
    faces = []
    for i in range(columns):
        j = (i + 1) % columns
        faces.append((north, i, j))
        last = (rows - 2) * columns
        faces.append((south, last + j, last + i))
        for row in range(rows - 2):
            a, b = row * columns + i, row * columns + j
            faces += [(a, a + columns, b), (b, a + columns, b + columns)]
    return vertices.astype(np.float32), np.array(faces)


def aimed(vertices, faces, origin):
    """Rays from ``origin`` at all vertices and at points of all edges, float32."""
    p = vertices.astype(np.float64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    points = [p] + [p[edges[:, 0]] * w + p[edges[:, 1]] * (1 - w) for w in (0.5, 0.3, 0.01)]
    origin = np.float32(origin)
    directions = (np.concatenate(points) - origin).astype(np.float32)
    return np.broadcast_to(origin, directions.shape), directions

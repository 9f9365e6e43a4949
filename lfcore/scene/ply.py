"""Triangle strips of PLY files, which trimesh reads as points without faces."""

from typing import Any

import numpy as np

NAMES = ("vertex_indices", "vertex_index")


def with_strips(mesh: Any) -> Any:
    """A trimesh point cloud of a PLY file with ``tristrips`` as a mesh; anything else as it is.

    Raises ValueError for indices that no vertex has.
    """
    import trimesh

    raw = getattr(mesh, "metadata", {}).get("_ply_raw", {})
    if isinstance(mesh, trimesh.Trimesh) or "tristrips" not in raw or "vertex" not in raw:
        return mesh
    points = np.asarray(mesh.vertices, np.float64)
    faces = np.concatenate([np.zeros((0, 3), np.int64), *map(strip_faces, _strips(raw))])
    if len(faces) and faces.max() >= len(points):
        raise ValueError(f"a strip names vertex {faces.max()} of {len(points)}")
    columns = raw["vertex"].get("data")
    colours = getattr(mesh, "colors", None)
    return trimesh.Trimesh(
        points,
        faces,
        vertex_normals=vertex_columns(columns, len(points), ("nx", "ny", "nz")),
        vertex_colors=colours if colours is not None and len(colours) == len(points) else None,
        metadata=mesh.metadata,
        process=False,
    )


def strip_faces(indices: np.ndarray) -> np.ndarray:
    """(T, 3) of a strip (V,): every three in a row, every other one turned; -1 starts anew."""
    indices = np.asarray(indices, np.int64).ravel()
    if len(indices) < 3:
        return np.zeros((0, 3), np.int64)
    at = np.arange(len(indices))
    started = np.maximum.accumulate(np.where(indices < 0, at, -1)) + 1
    faces = np.stack([indices[:-2], indices[1:-1], indices[2:]], axis=1)
    turned = (at - started)[:-2] % 2 == 1
    faces[turned] = faces[turned][:, [1, 0, 2]]
    a, b, c = faces.T
    return faces[(faces >= 0).all(1) & (a != b) & (b != c) & (c != a)]


def _strips(raw: dict) -> list[np.ndarray]:
    """The strips of trimesh's raw data: a dictionary for text, a structured array for binary."""
    data = raw["tristrips"].get("data")
    known = data.keys() if isinstance(data, dict) else getattr(data, "dtype", np.dtype("f4")).names
    name = next((name for name in NAMES if name in (known or ())), None)
    if name is None:
        return []
    rows = data[name] if isinstance(data, dict) else data[name]["f1"]
    return list(rows)


def vertex_columns(raw: Any, count: int, names: tuple[str, ...]) -> np.ndarray | None:
    """Vertex properties of a PLY file as (count, len(names)) float64; None when it lacks them."""
    # The reader gives a structured array for binary files and a dictionary for text.
    known = raw.keys() if isinstance(raw, dict) else getattr(raw, "dtype", np.dtype("f4")).names
    if not set(names) <= set(known or ()) or any(len(raw[name]) != count for name in names):
        return None
    return np.stack([np.asarray(raw[name], np.float64).reshape(count) for name in names], -1)

"""Triangles of polygons (fans where these are right, else by ear clipping), strips and fans."""

import numpy as np

from lfcore.readers.account import Account
from lfcore.scene.notes import APPROXIMATED
from lfcore.scene.surface_mesh import normalise


def triangulate(
    points: np.ndarray, index: np.ndarray, counts: np.ndarray, account: Account
) -> tuple[np.ndarray, np.ndarray]:
    """The triangles of polygons, whose corners follow one another.

    Parameters
    ----------
    points : (V, 3) positions of the vertices.
    index : (C,) the vertices at the corners of all polygons.
    counts : (F,) corners of each polygon; one of fewer than three has no triangle.
    account : counts the faces, and notes those that cross themselves, whose area is uncertain.

    Returns
    -------
    corners : (T, 3) int64 indices into the C corners, polygon after polygon.
    polygons : (T,) int64, the polygon of each triangle.
    """
    starts = np.cumsum(counts) - counts
    parts, owners, crossed = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for number in np.unique(counts[counts >= 3]).tolist():
        polygons = np.flatnonzero(counts == number)
        corners = starts[polygons, None] + np.arange(number)
        first = np.broadcast_to(corners[:, :1], corners[:, 2:].shape)
        fans = np.stack([first, corners[:, 1:-1], corners[:, 2:]], -1)
        if number > 3:
            normals, wrong = _wrong_fans(points[index[corners]])
            if number == 4:  # the other diagonal
                a, b, c, d = corners[wrong].T
                fans[wrong] = np.stack([np.stack([b, c, d], -1), np.stack([b, d, a], -1)], 1)
            else:
                for k in np.flatnonzero(wrong).tolist():
                    ears, is_crossed = _ears(points[index[corners[k]]], normals[k])
                    crossed += is_crossed
                    missing = number - 2 - len(ears)  # where corners coincide
                    fans[k] = corners[k][np.pad(ears, ((0, missing), (0, 0)))]
        parts.append(fans.reshape(-1, 3))
        owners.append(np.repeat(polygons, number - 2))
    owner, triangles = np.concatenate(owners), np.concatenate(parts)
    if len(parts) > 2:
        order = np.argsort(owner, kind="stable")
        owner, triangles = owner[order], triangles[order]
    account.hold("faces", len(counts))
    account.use("faces", int((counts > 2).sum()))
    if crossed:
        account.lose("faces", APPROXIMATED, f"{crossed} faces that cross themselves", 0)
    return triangles, owner


def _wrong_fans(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The normals (F, 3) of polygons (F, N, 3), and the mask (F,) of polygons whose fan from the
    first corner has a triangle that faces the other side."""
    with np.errstate(invalid="ignore", over="ignore"):
        sides = points[:, 1:] - points[:, :1]
        areas = np.cross(sides[:, :-1], sides[:, 1:])
        normals = normalise(areas.sum(1))  # M. Newell's, as long as twice the area
        along = (areas * normals[:, None]).sum(-1)
        wrong = along.min(1) < -1e-12 * np.abs(along).max(1)
    return normals, wrong & np.isfinite(points).all((1, 2))


def _ears(points: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, bool]:
    """(T, 3) corners of the triangles of one polygon (N, 3), wound as it is, and whether it crosses
    itself, so that triangles do not add up to its area."""
    import mapbox_earcut

    axis = int(np.abs(normal).argmax())
    keep = [(1, 2), (2, 0), (0, 1)][axis]
    flat = points[:, keep] * [1.0, np.sign(normal[axis])]  # counter-clockwise
    ears = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
    ears = ears.reshape(-1, 3).astype(np.int64)
    (a, b), (c, d) = (flat[ears[:, k]].T - flat[ears[:, 0]].T for k in (1, 2))
    areas = a * d - b * c
    ears[areas < 0] = ears[areas < 0][:, ::-1]
    x, y = (flat - flat[0]).T
    whole = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
    return ears, bool(abs(np.abs(areas).sum() - whole) > 1e-3 * whole)


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


def fan_faces(indices: np.ndarray) -> np.ndarray:
    """(T, 3) of a fan (V,): every two in a row, and the first."""
    after = np.stack([indices[1:-1], indices[2:]], axis=1)
    return np.concatenate([after, np.full((len(after), 1), indices[0])], axis=1)

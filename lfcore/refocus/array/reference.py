"""Slow float64 references of the synthesis kernels, one obvious loop each.

They take the same arguments as the fast paths and return the same :class:`Synthesis`; tests
compare them element by element.
"""

from __future__ import annotations

import numpy as np

from lfcore.optics.array import CameraArray
from lfcore.refocus.array import sampling
from lfcore.refocus.array.focal_surface import FocalSurface, inverse_depth
from lfcore.refocus.array.result import Synthesis, combine
from lfcore.refocus.array.virtual_camera import VirtualCamera

# Rays on the very edge of grid or field belong to it, whatever the rounding.
EDGE = 1e-5


def film_centres(camera: VirtualCamera) -> np.ndarray:
    """(P, 2) film positions of the pixel centres, rows first."""
    u, v = np.meshgrid(*(np.arange(count) + 0.5 for count in camera.size))
    return np.stack([u.ravel(), v.ravel()], -1)


def tile_lookup(
    tiles: np.ndarray,
    array: CameraArray,
    i: np.ndarray,
    j: np.ndarray,
    x: np.ndarray,
    y: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear radiance (R, 3) of camera (column i, row j) at tangents (x, y), and who sees it."""
    width, height = array.tile
    columns, rows = np.asarray(array.columns_m), np.asarray(array.rows_m)
    px = (x + columns[i] * array.delta) / array.pixel_pitch + (width - 1) / 2
    py = (y + rows[j] * array.delta) / array.pixel_pitch + (height - 1) / 2
    slack = EDGE * width
    inside = (np.abs(px - (width - 1) / 2) <= width / 2 + slack) & (
        np.abs(py - (height - 1) / 2) <= height / 2 + slack
    )
    px, py = np.clip(np.nan_to_num(px), 0, width - 1), np.clip(np.nan_to_num(py), 0, height - 1)
    a = np.minimum(px.astype(np.int64), max(width - 2, 0))
    b = np.minimum(py.astype(np.int64), max(height - 2, 0))
    fx, fy = (px - a)[:, None], (py - b)[:, None]
    a1, b1 = np.minimum(a + 1, width - 1), np.minimum(b + 1, height - 1)
    pick = lambda row, column: tiles[j, i, row, column].astype(np.float64)  # noqa: E731
    top = pick(b, a) * (1 - fx) + pick(b, a1) * fx
    bottom = pick(b1, a) * (1 - fx) + pick(b1, a1) * fx
    return top * (1 - fy) + bottom * fy, inside


def aim(
    origins: np.ndarray,
    directions: np.ndarray,
    q: np.ndarray,
    position_x: float | np.ndarray,
    position_y: float | np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tangents at which the camera (x, y, 0) sees the point at inverse parameter q, and if it can.

    The point is ``O + D / q``; multiplied through by q nothing is infinite.
    """
    depth = origins[:, 2] * q + directions[:, 2]
    ahead = depth > 0
    safe = np.where(ahead, depth, 1.0)
    x = (directions[:, 0] + (origins[:, 0] - position_x) * q) / safe
    y = (directions[:, 1] + (origins[:, 1] - position_y) * q) / safe
    return x, y, ahead


def isaksen(
    image: np.ndarray,
    array: CameraArray,
    camera: VirtualCamera,
    surface: FocalSurface,
    filter_width_m: float,
) -> Synthesis:
    """Cone-filtered sum over the data cameras near the central ray (Isaksen 2000, figure 4)."""
    tiles = array.tiles(image)
    film = film_centres(camera)
    directions = camera.directions(film[:, 0], film[:, 1])
    origins = np.broadcast_to(camera.position_m, directions.shape)
    q = inverse_depth(surface, camera, origins, directions, film)
    with np.errstate(divide="ignore", invalid="ignore"):
        travel = -origins[:, 2] / directions[:, 2]
        s = origins[:, 0] + travel * directions[:, 0]
        t = origins[:, 1] + travel * directions[:, 1]
    s, t = (np.where(directions[:, 2] > 0, axis, np.inf) for axis in (s, t))
    total, weights = np.zeros((len(film), 3)), np.zeros(len(film))
    closed = filter_width_m == 0
    nearest = _nearest(array, s, t) if closed else np.zeros(0)
    for j, row in enumerate(array.rows_m):
        for i, column in enumerate(array.columns_m):
            if closed:
                weight = np.equal(nearest, j * len(array.columns_m) + i).astype(np.float64)
            else:
                distance = np.hypot(s - column, t - row)
                weight = np.maximum(1.0 - distance / filter_width_m, 0.0)
            x, y, ahead = aim(origins, directions, q, column, row)
            values, inside = tile_lookup(tiles, array, np.full(len(x), i), np.full(len(x), j), x, y)
            weight = np.where(ahead & inside, weight, 0.0)
            total += weight[:, None] * values
            weights += weight
    safe = np.where(weights > 0, weights, 1.0)
    covered = (weights > 0).astype(np.float64)
    return combine(total / safe[:, None], covered, camera.size)


def _nearest(array: CameraArray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Number of the data camera nearest to (s, t); -1 where the ray is outside the array."""
    low_x, high_x, low_y, high_y = array.bounds()
    columns, rows = np.asarray(array.columns_m), np.asarray(array.rows_m)
    finite = np.isfinite(s) & np.isfinite(t)
    inside = finite & _within(s, low_x, high_x, columns) & _within(t, low_y, high_y, rows)
    i = np.abs(np.where(finite, s, 0)[:, None] - columns).argmin(1)
    j = np.abs(np.where(finite, t, 0)[:, None] - rows).argmin(1)
    return np.where(inside, j * len(columns) + i, -1)


def _within(value: np.ndarray, low: float, high: float, axis: np.ndarray) -> np.ndarray:
    if len(axis) == 1:  # one camera has no extent that a ray could leave
        return np.ones(np.shape(value), bool)
    slack = EDGE * (high - low)
    return (value >= low - slack) & (value <= high + slack)


def quadrilinear(
    image: np.ndarray,
    array: CameraArray,
    origins: np.ndarray,
    directions: np.ndarray,
    q: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (R, 3) along rays, and which of them the array knows.

    ``origins`` and ``directions`` are (R, 3), ``q`` (R,) their inverse parameter at the focal
    surface: the four data cameras around the ray, each aimed at the same surface point.
    """
    tiles = array.tiles(image)
    columns, rows = np.asarray(array.columns_m), np.asarray(array.rows_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        travel = -origins[:, 2] / directions[:, 2]
        s = origins[:, 0] + travel * directions[:, 0]
        t = origins[:, 1] + travel * directions[:, 1]
    low_x, high_x, low_y, high_y = array.bounds()
    known = directions[:, 2] > 0
    s, t = np.where(known, s, 0.0), np.where(known, t, 0.0)
    known &= _within(s, low_x, high_x, columns) & _within(t, low_y, high_y, rows)
    i, fx = _interval(columns, s)
    j, fy = _interval(rows, t)
    total, weights = np.zeros((len(s), 3)), np.zeros(len(s))
    for di in (0, 1):
        for dj in (0, 1):
            ci, cj = np.minimum(i + di, len(columns) - 1), np.minimum(j + dj, len(rows) - 1)
            weight = (fx if di else 1 - fx) * (fy if dj else 1 - fy)
            x, y, ahead = aim(origins, directions, q, columns[ci], rows[cj])
            values, inside = tile_lookup(tiles, array, ci, cj, x, y)
            weight = np.where(ahead & inside, weight, 0.0)
            total += weight[:, None] * values
            weights += weight
    known &= weights > 0
    return total / np.where(weights > 0, weights, 1.0)[:, None], known


def _interval(axis: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if len(axis) == 1:
        return np.zeros(len(value), np.int64), np.zeros(len(value))
    index = np.clip(np.searchsorted(axis, value, side="right") - 1, 0, len(axis) - 2)
    share = (value - axis[index]) / (axis[index + 1] - axis[index])
    return index, np.clip(share, 0.0, 1.0)


def thin_lens(
    image: np.ndarray,
    array: CameraArray,
    camera: VirtualCamera,
    surface: FocalSurface,
    sampler: int,
    table: np.ndarray | None,
    count: int,
    seed: int = 0,
) -> Synthesis:
    """Average over film and lens samples; samples that the array does not know are skipped."""
    width, height = camera.size
    pixels = np.arange(width * height)
    samples = sampling.pixel_samples(sampler, table, pixels, count, seed)
    total, known_count = np.zeros((len(pixels), 3)), np.zeros(len(pixels))
    corner = np.stack([pixels % width, pixels // width], -1)
    for k in range(count):
        film = corner + samples[:, k, :2]
        directions = camera.directions(film[:, 0], film[:, 1])
        centre = np.broadcast_to(camera.position_m, directions.shape)
        q = inverse_depth(surface, camera, centre, directions, film)
        lens = np.stack(sampling.concentric_disk(samples[:, k, 2], samples[:, k, 3]), -1)
        shift = camera.lens_radius_m * lens @ camera.rotation[:, :2].T
        # From the lens point to the focal point, at the same parameter 1 / q as the centre ray.
        origins = centre + shift
        towards = directions - shift * q[:, None]
        values, known = quadrilinear(image, array, origins, towards, q)
        total += np.where(known[:, None], values, 0.0)
        known_count += known
    mean = total / np.maximum(known_count, 1)[:, None]
    return combine(mean, known_count / count, camera.size)


def rays(
    image: np.ndarray,
    array: CameraArray,
    camera: VirtualCamera,
    surface: FocalSurface,
    origins: np.ndarray,
    directions: np.ndarray,
    weights: np.ndarray,
    film: np.ndarray,
) -> Synthesis:
    """Weighted average of given rays, (P, S, 3) in array space, weights (P, S), film (P, S, 2).

    A ray of weight 0 (stopped inside a lens) counts as black; one the array does not know is
    skipped.
    """
    total, count = np.zeros((len(weights), 3)), np.zeros(len(weights))
    for k in range(weights.shape[1]):
        o, d = origins[:, k], directions[:, k]
        q = inverse_depth(surface, camera, o, d, film[:, k])
        values, known = quadrilinear(image, array, o, d, q)
        stopped = weights[:, k] == 0
        total += np.where((known & ~stopped)[:, None], values * weights[:, k, None], 0.0)
        count += known | stopped
    mean = total / np.maximum(count, 1)[:, None]
    return combine(mean, count / weights.shape[1], camera.size)

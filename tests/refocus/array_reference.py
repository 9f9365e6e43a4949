"""Slow float64 references of the synthesis kernels, one obvious loop each, with the same arguments.

Rays are origins and directions (R, 3), ``q`` (R,) their inverse parameter at the focal surface;
``image`` is the picture of a camera array.
"""

import numpy as np
from scipy.ndimage import map_coordinates

from lfcore.refocus.array import sampling
from lfcore.refocus.array.device_field import Synthesis
from lfcore.refocus.array.focal_surface import inverse_depth

# Rays on the very edge of grid or field belong to it, whatever the rounding.
EDGE = 1e-5


def seen(tiles, array, i, j, origins, directions, q):
    """Bilinear radiance (R, 3) of the points ``O + D / q`` from cameras (column i, row j), and who
    sees them; multiplied through by q nothing is infinite."""
    middle, inside = [], origins[:, 2] * q + directions[:, 2] > 0
    safe = np.where(inside, origins[:, 2] * q + directions[:, 2], 1.0)
    slack = EDGE * array.tile[0]
    for axis, at in enumerate((np.asarray(array.columns_m)[i], np.asarray(array.rows_m)[j])):
        tangent = (directions[:, axis] + (origins[:, axis] - at) * q) / safe
        off = np.nan_to_num((tangent + at * array.delta) / array.pixel_pitch)
        inside = inside & (np.abs(off) <= array.tile[axis] / 2 + slack)
        middle.append(off + (array.tile[axis] - 1) / 2)
    places = np.stack([j, i, *middle[::-1]])
    values = [
        map_coordinates(tiles[..., channel].astype(np.float64), places, order=1, mode="nearest")
        for channel in range(3)
    ]
    return np.stack(values, -1), inside


def _crossing(origins, directions):
    """Where rays cross the camera plane, (R,) each; infinite for those that run away from it."""
    ahead = directions[:, 2] > 0
    travel = -origins[:, 2] / np.where(ahead, directions[:, 2], 1.0)
    s, t = (origins[:, axis] + travel * directions[:, axis] for axis in (0, 1))
    return np.where(ahead, s, np.inf), np.where(ahead, t, np.inf)


def centre_rays(camera, film):
    """Through the lens centre, of unit extent along the axis, of places (..., 2) on the film."""
    x, y = camera.film_tangents(film[..., 0], film[..., 1])
    return np.stack([x, y, np.ones_like(x)], -1) @ camera.rotation.T


def isaksen(image, array, camera, surface, filter_width_m):
    """Cone-filtered sum over the data cameras near the central ray (Isaksen 2000, figure 4)."""
    tiles = array.tiles(image)
    u, v = np.meshgrid(*(np.arange(count) + 0.5 for count in camera.size))
    film = np.stack([u.ravel(), v.ravel()], -1)
    directions = centre_rays(camera, film)
    origins = np.broadcast_to(camera.position_m, directions.shape)
    q = inverse_depth(surface, camera, origins, directions, film)
    s, t = _crossing(origins, directions)
    total, weights = np.zeros((len(film), 3)), np.zeros(len(film))
    for j, row in enumerate(array.rows_m):
        for i, column in enumerate(array.columns_m):
            which = np.full(len(film), i), np.full(len(film), j)
            values, inside = seen(tiles, array, *which, origins, directions, q)
            cone = np.maximum(1.0 - np.hypot(s - column, t - row) / filter_width_m, 0.0)
            weight = np.where(inside, cone, 0.0)
            total += weight[:, None] * values
            weights += weight
    mean = total / np.where(weights > 0, weights, 1.0)[:, None]
    return _pictures(mean, (weights > 0).astype(np.float64), camera)


def _within(array, s, t):
    """(R,) bool: crossings within the array; one camera has no extent that a ray could leave."""
    low_x, high_x, low_y, high_y = array.bounds()
    inside = np.isfinite(s)
    sides = zip((s, t), (low_x, low_y), (high_x, high_y), array.cameras, strict=True)
    for place, low, high, count in sides:
        slack = EDGE * (high - low)
        inside = inside & ((count == 1) | ((place >= low - slack) & (place <= high + slack)))
    return inside


def quadrilinear(image, array, origins, directions, q):
    """Radiance (R, 3) along rays, and which of them the array knows: by the four data cameras
    around the ray, each aimed at the same surface point."""
    tiles, (columns, rows) = array.tiles(image), (array.columns_m, array.rows_m)
    s, t = _crossing(origins, directions)
    known = _within(array, s, t)
    i, fx = _interval(np.asarray(columns), np.where(known, s, 0.0))
    j, fy = _interval(np.asarray(rows), np.where(known, t, 0.0))
    total, weights = np.zeros((len(s), 3)), np.zeros(len(s))
    for di, dj in np.ndindex(2, 2):
        which = np.minimum(i + di, len(columns) - 1), np.minimum(j + dj, len(rows) - 1)
        values, inside = seen(tiles, array, *which, origins, directions, q)
        weight = np.where(inside, (fx if di else 1 - fx) * (fy if dj else 1 - fy), 0.0)
        total += weight[:, None] * values
        weights += weight
    return total / np.where(weights > 0, weights, 1.0)[:, None], known & (weights > 0)


def _interval(axis, value):
    place = np.interp(value, axis, np.arange(len(axis)))
    index = np.minimum(place.astype(np.int64), max(len(axis) - 2, 0))
    return index, place - index


def thin_lens(image, array, camera, surface, sampler, table, count, seed=0):
    """Average over film and lens samples; samples that the array does not know are skipped."""
    width, height = camera.size
    pixels = np.arange(width * height)
    samples = sampling.pixel_samples(sampler, table, pixels, count, seed)
    film = np.stack([pixels % width, pixels // width], -1)[:, None] + samples[..., :2]
    directions = centre_rays(camera, film)
    centre = np.broadcast_to(camera.position_m, directions.shape)
    q = inverse_depth(surface, camera, centre, directions, film)
    lens = np.stack(sampling.concentric_disk(samples[..., 2], samples[..., 3]), -1)
    shift = camera.lens_radius_m * lens @ camera.rotation[:, :2].T
    # From the lens point to the focal point, at the same parameter 1 / q as the centre ray.
    towards = directions - shift * q[..., None]
    return _average(image, array, camera, centre + shift, towards, q, np.ones(q.shape))


def rays(image, array, camera, surface, origins, directions, weights, film):
    """Weighted average of given rays, (P, S, 3) in array space, weights (P, S), film (P, S, 2)."""
    q = inverse_depth(surface, camera, origins, directions, film)
    return _average(image, array, camera, origins, directions, q, weights)


def _average(image, array, camera, origins, directions, q, weights):
    """Of rays (P, S, 3).  A ray of weight 0 (stopped inside a lens) counts as black; one that the
    array does not know is skipped."""
    total, count = np.zeros((len(weights), 3)), np.zeros(len(weights))
    for k in range(weights.shape[1]):
        values, known = quadrilinear(image, array, origins[:, k], directions[:, k], q[:, k])
        stopped = weights[:, k] == 0
        total += np.where((known & ~stopped)[:, None], values * weights[:, k, None], 0.0)
        count += known | stopped
    mean = total / np.maximum(count, 1)[:, None]
    return _pictures(mean, count / weights.shape[1], camera)


def _pictures(values, coverage, camera):
    """Of radiance (P, 3) and coverage (P,)."""
    values = np.where(coverage[:, None] > 0, values, 0.0)
    return Synthesis.of(np.concatenate([values, coverage[:, None]], 1), camera.size)

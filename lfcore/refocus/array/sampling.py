"""Samples of film and lens for one pixel: the same numbers in numpy and in the kernels.

A sample is four numbers in [0, 1): film x, film y, lens a, lens b.  ``independent`` is plain Monte
Carlo.  ``stratified`` has one jittered sample per stratum of the lens and of the film, paired by a
different permutation in each pixel.  ``halton`` shifts one Halton set by a random offset per pixel
(Cranley and Patterson 1976).  ``quadrature`` is a fixed midpoint rule.
"""

import math

import numpy as np

QUADRATURE, HALTON, STRATIFIED, INDEPENDENT = 0, 1, 2, 3
SAMPLERS = {"halton": HALTON, "stratified": STRATIFIED, "independent": INDEPENDENT}


def hash32(value: np.ndarray) -> np.ndarray:
    """Mix 32 bits bijectively by products and xor-shifts, as lookup.cl does."""
    x = np.asarray(value, np.uint32).copy()
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        x ^= x >> np.uint32(shift)
        x *= np.uint32(factor)
    return x ^ (x >> np.uint32(16))


def uniform(pixel: np.ndarray, index: np.ndarray, dimension: int, seed: int) -> np.ndarray:
    """Pseudo-random numbers in [0, 1) with 24 bits, by pixel, sample and dimension."""
    key = hash32(np.asarray(pixel, np.uint32) + hash32(np.asarray([seed], np.uint32)))
    key = hash32(key + np.asarray(index, np.uint32) * np.uint32(0x9E3779B9))
    key = hash32(key + np.uint32(dimension))
    return (key >> np.uint32(8)) * 2.0**-24


def strata(count: int) -> tuple[int, int]:
    """(columns, rows) of the grid of ``count`` cells that is nearest to a square."""
    rows = next(n for n in range(math.isqrt(count), 0, -1) if count % n == 0)
    return count // rows, rows


PERMUTATION_ROUNDS = 4
"""The rounds of a permutation; the kernels have the same."""


def permute(index: np.ndarray, count: int, key: np.ndarray) -> np.ndarray:
    """The film stratum of sample ``index``, by a permutation of 0 ... count - 1 per key; int64.

    A bijection of the next power of two (odd multiples, sums, xor-shifts) is repeated until the
    value is below ``count``.  A fixed stride would couple the film's columns to the lens's, and
    more samples would then not reduce the error.
    """
    bits = max(1, (count - 1).bit_length())
    mask, shift = np.uint32((1 << bits) - 1), np.uint32((bits + 1) // 2)
    x, key = (np.array(a, np.uint32) for a in np.broadcast_arrays(index, key))
    outside = np.ones(x.shape, bool)
    while outside.any():
        walked, mix = x.copy(), key
        for _ in range(PERMUTATION_ROUNDS):
            walked = (walked * (mix | np.uint32(1)) + (mix >> np.uint32(8))) & mask
            walked ^= walked >> shift
            mix = hash32(mix)
        x = np.where(outside, walked, x)
        outside = x >= count
    return x.astype(np.int64)


def halton_table(count: int) -> np.ndarray:
    """(count, 4) float32: the Halton set in bases 5, 7 (film) and 2, 3 (lens)."""
    from scipy.stats import qmc  # only needed here, slow to import

    points = qmc.Halton(d=4, scramble=False).random(count)
    return np.ascontiguousarray(points[:, [2, 3, 0, 1]], np.float32)


def midpoint_table(film: int, lens: int) -> np.ndarray:
    """All pairs of a film midpoint and a lens midpoint, (film^2 lens^2, 4) float32."""
    f, a = ((np.arange(n) + 0.5) / n for n in (film, lens))
    grid = np.meshgrid(f, f, a, a, indexing="ij")
    return np.stack([axis.ravel() for axis in grid], -1).astype(np.float32)


def pixel_samples(
    sampler: int, table: np.ndarray | None, pixels: np.ndarray, count: int, seed: int
) -> np.ndarray:
    """The samples of pixels (P,), which are numbered row by row: (P, count, 4) float64."""
    pixels = np.asarray(pixels, np.uint32)[:, None]
    index = np.arange(count, dtype=np.uint32)[None, :]
    none = np.zeros(1, np.uint32)
    if sampler == QUADRATURE and table is not None:
        return np.broadcast_to(table.astype(np.float64), (len(pixels), count, 4))
    if sampler == HALTON and table is not None:
        shifts = [uniform(pixels, none, d, seed) for d in range(4)]
        shifted = table[None].astype(np.float64) + np.concatenate(shifts, 1)[:, None, :]
        return shifted % 1.0
    values = np.stack([uniform(pixels, index, d, seed) for d in range(4)], -1)
    if sampler == INDEPENDENT:
        return values
    columns, rows = strata(count)
    lens = np.broadcast_to(index.astype(np.int64), values.shape[:2])
    key = (uniform(pixels, none, 4, seed) * 2.0**24).astype(np.uint32)
    film = permute(index, count, key)
    for first, cell in ((0, film), (2, lens)):
        values[..., first] = (cell % columns + values[..., first]) / columns
        values[..., first + 1] = (cell // columns + values[..., first + 1]) / rows
    return values


def concentric_disk(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map the unit square to the unit disk, preserving areas (Shirley and Chiu 1997); float64."""
    x, y = 2.0 * np.asarray(a) - 1.0, 2.0 * np.asarray(b) - 1.0
    wide = np.abs(x) > np.abs(y)
    radius = np.where(wide, x, y)
    safe = np.where(radius == 0, 1.0, radius)
    angle = np.where(wide, (math.pi / 4) * y / safe, math.pi / 2 - (math.pi / 4) * x / safe)
    return radius * np.cos(angle), radius * np.sin(angle)

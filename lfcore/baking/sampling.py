"""Directions of gather rays: a low-discrepancy sequence, mapped to a cosine-weighted hemisphere.

The kernel ``aim`` does the same on the device; this is its reference.
"""

import math
from functools import cache

import numpy as np

from lfcore.baking.mesh_colours import GOLDEN, Points, shuffled

TURNS = 4096
"""Azimuths of the table of cosines and sines."""
R2 = tuple(round(2**32 / 1.32471795724474602596**power) for power in (1, 2))
"""The steps of the additive recurrence R2, of 2^32; source: M. Roberts, "The unreasonable
effectiveness of quasirandom sequences", 2018."""


@cache
def circle() -> np.ndarray:
    """(2, TURNS) float32 cosines and sines, which every processor rounds alike."""
    turns = np.arange(TURNS) * (2 * math.pi / TURNS)
    return np.stack([np.cos(turns), np.sin(turns)]).astype(np.float32)


def samples(seeds: np.ndarray, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return two arrays (P, count) of float64 in ]0, 1[: ``count`` members of the sequence, from
    number ``first`` on, shifted by each point's seed (P,)."""
    number = np.arange(first, first + count, dtype=np.uint64)
    shift = shifts(seeds)
    a, b = (
        (number * np.uint64(step) + shift[:, k, None]) & np.uint64(0xFFFFFFFF)
        for k, step in enumerate(R2)
    )
    return (a + 0.5) * 2.0**-32, (b + 0.5) * 2.0**-32


def shifts(seeds: np.ndarray) -> np.ndarray:
    """Return the shifts (P, 2), uint32 of 2^32, of the two coordinates of each seed's sequence."""
    mixed = shuffled((seeds.astype(np.uint64) + np.uint64(1)) * GOLDEN)
    return np.stack([mixed, mixed >> np.uint64(32)], -1).astype(np.uint32)


def directions(points: Points, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return (P, n, 3) float32 unit directions of samples (P, n), with a density proportional to
    the cosine to the normal."""
    share = a.astype(np.float32)
    cosine, sine = circle()[:, (b * TURNS).astype(np.int64)]
    radius, up = np.sqrt(share), np.sqrt(1 - share)
    n = points.normals[:, None]
    # The frame of T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    sign = np.copysign(np.float32(1), n[..., 2])
    p = -1 / (sign + n[..., 2])
    q = n[..., 0] * n[..., 1] * p
    x, y = radius * cosine, radius * sine
    return np.stack(
        [
            x * (1 + sign * n[..., 0] ** 2 * p) + y * q + up * n[..., 0],
            x * (sign * q) + y * (sign + n[..., 1] ** 2 * p) + up * n[..., 1],
            -x * sign * n[..., 0] - y * n[..., 1] + up * n[..., 2],
        ],
        -1,
    )

"""Blocks of a slab's rays at once: the arithmetic that the lone rays of other cases do not use.

A triangle is set up once for 16 x 16 rays, relative to their middle ray; the errors must be those
of the triangle all the same, and not of the block.  Errors as in ``extents``.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.judge import choice_and_depth
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.subject import CAMERA, Subject
from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle.intersect import closest_hits

PIXELS = 24


def triangle_sizes(subject: Subject) -> Iterator[Row]:
    """Triangles of ever smaller size at 1 to 3 m, each met by rays of some pixel; N = 16."""
    for size in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        yield from _rows(subject, "blocks: triangle size", "m", size, Slab(CAMERA, 16, 64), size)


def lens_samples(subject: Subject) -> Iterator[Row]:
    """Triangles of 1 cm, from one lens sample (in a corner of its block) to many."""
    for views in (1, 2, 5, 16, 40):
        yield from _rows(subject, "blocks: lens samples", "N", views, Slab(CAMERA, views, 64), 1e-2)


def _rows(subject, case, parameter, value, slab, size) -> Iterator[Row]:
    rng = np.random.default_rng(21)
    pixels = rng.integers(0, slab.pixels, (PIXELS, 2))
    pixels = np.unique(pixels, axis=0)
    rays = [part.reshape(-1, 3) for part in macropixels(slab, pixels).rays()]
    aimed = rng.integers(0, len(rays[0]), 600)
    centres = rays[0][aimed] + rng.uniform(1, 3, (600, 1)) * rays[1][aimed]
    mesh = np.float32(centres[:, None] + rng.normal(0, size, (600, 3, 3)))
    hits = closest_hits(mesh, *rays)
    plain = naive.moeller_trumbore(mesh, *rays)
    found = functools.partial(subject.slab_hits, mesh, slab, pixels)
    yield from choice_and_depth(case, parameter, value, hits, plain, found)


CASES = (triangle_sizes, lens_samples)

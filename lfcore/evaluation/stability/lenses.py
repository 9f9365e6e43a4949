"""Cases 17, 18 and 19: focus to the focal length and to infinity, apertures, refocusing."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.judge import row
from lfcore.evaluation.stability.rows import NO_ANSWER, Row
from lfcore.evaluation.stability.subject import CAMERA, Subject
from lfcore.optics.bundles import macropixels
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.crossings import ULP


def near_the_focal_length(subject: Subject) -> Iterator[Row]:
    """Relative error of the image distance, in 2^-24; naive: 1 / (1/f - 1/u).  Bound 4."""
    focal = 0.05
    for excess in (*10.0 ** -np.arange(0, 13, 2), 0.0, -1e-4):
        distance = focal * (1 + excess)
        exact = None
        if distance != focal:
            exact = Fraction(focal) * Fraction(distance) / (Fraction(distance) - Fraction(focal))

        def error(found, exact=exact):
            if exact is None:  # the picture of the focal point is at infinity
                return 0.0 if math.isinf(found) else NO_ANSWER
            if not math.isfinite(found):
                return NO_ANSWER
            return abs(float((Fraction(float(found)) - exact) / exact)) / ULP

        yield row(
            "near the focal length",
            "u / f - 1",
            excess,
            4,
            lambda distance=distance, error=error: error(naive.image_distance(focal, distance)),
            lambda distance=distance, error=error: error(
                Camera(focal, 0.036, 2.0, distance).image_distance_m
            ),
            limit="focus" if distance <= focal else "",
            condition=math.inf if distance == focal else distance / abs(distance - focal),
        )


def _directions(slab: Slab) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Lens points (R, 2), tangents (R, 2), and directions (R, 3): ours and exact float64."""
    u = np.array([0, slab.pixels // 3, slab.pixels - 1])
    pixels = np.stack([u, u[::-1]], 1)
    ours = macropixels(slab, pixels).rays()[1].reshape(-1, 3)
    s, x = slab.lens_positions(), slab.pixel_tangents()
    grid = np.broadcast_arrays(
        s[None, None, :], s[None, :, None], x[u, None, None], x[u[::-1], None, None]
    )
    s, t, x, y = (part.ravel() for part in grid)
    delta = slab.camera.delta
    exact = np.stack([x - s * delta, y - t * delta, np.ones_like(s)], 1)
    return np.stack([s, t], 1), np.stack([x, y], 1), ours, exact


def _angle(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest angle between directions, in 2^-24."""
    found = np.asarray(found, float)
    unit = [a / np.linalg.norm(a, axis=1, keepdims=True) for a in (found, exact)]
    angle = np.linalg.norm(np.cross(*unit), axis=1) / ULP
    return float(np.where(np.isfinite(angle), angle, NO_ANSWER).max())


def focus_to_infinity(subject: Subject) -> Iterator[Row]:
    """Angle of the rays' directions in 2^-24; naive: difference of points, normalised."""
    for focus in (0.0501, 0.1, 1.0, 1e3, 1e8, 1e18, 1e20, 1e38, math.inf):
        slab = Slab(dataclasses.replace(CAMERA, focus_distance_m=focus), 16, 64)
        lens, tangents, ours, exact = _directions(slab)
        yield row(
            "focus to infinity",
            "focus m",
            focus,
            4,
            lambda lens=lens, tangents=tangents, focus=focus, exact=exact: _angle(
                naive.lens_directions(lens, tangents, focus), exact
            ),
            lambda ours=ours, exact=exact: _angle(ours, exact),
        )


def apertures(subject: Subject) -> Iterator[Row]:
    """The same from a pinhole to a lens of 50 m: the camera's f-number."""
    for number in (1e-3, 1e-1, 1.0, 1e2, 1e4, 1e8, 1e30):
        slab = Slab(dataclasses.replace(CAMERA, f_number=number), 16, 64)
        lens, tangents, ours, exact = _directions(slab)
        yield row(
            "apertures",
            "f-number",
            number,
            4,
            lambda lens=lens, tangents=tangents, exact=exact: _angle(
                naive.lens_directions(lens, tangents, 2.0), exact
            ),
            lambda ours=ours, exact=exact: _angle(ours, exact),
        )


def refocus_shifts(subject: Subject) -> Iterator[Row]:
    """Shift of the outermost of 512 lens columns on 16384 pixels, in pixels; bound 1e-3.

    Naive: float32, ``1 - 1/alpha`` with alpha the ratio of distances, added up column by column.
    """
    slab = Slab(CAMERA, 512, 16384)
    for change in (10.0, 1.0, 1e-1, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-3, -0.5, -0.9, math.inf):
        focus = CAMERA.focus_distance_m * (1 + change)
        inverse = Fraction(0) if math.isinf(focus) else 1 / Fraction(focus)
        difference = inverse - 1 / Fraction(CAMERA.focus_distance_m)
        exact = [
            float(Fraction(s) * difference / Fraction(slab.pixel_pitch))
            for s in slab.lens_positions().tolist()
        ]

        def plain(focus=focus, exact=exact):
            alpha = np.float32(focus) / np.float32(CAMERA.focus_distance_m)
            factor = np.float32(CAMERA.delta) * (np.float32(1) / alpha - np.float32(1))
            step = np.float32(slab.lens_pitch_m / slab.pixel_pitch) * factor
            x = np.cumsum(np.full(512, step, np.float32), dtype=np.float32)
            return np.abs(x - step * np.float32(256.5) - exact).max()

        def ours(focus=focus, exact=exact):
            return np.abs(SensorPlane(focus, 2.0).shifts(slab) - exact).max()

        yield row("refocus shifts", "d' / d - 1", change, 1e-3, plain, ours)


def beyond_the_slab(subject: Subject) -> Iterator[Row]:
    """Apertures up to and wider than the recorded lens, as shares of it; 64 x 64 lens samples.

    Error: samples let through too many or too few, by a count in whole numbers of all samples
    of that spacing, recorded or not.  Naive: a mask in float32, which knows no limit and
    pretends that what was not recorded is dark.
    """
    slab = Slab(CAMERA, 64, 16)
    odd = 2 * np.arange(64) - 63  # lens positions in units of R / 64
    for share in (0.0, 0.25, 0.5, 1.0, 1.0001, 2.0, 1e3):
        # A pinhole is the view in the middle, of which an even number of samples has four.
        exact = _samples_within(64 * Fraction(share)) or 4
        number = math.inf if share == 0 else CAMERA.f_number / share

        def plain(share=share, exact=exact):
            s = (odd / np.float32(64)).astype(np.float32)
            inside = (s[:, None] ** 2 + s[None, :] ** 2 <= np.float32(share) ** 2).sum()
            return abs(int(inside) - exact)

        def ours(number=number, exact=exact):
            plane = SensorPlane(CAMERA.focus_distance_m, number)
            plane.check(slab)
            return abs(int(plane.mask(slab).sum()) - exact)

        limit = "apertures" if share > 1 else ""
        yield row("beyond the slab", "aperture / lens", share, 0, plain, ours, limit=limit)


def _samples_within(radius: Fraction) -> int:
    """Points with two odd coordinates in a disk about 0, counted column by column."""
    square = math.floor(radius * radius)
    columns = range(1, math.isqrt(square) + 1, 2)
    return 4 * sum((math.isqrt(square - x * x) + 1) // 2 for x in columns)


CASES = (beyond_the_slab, near_the_focal_length, focus_to_infinity, apertures, refocus_shifts)

"""Cases 17 to 20: focus to the focal length and to infinity, apertures, refocusing, sums."""

import math
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction

import numpy as np

from lfcore.evaluation.stability import naive
from lfcore.evaluation.stability.measurement import NO_ANSWER, Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.tested_tracer import CAMERA, TracerUnderTest, bare_scene
from lfcore.optics.bundles import macropixels
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.crossings import ULP

COLOUR = (0.7, 0.1, 1.0)


@sweep("17", "u / f - 1", (*10.0 ** -np.arange(0, 13, 2), 0.0, -1e-4))
def near_the_focal_length(tracer: TracerUnderTest, excess: float) -> Measurement:
    """Relative error of the image distance, in 2^-24; naive: 1 / (1/f - 1/u).  Bound 4."""
    focal = 0.05
    distance = focal * (1 + excess)

    def error(found: float) -> float:
        if distance == focal:  # the picture of the focal point is at infinity
            return 0.0 if math.isinf(found) else NO_ANSWER
        if not math.isfinite(found):
            return NO_ANSWER
        exact = Fraction(focal) * Fraction(distance) / (Fraction(distance) - Fraction(focal))
        return abs(float((Fraction(float(found)) - exact) / exact)) / ULP

    return measured(
        "near the focal length",
        Bound(4, "2^-24 of the distance", "three roundings, none cancels"),
        lambda: error(naive.image_distance(focal, distance)),
        lambda: error(Camera(focal, 0.036, 2.0, distance).image_distance_m),
        limit="focus" if distance <= focal else "",
        condition=math.inf if distance == focal else distance / abs(distance - focal),
    )


@sweep("18", "focus m", (0.0501, 0.1, 1.0, 1e3, 1e8, 1e18, 1e20, 1e38, math.inf))
def focus_to_infinity(tracer: TracerUnderTest, focus: float) -> Measurement:
    """Angle of the rays' directions in 2^-24; naive: difference of points, normalised."""
    return _directions("focus to infinity", replace(CAMERA, focus_m=focus))


@sweep("18", "f-number", (1e-3, 1e-1, 1.0, 1e2, 1e4, 1e8, 1e30))
def apertures(tracer: TracerUnderTest, number: float) -> Measurement:
    """The same from a pinhole to a lens of 50 m: the camera's f-number."""
    return _directions("apertures", replace(CAMERA, f_number=number))


def _directions(case: str, camera: Camera) -> Measurement:
    """The largest angle to the directions from lens points through tangents, in float64."""
    slab = Slab(camera, 16, 64)
    u = np.array([0, slab.pixels // 3, slab.pixels - 1])
    s, x = slab.lens_positions(), slab.pixel_tangents()
    grid = np.broadcast_arrays(
        s[None, None, :], s[None, :, None], x[u, None, None], x[u[::-1], None, None]
    )
    s, t, x, y = (part.ravel() for part in grid)
    exact = np.stack([x - s * camera.delta, y - t * camera.delta, np.ones_like(s)], 1)
    lens, tangents = np.stack([s, t], 1), np.stack([x, y], 1)
    pixels, focus = np.stack([u, u[::-1]], 1), camera.focus_m
    return measured(
        case,
        Bound(4, "2^-24 rad", "three roundings of a direction"),
        lambda: _angle(naive.lens_directions(lens, tangents, focus), exact),
        lambda: _angle(macropixels(slab, pixels).rays()[1].reshape(-1, 3), exact),
    )


def _angle(found: np.ndarray, exact: np.ndarray) -> float:
    """Largest angle between directions, in 2^-24."""
    found = np.asarray(found, float)
    unit = [a / np.linalg.norm(a, axis=1, keepdims=True) for a in (found, exact)]
    angle = np.linalg.norm(np.cross(*unit), axis=1) / ULP
    return float(np.where(np.isfinite(angle), angle, NO_ANSWER).max())


CHANGES = (10.0, 1.0, 1e-1, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-3, -0.5, -0.9, math.inf)


@sweep("19", "d' / d - 1", CHANGES)
def refocus_shifts(tracer: TracerUnderTest, change: float) -> Measurement:
    """Shift of the outermost of 512 lens columns on 16384 pixels, in pixels; bound 1e-3.

    Naive: float32, ``1 - 1/alpha`` with alpha the ratio of distances, added up column by column.
    """
    slab = Slab(CAMERA, 512, 16384)
    focus = CAMERA.focus_m * (1 + change)
    inverse = Fraction(0) if math.isinf(focus) else 1 / Fraction(focus)
    difference = inverse - 1 / Fraction(CAMERA.focus_m)
    pitch = Fraction(slab.pixel_pitch)
    exact = [float(Fraction(s) * difference / pitch) for s in slab.lens_positions().tolist()]

    def by_naive() -> float:
        alpha = np.float32(focus) / np.float32(CAMERA.focus_m)
        factor = np.float32(CAMERA.delta) * (np.float32(1) / alpha - np.float32(1))
        step = np.float32(slab.lens_pitch_m / slab.pixel_pitch) * factor
        x = np.cumsum(np.full(512, step, np.float32), dtype=np.float32)
        return np.abs(x - step * np.float32(256.5) - exact).max()

    def ours() -> float:
        return np.abs(SensorPlane(focus, 2.0).shifts(slab) - exact).max()

    bound = Bound(1e-3, "pixels", "a thousandth of a pixel is invisible")
    return measured("refocus shifts", bound, by_naive, ours)


@sweep("20", "N", (1, 2, 16, 64, 256, 512))
def accumulation(tracer: TracerUnderTest, views: int) -> Iterator[Measurement]:
    """The mean of up to 512 x 512 lens samples of one colour must be that colour.

    In focus, and refocused so that rays of many pixels are mixed.  Error: difference in steps of
    an 8-bit code; bound: 1/1024 of a step.  Naive: a float32 accumulator.
    """
    slab, scene = Slab(CAMERA, views, 2), bare_scene(np.zeros((0, 3, 3)), background=COLOUR)

    def by_naive() -> float:
        repeated = np.full((views**2, 3), COLOUR, np.float32)
        means = np.cumsum(repeated, axis=0, dtype=np.float32)[-1] / np.float32(views**2)
        return 255 * np.abs(means.astype(float) - COLOUR).max()

    def ours(focus: float) -> float:
        picture = tracer.picture(scene, slab, SensorPlane(focus, CAMERA.f_number, "square"))
        # Pixels of the small picture that no ray reaches are black by definition.
        reached = picture.any(-1)
        assert reached.any()
        return 255 * np.abs(picture[reached] - np.array(COLOUR)).max()

    in_focus = CAMERA.focus_m
    bound = Bound(1 / 1024, "8-bit codes", "a thousandth of a code; sums are whole numbers")
    yield measured("accumulation", bound, by_naive, lambda: ours(in_focus))
    yield measured("accumulation refocused", bound, by_naive, lambda: ours(0.5))

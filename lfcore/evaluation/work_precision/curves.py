"""The curves of a scene's work-precision diagrams.

``quadrature``: windows of a picture at its own focus, by kind and number of rays.
``tracing``: one refocused picture, formed while its rays are traced.
``recorded``: the same from light fields in memory.
``storage``: the same from video, by codec, preset and CRF.

All of these are held against the true picture, averaged over lens and pixel.
``arithmetic``: colours of single rays by the float32 kernels against the float64 oracle.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

import numpy as np

from lfcore.evaluation.work_precision.measured_point import COLUMNS, measured_point
from lfcore.evaluation.work_precision.peers import peers
from lfcore.evaluation.work_precision.quadrature import quadrature
from lfcore.evaluation.work_precision.recorded import recorded_methods
from lfcore.evaluation.work_precision.refocused import refocused_picture, tracing
from lfcore.evaluation.work_precision.stored import storage
from lfcore.evaluation.work_precision.study import Study
from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle import slab as oracle
from lfcore.progress import Progress, silent
from lfcore.scene.model import Scene
from lfcore.timing import clocked
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.tracer import Tracer


def scene_rows(
    tracer: Tracer,
    bvh: Bvh,
    study: Study,
    *,
    progress: Progress = silent,
) -> list[dict]:
    """All rows of a scene; ``progress`` counts them in steps of one diagram."""
    # Textures at full size: which mip level a block takes depends on the block, and would show
    # as an error of the lens integral.
    plain = Tracer(tracer.scene, bvh, tracer.device, mipmaps=False)
    truth = functools.cache(lambda: refocused_picture(tracer, study.pixels, study.truth))
    diagrams = [
        *(lambda stops=stops: quadrature(plain, study, stops) for stops in study.f_stops),
        lambda: tracing(tracer, study, truth()),
        lambda: recorded_methods(tracer, study, truth()),
        lambda: peers(tracer.scene, study),
        lambda: storage(tracer, study),
        lambda: arithmetic(plain, study),
    ]
    rows = []
    for done, rows_of in enumerate(diagrams, 1):
        rows += [{**row, "scene": tracer.scene.name} for row in rows_of()]
        progress(done, len(diagrams))
    return rows


def oracle_error(scene: Scene) -> float:
    """Bound of a colour's error in the float64 oracle, whose choice of triangle is exact.

    Fewer than 256 operations lead from a ray to what one light adds, each rounding by 2^-53; a
    highlight is a power, which multiplies the error of its base, itself of fewer than 64
    operations, by the exponent.  What lights add is not negative, so that a sum rounds once for
    each and cancels nothing; and a colour is at most 1.
    """
    exponent = max((one.shininess for one in scene.materials if any(one.specular)), default=0.0)
    return (256 + 64 * exponent + len(scene.lights)) * 2.0**-53


def arithmetic(tracer: Tracer, study: Study) -> Iterator[dict]:
    """Colours of the rays of some pixels; textures at full size, which is all the oracle knows."""
    scene = tracer.scene
    slab = Slab(scene.camera, study.oracle_views, study.pixels)
    rng = np.random.default_rng(6)
    places = np.unique(rng.integers(0, slab.pixels, (study.oracle_pixels, 2)), axis=0)
    truth, seconds = clocked(lambda: oracle.trace(scene, slab, places))
    bundles = macropixels(slab, places)
    shape = len(places), slab.views**2, 3
    context: dict[str, Any] = {"panel": "arithmetic", "f_number": scene.camera.f_number}
    context |= {"knob": f"{len(places)} pixels, N = {slab.views}", "rays_per_pixel": slab.views**2}
    yield measured_point(
        lambda _: np.clip(tracer.bundle_radiance(bundles, places), 0, 1).reshape(shape),
        truth.reshape(shape),
        oracle_error(scene),
        inside=np.ones(shape[:2], bool),
        method="float32 kernels",
        **context,
    )
    exact = {"method": "float64 oracle", "rmse": 0.0, "seconds": seconds, "repeats": 1}
    yield dict.fromkeys(COLUMNS) | context | exact

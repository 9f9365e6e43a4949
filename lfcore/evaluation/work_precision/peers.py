"""Mitsuba 3 and POV-Ray, where they are installed: each against its own picture of far more rays.

Their shading is not ours (no ambient light in Mitsuba, no Blinn-Phong), so a common reference would
show that and not the error of their sampling.  Where one is missing its row says so.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lfcore.colour import display_values
from lfcore.evaluation import renderers
from lfcore.evaluation.metrics import psnr
from lfcore.evaluation.work_precision.measured_point import COLUMNS, judged, rmse
from lfcore.evaluation.work_precision.study import Study
from lfcore.optics.planes import SensorPlane
from lfcore.scene.model import Scene

LOG = logging.getLogger(__name__)
VIEWS, REFERENCE_VIEWS = (2, 4, 6), 64


def peers(scene: Scene, study: Study) -> Iterator[dict]:
    """The picture at the camera's own focus, without ambient light, by samples a pixel."""
    dark = replace(scene, ambient=(0.0, 0.0, 0.0))
    plane = SensorPlane(scene.camera.focus_m, scene.camera.f_number)
    for name, renderer in (("Mitsuba 3", renderers.mitsuba), ("POV-Ray", renderers.povray)):
        context = dict.fromkeys(COLUMNS) | {
            "panel": "tracing", "f_number": plane.f_number, "method": name,
        }  # fmt: skip
        reference = renderer(dark, plane, study.pixels, REFERENCE_VIEWS)
        if reference.picture is None:
            LOG.warning("%s: %s", name, reference.note)
            yield context | {"knob": "", "note": reference.note}
            continue
        truth = np.asarray(reference.picture, float)
        made = [renderer(dark, plane, study.pixels, views) for views in VIEWS]
        pictures = [np.asarray(one.picture) for one in made]
        errors = [rmse([picture], truth) for picture in pictures]
        # Independent samples: the error falls with the square root of their number.
        context["reference_rmse"] = errors[-1] * VIEWS[-1] / REFERENCE_VIEWS
        for views, one, picture, error in zip(VIEWS, made, pictures, errors, strict=True):
            quality = psnr(display_values(picture), display_values(truth), peak=255)
            yield judged(
                context
                | {
                    "knob": f"{views**2} samples",
                    "rays_per_pixel": views**2,
                    "rmse": error,
                    "psnr_db": quality if error else None,
                    "seconds": one.seconds,
                    "quartile_1_seconds": one.seconds,
                    "quartile_3_seconds": one.seconds,
                    "repeats": 1,
                }
            )

"""Case 20: the mean of up to 512 x 512 lens samples of one colour must be that colour.

Error: difference in steps of an 8-bit code; bound: 1/1024 of a step.  Naive: a float32
accumulator.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lfcore.evaluation.stability.judge import row
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.subject import CAMERA, Subject, bare_scene
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab

COLOUR = (0.7, 0.1, 1.0)


def accumulation(subject: Subject) -> Iterator[Row]:
    """In focus, and refocused so that rays of many pixels are mixed."""
    for focus in (CAMERA.focus_distance_m, 0.5):
        for views in (1, 2, 16, 64, 256, 512):
            slab = Slab(CAMERA, views, 2)
            scene = bare_scene(np.zeros((0, 3, 3)), background=COLOUR)
            plane = SensorPlane(focus, CAMERA.f_number, "square")

            def ours(scene=scene, slab=slab, plane=plane):
                picture = subject.picture(scene, slab, plane)
                # Pixels of the small picture that no ray reaches are black by definition.
                reached = picture.any(-1)
                assert reached.any()
                return 255 * np.abs(picture[reached] - np.array(COLOUR)).max()

            name = "accumulation" if focus == CAMERA.focus_distance_m else "accumulation refocused"
            yield row(name, "N", views, 1 / 1024, lambda views=views: _plain(views**2), ours)


def _plain(count: int) -> float:
    worst = 0.0
    for value in COLOUR:
        total = np.cumsum(np.full(count, value, np.float32), dtype=np.float32)[-1]
        worst = max(worst, abs(float(total / np.float32(count)) - value))
    return 255 * worst


CASES = (accumulation,)

"""Seconds that Mitsuba 3 and POV-Ray take to a quality, each against a true picture of its own.

Their shading is not ours (no ambient light in Mitsuba, no Blinn-Phong), so a common truth would
show that and not the error of their sampling.  They trace every picture anew, with independent
samples over pixel and lens, whose squared error falls with their number: a small picture of few
samples tells what a large one of many takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from lfcore.evaluation import renderers
from lfcore.evaluation.renderers import Rendered
from lfcore.evaluation.true_picture.points import COLUMNS
from lfcore.evaluation.true_picture.reference import inner_psnr
from lfcore.optics.planes import SensorPlane
from lfcore.scene.model import Scene

PEERS = {"Mitsuba 3": renderers.mitsuba, "POV-Ray": renderers.povray}
PIXELS = 24
"""Of the pictures that are rendered.  Seconds go with the pixels; errors are of each."""
SAMPLES, TRUE_SAMPLES = 4, 16
"""A side: the truth has sixteen times as many samples, so that its error is 12 dB below."""


def peer_rows(
    scene: Scene,
    planes: Sequence[SensorPlane],
    pixels: int,
    targets_db: Sequence[float],
    *,
    peers: dict[str, Callable[..., Rendered]] = PEERS,
) -> Iterator[dict]:
    """Rows of each peer, target and plane, and one of all planes together, which has no plane.

    ``seconds`` are what ``pixels`` a side are expected to take, and ``expected_db`` is the target.
    A peer that is not installed, or cannot show the scene, is one row whose ``note`` says why.
    """
    dark = replace(scene, ambient=(0.0, 0.0, 0.0))
    for method, renderer in peers.items():
        context = {"scene": scene.name, "f_number": planes[0].f_number, "method": method}
        sampled, note = _sampled(renderer, dark, planes)
        if note:
            yield dict.fromkeys(COLUMNS) | context | {"note": note}
            continue
        for target in targets_db:
            goal = {"lattice": f"{target:g} dB", "expected_db": target}
            rows: list[dict] = []
            for plane, (psnr_db, seconds_a_ray) in zip(planes, sampled, strict=True):
                samples = math.ceil(SAMPLES**2 * 10 ** ((target - psnr_db) / 10))
                rays = samples * pixels**2
                seconds = rays * seconds_a_ray
                focus = plane.focus_m
                rows.append({"plane_m": focus, "pictures": 1, "rays": rays, "seconds": seconds})
            together = {key: sum(row[key] for row in rows) for key in ("rays", "seconds")}
            for row in (*rows, {"pictures": len(rows), **together}):
                rays = row["rays"] / row["pictures"] / pixels**2
                yield dict.fromkeys(COLUMNS) | context | goal | row | {"rays_per_pixel": rays}


def _sampled(
    renderer: Callable[..., Rendered], scene: Scene, planes: Sequence[SensorPlane]
) -> tuple[list[tuple[float, float]], str]:
    """Of each plane the PSNR in dB that a peer's samples give, and its seconds a pixel and sample;
    or nothing, and why."""
    found = []
    for plane in planes:
        few, true = (renderer(scene, plane, PIXELS, side) for side in (SAMPLES, TRUE_SAMPLES))
        for one in (few, true):
            if one.picture is None:
                return [], one.note
        # What is measured has the truth's own error in it, of samples sixteen times as many.
        apart = inner_psnr(*(np.asarray(one.picture, float) for one in (few, true)))
        own = apart + 10 * math.log10(1 + (SAMPLES / TRUE_SAMPLES) ** 2)
        found.append((own, true.seconds / TRUE_SAMPLES**2 / PIXELS**2))
    return found, ""

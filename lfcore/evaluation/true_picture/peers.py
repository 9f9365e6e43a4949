"""Seconds that Mitsuba 3 and POV-Ray take to a quality, each against a true picture of its own.

Their shading is not ours (no ambient light in Mitsuba, no Blinn-Phong), so a common truth would
show that and not the error of their sampling.  They trace every picture anew, with independent
samples over pixel and lens, whose squared error falls with their number: a small picture of few
samples tells what a large one of many takes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

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


@dataclass(frozen=True)
class Sampled:
    """What ``samples`` a pixel gave: PSNR in dB, and seconds a pixel and sample."""

    samples: int
    psnr_db: float
    seconds_a_ray: float

    def samples_for(self, target_db: float) -> float:
        """A pixel, of independent ones."""
        return self.samples * 10 ** ((target_db - self.psnr_db) / 10)


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
        for target in targets_db if not note else ():
            rows = [
                _row(one, plane, pixels, target) for one, plane in zip(sampled, planes, strict=True)
            ]
            together = {key: sum(row[key] for row in rows) for key in ("rays", "seconds")}
            together |= {"pictures": len(rows), "lattice": f"{target:g} dB", "expected_db": target}
            for row in (*rows, together):
                rays = row["rays"] / row["pictures"] / pixels**2
                yield dict.fromkeys(COLUMNS) | context | row | {"rays_per_pixel": rays}


def _row(one: Sampled, plane: SensorPlane, pixels: int, target: float) -> dict:
    samples = math.ceil(one.samples_for(target))
    rays = samples * pixels**2
    return {
        "plane_m": plane.focus_distance_m, "pictures": 1, "lattice": f"{target:g} dB",
        "rays": rays, "seconds": rays * one.seconds_a_ray, "expected_db": target,
    }  # fmt: skip


def _sampled(
    renderer: Callable[..., Rendered], scene: Scene, planes: Sequence[SensorPlane]
) -> tuple[list[Sampled], str]:
    """What a peer's samples give on each plane; or nothing, and why."""
    found = []
    for plane in planes:
        few, true = (renderer(scene, plane, PIXELS, side) for side in (SAMPLES, TRUE_SAMPLES))
        for one in (few, true):
            if one.picture is None:
                return [], one.note
        # What is measured has the truth's own error in it, of samples sixteen times as many.
        apart = inner_psnr(*(np.asarray(one.picture, float) for one in (few, true)))
        own = apart + 10 * math.log10(1 + (SAMPLES / TRUE_SAMPLES) ** 2)
        found.append(Sampled(SAMPLES**2, own, true.seconds / TRUE_SAMPLES**2 / PIXELS**2))
    return found, ""

"""The seconds that Mitsuba 3 and POV-Ray need for a quality, each against its own true picture.

Their shading is not ours (no ambient light in Mitsuba, no Blinn-Phong), so a common truth would
show that difference and not the error of their sampling.  They trace every picture separately, with
independent samples over pixel and lens: squared error falls with the number of samples.  A small
picture with few samples therefore predicts the cost of a large picture with many.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from lfcore.evaluation import renderers
from lfcore.evaluation.renderers import Rendered
from lfcore.evaluation.true_picture import inner_psnr
from lfcore.evaluation.work_precision.points import COLUMNS, ON_THE_FLY
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.scene.model import Scene

PEERS = {"Mitsuba 3": renderers.mitsuba, "POV-Ray": renderers.povray}
PIXELS = 24
"""The side of the pictures that are rendered; time is proportional to the number of pixels."""
SAMPLES, TRUE_SAMPLES = 4, 16
"""Samples per side of a pixel: the truth has 16 times as many, so its error is 12 dB lower."""


def peer_rows(
    scene: Scene,
    planes: Sequence[SensorPlane],
    pixels: Pixels,
    targets_db: Sequence[float],
    *,
    peers: dict[str, Callable[..., Rendered]] = PEERS,
) -> Iterator[dict]:
    """A row per renderer and target: predicted samples and seconds for all planes together.

    ``expected_db`` is the target.  A renderer that is not installed, or cannot show the scene, has
    one row whose ``note`` says why.
    """
    area = math.prod(Size.of(pixels))
    dark = replace(scene, ambient=(0.0, 0.0, 0.0))
    for method, renderer in peers.items():
        context = {"panel": ON_THE_FLY, "f_number": planes[0].f_number, "method": method}
        sampled, note = _sampled(renderer, dark, planes)
        if note:
            yield dict.fromkeys(COLUMNS) | context | {"note": note}
            continue
        for target in targets_db:
            samples = [
                math.ceil(SAMPLES**2 * 10 ** ((target - psnr_db) / 10)) for psnr_db, _ in sampled
            ]
            per_sample = [seconds * area for _, seconds in sampled]
            yield dict.fromkeys(COLUMNS) | context | {
                "setting": f"{target:g} dB", "rays_per_pixel": sum(samples),
                "rays": sum(samples) * area, "expected_db": target,
                "seconds": float(np.dot(samples, per_sample)),
            }  # fmt: skip


def _sampled(
    renderer: Callable[..., Rendered], scene: Scene, planes: Sequence[SensorPlane]
) -> tuple[list[tuple[float, float]], str]:
    """For each plane the PSNR in dB of a few samples, and the seconds per pixel and sample; or
    nothing, and the reason."""
    found = []
    for plane in planes:
        few, true = (renderer(scene, plane, PIXELS, side) for side in (SAMPLES, TRUE_SAMPLES))
        for one in (few, true):
            if one.picture is None:
                return [], one.note
        # The measured difference includes the truth's own error, of 16 times as many samples.
        apart = inner_psnr(*(np.asarray(one.picture, float) for one in (few, true)))
        own = apart + 10 * math.log10(1 + (SAMPLES / TRUE_SAMPLES) ** 2)
        found.append((own, true.seconds / TRUE_SAMPLES**2 / PIXELS**2))
    return found, ""

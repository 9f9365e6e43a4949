"""Step 4: what stands in front vanishes through a wide lens focused behind it."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from lfcore.evaluation.camera_arrays import errors
from lfcore.evaluation.timing import clocked
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.focal_surface import parallel
from lfcore.refocus.array.quadrature import quadrature
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.rendering.photograph import direct_thin_lens
from lfcore.tracing.tracer import Tracer

FOV_DEG = 50.0
LENS_POINTS = 24


def see_through(
    field: DeviceField,
    tracer: Tracer,
    study: Mapping,
    size: int,
    samples: int,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> tuple[list[np.ndarray], list[str], dict]:
    """Pictures, labels and measurements: from the light field, and what is behind directly.

    Parameters
    ----------
    study : ``focus_m`` of what is behind and of what stands in front, nearest first; ``lens_m``,
        radius of the lens at each; ``names``.
    size : pixels a side.
    samples : rays a pixel of the picture that is traced directly.
    """
    named = list(zip(study["names"], study["focus_m"], study["lens_m"], strict=True))
    (_, focus, lens), near = named[0], named[1:]

    def camera(radius: float) -> VirtualCamera:
        """At the middle of the grid, in the array's own direction."""
        return VirtualCamera(np.zeros(3), np.eye(3), FOV_DEG, (size, size), radius)

    def from_field(focus_m: float, radius: float):
        surface = parallel(focus_m)
        return clocked(
            lambda: quadrature(field, camera(radius), surface, LENS_POINTS, 2), warm_up=1
        )

    direct, direct_seconds = clocked(
        lambda: direct_thin_lens(tracer, camera(lens), focus, samples, progress=progress)
    )
    (pinhole, _), (seen, seconds) = from_field(focus, 0.0), from_field(focus, lens)
    in_front = [from_field(focus_m, radius)[0] for _, focus_m, radius in near]
    pictures = [pinhole.image, seen.image, direct, *(made.image for made in in_front)]
    labels = [
        "light field, pinhole",
        f"light field, focus {focus:g} m",
        f"traced directly, focus {focus:g} m",
        *(f"{name}, focus {focus_m:g} m" for name, focus_m, _ in near),
    ]
    columns = field.array.columns_m
    spacing = columns[1] - columns[0]
    measured = {
        **errors(seen.image, direct),
        "pinhole_psnr_db": errors(pinhole.image, direct)["psnr_db"],
        "seconds": seconds,
        "direct_seconds": direct_seconds,
        "direct_samples": samples,
        "names": list(study["names"]),
        "lens_m": dict(zip(study["names"], study["lens_m"], strict=True)),
        "focus_m": dict(zip(study["names"], study["focus_m"], strict=True)),
        "spacing_m": spacing,
        # Where neighbouring cameras see what is nearest, aimed at what is behind, in pixels.
        "jump_px": spacing * abs(1 / near[0][1] - 1 / focus) / field.array.pixel_pitch,
    }
    return pictures, labels, measured

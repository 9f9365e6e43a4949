"""The plenoptic photograph, in focus and out of focus, and pictures from it (figure 4.6)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.evaluation.figures import Cell, contact_sheet, enlarged, shrunk
from lfcore.optics.planes import SensorPlane
from lfcore.optics.plenoptic import PlenopticCamera, sub_apertures
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.plenoptic import photograph, refocus_photograph
from lfcore.tracing.tracer import Tracer

PANEL_PX = 384
"""The width of a picture in the sheet."""
LENSES_SHOWN = 24
"""The microlenses per side of the detail, in which each is visible."""
INSET = 2
"""The distance of the two views from the left and right end of the lens, in samples."""


def take(
    tracer: Tracer, focus_m: float, lenses: int, samples: int
) -> tuple[PlenopticCamera, np.ndarray]:
    """The scene's camera with a microlens array, focused at ``focus_m`` with the same field, and
    the photograph (M N, M N, 3), uint8 sRGB.

    Raises :class:`OpticsError` for counts that make no camera, or a focus inside the focal length.
    """
    scene_camera = tracer.scene.camera
    camera = PlenopticCamera(
        focused_camera(scene_camera, SensorPlane.of(scene_camera, focus_m)), lenses, samples
    )
    return camera, photograph(tracer, camera)


def panels(
    tracer: Tracer, camera: PlenopticCamera, pixels: np.ndarray, focus_m: Sequence[float]
) -> list[Cell]:
    """One row of the sheet.

    The photograph reduced to one pixel per microlens, a detail of it around the middle with its
    microlenses, views from the left and right of the lens, and the photograph refocused at each
    of ``focus_m``, through the round lens.
    """
    lenses, samples, middle = camera.lenses, camera.samples, camera.samples // 2
    reduced = sub_apertures(srgb_decode(pixels), samples).mean((0, 1))
    part = min(LENSES_SHOWN, lenses)
    detail = enlarged(pixels, (lenses - part) // 2 * samples, part * samples, PANEL_PX)
    recorded = f"focus {camera.camera.focus_m:.3g} m"
    cells = [
        (reduced, f"{len(pixels)} x {len(pixels)}, {recorded}, reduced"),
        (srgb_decode(detail), f"{LENSES_SHOWN} x {LENSES_SHOWN} microlenses"),
    ]
    for i, name in ((INSET, "left"), (samples - 1 - INSET, "right")):
        view = srgb_decode(sub_apertures(pixels, samples)[middle, i])
        cells.append((view, f"view from the {name} of the lens"))
    planes = [SensorPlane(focus, camera.camera.f_number) for focus in focus_m]
    refocused = refocus_photograph(camera, pixels, planes, device=tracer.device)
    labels = (f"refocused to {focus:.3g} m" for focus in focus_m)
    return [*cells, *zip(refocused, labels, strict=True)]


def plenoptic_sheet(path: str | Path, rows: Sequence[list[Cell]]) -> None:
    """A row per photograph, of :func:`panels`; all panels have one size."""
    cells = [(shrunk(picture, PANEL_PX), label) for row in rows for picture, label in row]
    contact_sheet(path, cells, len(rows[0]), panel_px=PANEL_PX)

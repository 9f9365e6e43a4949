"""The plenoptic photograph, in focus and out of focus, and pictures from it (figure 4.6)."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from lfcore.colour import srgb_decode
from lfcore.evaluation.figures import Cell, contact_sheet
from lfcore.optics.planes import SensorPlane
from lfcore.optics.plenoptic import PlenopticCamera, sub_aperture
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.plenoptic import photograph, refocus_photograph
from lfcore.tracing.tracer import Tracer

PANEL_PX = 384
LENSES_SHOWN = 24
"""Microlenses per side of the detail, in which each is visible."""
INSET = 2
"""The distance of the two views from the left and right end of the lens, in samples."""


def take(
    tracer: Tracer, focus_m: float, lenses: int, samples: int
) -> tuple[PlenopticCamera, np.ndarray]:
    """The scene's camera with a microlens array, focused at ``focus_m`` with the same field, and
    the photograph (M N, M N, 3), uint8 sRGB.

    Raises :class:`OpticsError` for counts that make no camera, or a focus inside the focal length.
    """
    own = tracer.scene.camera
    camera = PlenopticCamera(focused_camera(own, SensorPlane.of(own, focus_m)), lenses, samples)
    return camera, photograph(tracer, camera)


def panels(
    tracer: Tracer, camera: PlenopticCamera, pixels: np.ndarray, focus_m: Sequence[float]
) -> list[Cell]:
    """One row of the sheet.

    The photograph reduced to one pixel per microlens, a detail of it around the middle with its
    microlenses, views from the left and right of the lens, and the photograph refocused at each
    of ``focus_m``, through the round lens.
    """
    samples, middle = camera.samples, camera.samples // 2
    recorded = f"focus {camera.camera.focus_m:.3g} m"
    cells = [
        (reduced(pixels, samples), f"{len(pixels)} x {len(pixels)}, {recorded}, reduced"),
        (detail(pixels, samples), f"{LENSES_SHOWN} x {LENSES_SHOWN} microlenses"),
    ]
    for i, name in ((INSET, "left"), (samples - 1 - INSET, "right")):
        view = srgb_decode(sub_aperture(pixels, samples, i, middle))
        cells.append((view, f"view from the {name} of the lens"))
    planes = [SensorPlane(focus, camera.camera.f_number) for focus in focus_m]
    refocused = refocus_photograph(camera, pixels, planes, device=tracer.device)
    labels = (f"refocused to {focus:.3g} m" for focus in focus_m)
    return [*cells, *zip(refocused, labels, strict=True)]


def reduced(pixels: np.ndarray, samples: int) -> np.ndarray:
    """(M, M, 3) float32, linear light: the mean under each microlens."""
    lenses = len(pixels) // samples
    out = np.empty((lenses, lenses, 3), np.float32)
    for row in range(lenses):
        band = srgb_decode(pixels[row * samples : (row + 1) * samples])
        out[row] = band.reshape(samples, lenses, samples, 3).mean(0).mean(1)
    return out


def detail(pixels: np.ndarray, samples: int) -> np.ndarray:
    """Some microlenses around the middle, enlarged by a whole factor; linear light."""
    lenses = len(pixels) // samples
    part = min(LENSES_SHOWN, lenses)
    start = (lenses - part) // 2 * samples
    inside = pixels[start : start + part * samples, start : start + part * samples]
    times = max(1, PANEL_PX // (part * samples))
    return srgb_decode(inside.repeat(times, axis=0).repeat(times, axis=1))


def plenoptic_sheet(path: str | Path, rows: Sequence[list[Cell]]) -> None:
    """A row per photograph, as :func:`panels` gives them; all panels of one size."""
    cells = [(_fitted(picture), label) for row in rows for picture, label in row]
    contact_sheet(path, cells, len(rows[0]), panel_px=PANEL_PX)


def _fitted(picture: np.ndarray) -> np.ndarray:
    """At most PANEL_PX wide, by means over areas, in linear light."""
    if len(picture) <= PANEL_PX:
        return picture
    size = (PANEL_PX, PANEL_PX)
    return cv2.resize(np.asarray(picture, np.float32), size, interpolation=cv2.INTER_AREA)

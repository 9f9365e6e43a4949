"""The depth that a stored light field shows, and the limits of its pictures."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from lfcore.optics.focus import (
    DepthRange,
    check_place,
    check_surface,
    check_words,
    ends_of,
    focus_distance,
)
from lfcore.optics.planes import SensorPlane
from lfcore.refocus.free_views import inverse_depth
from lfcore.refocus.stored_depth import read_depths
from lfcore.storage.lightfield import LightFieldFile

FOCUS_MARGIN = 1.1
"""The ratio by which a focus may be beyond the nearest or farthest surface without a warning."""
F_NUMBER_STEP = 1.1
"""The ratio of f-numbers that views should tell apart: a third of a stop is 1.12."""


class VisibleDepth:
    """The depth that the middle view of a file shows; it is decoded once, when it is needed."""

    def __init__(self, field: LightFieldFile):
        self.field = field

    @cached_property
    def middle(self) -> np.ndarray:
        """(H, W) float64: the middle view's depth, metres, infinity for a miss."""
        return self.field.metres(inverse_depth(self.field))

    @cached_property
    def range(self) -> DepthRange | None:
        """The near and far end: those that the file states, as for the scene; else the middle
        view's; without stored depth, those of all views."""
        content = self.field.content
        stated = content.get("ends_m") or content.get("seen_m")
        if stated is None and self.field.metadata.depth is not None:
            return ends_of(self.middle[np.isfinite(self.middle)])
        stated = stated or self.field.depth_range
        return DepthRange(*stated) if stated else None

    def focus(self, focus_m: float | str | None, place: Sequence[float] | None) -> float | None:
        """The distance, metres, of a focus or of the surface at a place; None without both."""
        if place is not None:
            return self._at(place)
        if focus_m is None:
            return None
        is_word = isinstance(check_words(focus_m), str)
        return focus_distance(focus_m, self.range if is_word else None)  # a number needs no range

    def _at(self, place: Sequence[float]) -> float:
        x, y = check_place(place)
        row, column = (
            min(int(share * count), count - 1)
            for share, count in zip((y, x), self.middle.shape, strict=True)
        )
        return check_surface(float(self.middle[row, column]), (x, y))


def _is_in(focus_m: float, ends: tuple[float, float]) -> bool:
    return ends[0] / FOCUS_MARGIN <= focus_m <= ends[1] * FOCUS_MARGIN


def _image_range(field: LightFieldFile) -> tuple[float, float] | None:
    """The nearest and the farthest image in mirrors, glass and coats of the middle view, metres;
    infinity of what is behind all surfaces, None without images."""
    if field.specular is None:
        return None
    middle = field.require_slab().views // 2
    depth = read_depths(field.specular, np.array([middle * (field.require_slab().views + 1)]))
    depth = depth[depth > 0]
    return (float(depth.min()), float(depth.max())) if len(depth) else None


def doubts(field: LightFieldFile, plane: SensorPlane) -> list[str]:
    """As :meth:`lfcore.LightField.doubts`."""
    lines, slab = [], field.require_slab()
    aperture = plane.lens_aperture(slab)
    if field.metric and field.depth_range:
        seen = {"what is seen is": field.depth_range}
        if not _is_in(plane.focus_m, field.depth_range) and (images := _image_range(field)):
            seen = {"surfaces are": field.depth_range, "images in mirrors and glass": images}
        if not any(_is_in(plane.focus_m, ends) for ends in seen.values()):
            what = ", ".join(f"{name} from {a:.4g} to {b:.4g} m" for name, (a, b) in seen.items())
            lines.append(f"nothing is in focus at {plane.focus_m:.4g} m: {what}")
    if field.metadata.depth is None:
        lens = slab.lens_positions()
        wider, same, narrower = (
            replace(aperture, radius_m=aperture.radius_m * ratio).contains(lens, lens[:, None])
            for ratio in (F_NUMBER_STEP, 1.0, 1 / F_NUMBER_STEP)
        )
        if (wider == narrower).all():
            first, last = plane.f_number / F_NUMBER_STEP, plane.f_number * F_NUMBER_STEP
            lines.append(
                f"f/{first:.3g} to f/{last:.3g} give the same picture: {same.sum()} of "
                f"{slab.views**2} views are open; depth, or more views, would tell them apart"
            )
    return lines

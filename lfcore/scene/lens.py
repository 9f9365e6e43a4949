"""The lens of a scene: pinholes, fitted lenses, and settings of focus and aperture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from lfcore.errors import OpticsError
from lfcore.optics.focus import exclude_twice, f_number_of_blur, focus_distance
from lfcore.optics.size import Pixels
from lfcore.scene.framing import fitted_lens
from lfcore.scene.seen import focus_at as focus_at_place

if TYPE_CHECKING:
    from lfcore.scene.model import Scene

LEAST_PINHOLE = 1000.0
"""The least f-number of a pinhole."""
PINHOLE_BLUR = 1e-5
"""The most blur of the nearest point through a pinhole, as a share of the picture's shorter
side."""


def is_pinhole(scene: Scene) -> bool:
    """Whether the lens is too small to blur any visible point."""
    camera, visible = scene.camera, scene.depth_range
    if camera.f_number < LEAST_PINHOLE or visible is None:
        return False
    return camera.lens_radius_m < PINHOLE_BLUR * camera.field_width * visible.near_m


def with_lens(scene: Scene) -> Scene:
    """The scene with a lens fitted to the visible depths; see :meth:`Scene.with_lens`."""
    camera, visible = scene.camera, scene.depth_range
    if visible is None:
        return scene
    inside = visible.near_m <= camera.focus_m <= visible.far_m
    focus = camera.focus_m if inside else visible.middle_m
    return replace(scene, camera=fitted_lens(visible, camera.field_width, focus))


def focus_and_aperture(
    scene: Scene,
    focus_m: float | str | None,
    f_number: float | None,
    focus_at: Sequence[float] | None,
    blur: float | str | None,
    pixels: Pixels,
) -> tuple[float | None, float | None]:
    """The distance in metres and the f-number of a picture's settings; None: the camera's.

    The settings are those of :meth:`Scene.plane`, which documents errors, too.
    """
    exclude_twice(focus_m=focus_m, focus_at=focus_at)
    exclude_twice(f_number=f_number, blur=blur)
    camera, visible = scene.camera, scene.depth_range
    settings = focus_m, focus_at, f_number, blur
    if scene.is_pinhole and any(value is not None for value in settings):
        lens = scene.with_lens().camera
        if f_number is None and blur is None:
            f_number = camera.focal_length_m / (2 * lens.lens_radius_m)
        if focus_m is None and focus_at is None:
            focus_m = lens.focus_m
    distance = None if focus_m is None else focus_distance(focus_m, visible)
    if focus_at is not None:
        distance = focus_at_place(scene.triangles, camera.field_width, focus_at, pixels)
    if blur is not None:
        f_number = f_number_of_blur(
            blur, camera.focal_length_m, camera.focus_m if distance is None else distance,
            camera.field_width, visible,
        )  # fmt: skip
    if distance is not None and distance <= camera.focal_length_m and visible:
        near, far = visible
        raise OpticsError(
            f"{distance:.4g} m is nearer than the lens can focus, {camera.focal_length_m:.4g} m",
            key="focus_m", remedy=f"Surfaces are at {near:.4g} to {far:.4g} m: near or far",
        )  # fmt: skip
    return distance, f_number

"""Limits of a scene's numbers, set by the tracer's float32; triangles have their own limits.

The tracer squares distances and multiplies them by colours: numbers up to 1e12, the limit of
coordinates, keep the products within float32's 3e38.
"""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lfcore.reading import Where
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.assemble import LARGEST_COORDINATE
from lfcore.scene.model import Scene

BRIGHTEST = 1e12
"""The largest number of a colour of lights, materials, background and sky."""
MOST_ATTENUATION = 1e12
"""The largest factor of a light near its position: finite, because it also multiplies highlights
of 0."""
SMALLEST_LENGTH = 1e-12
"""The least length of a camera, metres; a pinhole may be smaller."""
LARGEST_LENGTH = 1e12
"""The largest length of a camera, metres."""
WIDEST_FIELD = 1e9
"""The greatest tangent extent of a field, and the inverse of the least."""
FARTHEST_UV = 1e5
"""The most repeats of a texture: beyond, float32 steps exceed a hundredth of a repeat."""


def within_limits(scene: Scene, file: str | Path) -> Scene:
    """Return ``scene``; raise :class:`SceneError` that names the part beyond a limit."""
    where = Where(file)
    for index, light in enumerate(scene.lights):
        _check_light(light, where["lights"][index])
    for material in scene.every_material:
        for name in ("diffuse", "specular", "emission"):
            place = where[f"material {material.name}: {name}"]
            _check(getattr(material, name), 0, BRIGHTEST, place)
    _check(scene.ambient, 0, BRIGHTEST, where["ambient light"])
    _check(scene.background, 0, BRIGHTEST, where["background"])
    camera = scene.camera
    focus = 0.0 if math.isinf(camera.focus_m) else camera.focus_m
    for name, value, least, most in (
        ("focal length in metres", camera.focal_length_m, SMALLEST_LENGTH, LARGEST_LENGTH),
        ("sensor width in metres", camera.sensor_width_m, SMALLEST_LENGTH, LARGEST_LENGTH),
        ("image distance in metres", camera.image_distance_m, SMALLEST_LENGTH, LARGEST_LENGTH),
        ("lens radius in metres", camera.lens_radius_m, 1e-30, LARGEST_LENGTH),
        ("focus distance in metres", focus, 0, 1e30),
        ("width of the field at 1 m", camera.field_width, 1 / WIDEST_FIELD, WIDEST_FIELD),
    ):
        _check([value], least, most, where[f"camera: {name}"])
    farthest = np.abs(scene.uvs).max(initial=0)
    _check([float(farthest)], 0, FARTHEST_UV, where["texture coordinates"])
    brightest = np.abs(scene.colours).max(initial=0)
    _check([float(brightest)], 0, BRIGHTEST, where["colours of corners"])
    for motion in scene.motions:
        poses = np.concatenate([motion.start[:3].ravel(), motion.end[:3].ravel()])
        _check(poses, -LARGEST_COORDINATE, LARGEST_COORDINATE, where["motion"])
    return scene


def _check_light(light: Light, where: Where) -> None:
    def part(name: str) -> Where:
        return Where(where.file, f"{where.key}: {name}")

    if light.kind not in (POINT, DIRECTIONAL):
        raise where.error(f"unknown kind of light {light.kind!r}")
    if light.kind == POINT:
        most = LARGEST_COORDINATE
        _check(light.vector, -most, most, part("metres from the camera"))
    else:  # a direction whose squared length overflows has none
        _check([math.hypot(*light.vector)], 0.999, 1.001, part("length of its direction"))
    _check(light.colour, 0, BRIGHTEST, part("colour"))
    _check([light.reference_distance_m], 0, LARGEST_LENGTH, part("reference distance"))


def _check(values: Iterable[float], least: float, most: float, where: Where) -> None:
    for value in values:
        if not least <= value <= most:  # NaN is not, either
            remedy = f"Give a number from {least:g} to {most:g}"
            raise where.error(f"{value:g} is outside the range of the tracer", remedy)

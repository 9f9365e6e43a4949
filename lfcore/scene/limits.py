"""What numbers of a scene the tracer's float32 can work with; triangles have limits of their own.

The tracer squares distances and multiplies them by colours: numbers to 1e12, as those of triangles
are, keep that within float32's 3e38.
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
"""The largest number of a colour: of lights, materials, and what is around the scene."""
MOST_ATTENUATION = 1e12
"""The most that nearness to a light multiplies it by: finite, because highlights of 0 are
multiplied, too."""
SMALLEST_LENGTH, LARGEST_LENGTH = 1e-12, 1e12
"""The lengths of a camera, metres; a pinhole may be smaller."""
WIDEST_FIELD = 1e9
"""Tangent extent; and the inverse of the narrowest."""
FARTHEST_UV = 1e5
"""Repeats of a texture: beyond, float32 cannot tell a hundredth of one from the next."""


def within_limits(scene: Scene, file: str | Path) -> Scene:
    """``scene`` itself; :class:`SceneError` that names the part whose numbers are beyond."""
    where = Where(file)
    for index, light in enumerate(scene.lights):
        _check_light(light, where["lights"][index])
    for material in scene.every_material:
        for name in ("diffuse", "specular", "emission"):
            here = where[f"material {material.name}: {name}"]
            _check(getattr(material, name), 0, BRIGHTEST, here)
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
    def of(what: str) -> Where:
        return Where(where.file, f"{where.key}: {what}")

    if light.kind not in (POINT, DIRECTIONAL):
        raise where.error(f"unknown kind of light {light.kind!r}")
    if light.kind == POINT:
        most = LARGEST_COORDINATE
        _check(light.vector, -most, most, of("metres from the camera"))
    else:  # what the square of a length overflows has none
        _check([math.hypot(*light.vector)], 0.999, 1.001, of("length of its direction"))
    _check(light.colour, 0, BRIGHTEST, of("colour"))
    _check([light.reference_distance_m], 0, LARGEST_LENGTH, of("reference distance"))


def _check(values: Iterable[float], least: float, most: float, where: Where) -> None:
    for value in values:
        if not least <= value <= most:  # NaN is not, either
            remedy = f"Give a number from {least:g} to {most:g}"
            raise where.error(f"{value:g} is beyond what can be traced", remedy)

"""What numbers of a scene the tracer's float32 can work with; triangles have limits of their own.

The tracer squares distances and multiplies them by colours: numbers to 1e12, as those of triangles
are, keep that within float32's 3e38.
"""

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lfcore.errors import SceneError
from lfcore.optics.camera import Camera
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.assemble import LARGEST_COORDINATE
from lfcore.scene.model import Scene

BRIGHTEST = 1e12
"""Of colours: of lights, of materials, of what is around the scene."""
SMALLEST_LENGTH, LARGEST_LENGTH = 1e-12, 1e12
"""Of a camera, metres; a pinhole may be smaller."""
WIDEST_FIELD = 1e9
"""Tangent extent; and the inverse of the narrowest."""
FARTHEST_UV = 1e5
"""Repeats of a texture: beyond, float32 cannot tell a hundredth of one from the next."""


def within_limits(scene: Scene, file: str | Path) -> Scene:
    """``scene`` itself; :class:`SceneError` that names the part whose numbers are beyond."""
    for index, light in enumerate(scene.lights):
        _check_light(light, file, f"lights[{index}]")
    for material in scene.materials:
        key = f"material {material.name}"
        _check(material.diffuse, 0, BRIGHTEST, file, f"{key}: diffuse")
        _check(material.specular, 0, BRIGHTEST, file, f"{key}: specular")
        _check(material.emission, 0, BRIGHTEST, file, f"{key}: emission")
    _check(scene.ambient, 0, BRIGHTEST, file, "ambient light")
    _check(scene.background, 0, BRIGHTEST, file, "background")
    _check_camera(scene.camera, file)
    farthest = np.abs(scene.uvs).max(initial=0)
    _check([float(farthest)], 0, FARTHEST_UV, file, "texture coordinates")
    for motion in scene.motions:
        poses = np.concatenate([motion.start[:3].ravel(), motion.end[:3].ravel()])
        _check(poses, -LARGEST_COORDINATE, LARGEST_COORDINATE, file, "motion")
    return scene


def _check_light(light: Light, file: str | Path, key: str) -> None:
    if light.kind not in (POINT, DIRECTIONAL):
        raise SceneError(f"unknown kind of light {light.kind!r}", file=file, key=key)
    if light.kind == POINT:
        most = LARGEST_COORDINATE
        _check(light.vector, -most, most, file, f"{key}: metres from the camera")
    else:  # what the square of a length overflows has none
        _check([math.hypot(*light.vector)], 0.999, 1.001, file, f"{key}: length of its direction")
    _check(light.colour, 0, BRIGHTEST, file, f"{key}: colour")
    _check([light.reference_distance_m], 0, LARGEST_LENGTH, file, f"{key}: reference distance")


def _check_camera(camera: Camera, file: str | Path) -> None:
    lengths = {
        "focal length": camera.focal_length_m,
        "sensor width": camera.sensor_width_m,
        "image distance": camera.image_distance_m,
    }
    for name, length in lengths.items():
        _check([length], SMALLEST_LENGTH, LARGEST_LENGTH, file, f"camera: {name} in metres")
    _check([camera.lens_radius_m], 1e-30, LARGEST_LENGTH, file, "camera: lens radius in metres")
    if math.isfinite(camera.focus_m):
        _check([camera.focus_m], 0, 1e30, file, "camera: focus distance in metres")
    field = camera.field_width
    _check([field], 1 / WIDEST_FIELD, WIDEST_FIELD, file, "camera: width of the field at 1 m")


def _check(values: Iterable[float], least: float, most: float, file: str | Path, key: str) -> None:
    for value in values:
        if not least <= value <= most:  # NaN is not, either
            raise SceneError(
                f"{value:g} is beyond what can be traced",
                file=file,
                key=key,
                remedy=f"Give a number from {least:g} to {most:g}",
            )

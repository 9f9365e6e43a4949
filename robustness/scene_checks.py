"""Checks whether a scene that a reader accepted can be traced."""

import math

import numpy as np

from lfcore.scene.appearance import DIRECTIONAL
from lfcore.scene.model import Scene
from robustness.outcome import SilentlyWrong

LARGEST = float(np.finfo(np.float32).max)
"""The largest number of the tracer."""


def check_scene(scene: Scene) -> None:
    """Raise :class:`SilentlyWrong` for values that the tracer's float32 cannot store or use."""
    count = scene.triangle_count
    for name in ("triangles", "normals", "uvs", "colours"):
        array = getattr(scene, name)
        _must(len(array) in (0, count), f"{name} of {len(array)} of {count} triangles")
        _must(bool(np.isfinite(array).all()), f"{name} are not finite")
    lengths = np.linalg.norm(scene.normals.astype(np.float64), axis=-1)
    _must(bool((abs(lengths - 1) < 1e-3).all()), "normals are not unit vectors")
    ids = scene.material_ids
    _must(bool(((ids >= 0) & (ids < len(scene.every_material))).all()), "material ids out of range")
    for material in scene.every_material:
        values = (*material.diffuse, *material.specular, *material.emission, material.shininess)
        _must(all(_storable(value) and value >= 0 for value in values), f"material {values}")
        _must(-1 <= material.texture < len(scene.textures), f"texture {material.texture}")
    for texture in scene.textures:
        _must(texture.ndim == 3 and texture.dtype == np.uint8 and texture.size > 0, "a texture")
    for light in scene.lights:
        _check_light(light)
    for colour in (scene.ambient, scene.background):
        _must(all(_storable(value) and value >= 0 for value in colour), f"a colour {colour}")
    _check_optics(scene)


def _check_light(light) -> None:
    values = (*light.vector, *light.colour, light.reference_distance_m)
    _must(all(map(_storable, values)), f"a light {values}")
    _must(min(light.colour) >= 0 and light.reference_distance_m >= 0, f"a dark light {values}")
    if light.kind == DIRECTIONAL:
        length = math.hypot(*light.vector)
        _must(abs(length - 1) < 1e-3, f"a light's direction has the length {length}")


def _check_optics(scene: Scene) -> None:
    camera = scene.camera
    values = (camera.focal_length_m, camera.sensor_width_m, camera.f_number, camera.lens_radius_m)
    _must(all(_storable(value) and value > 0 for value in values), f"a camera {values}")
    _must(camera.focus_m > camera.focal_length_m, "a focus inside the focal length")
    _must(camera.field_width > 0 and _storable(camera.field_width), "a camera without a field")
    _must(len(scene.focus_distances_m) > 0, "no focus distances")
    for distance in scene.focus_distances_m:
        _must(distance > camera.focal_length_m, f"a focus distance of {distance}")
    for motion in scene.motions:
        _must(bool(np.isfinite(motion.start).all() and np.isfinite(motion.end).all()), "a motion")
        inside = 0 <= motion.first <= motion.first + motion.count <= scene.triangle_count
        _must(inside, "a motion of triangles that do not exist")


def _storable(value: float) -> bool:
    return math.isfinite(value) and abs(value) <= LARGEST


def _must(condition: bool, problem: str) -> None:
    if not condition:
        raise SilentlyWrong(problem)

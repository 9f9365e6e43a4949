"""Checks that a scene's arrays and numbers fit each other: kernels read them unchecked."""

from __future__ import annotations

from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import SceneError, check_kind
from lfcore.optics.camera import Camera
from lfcore.scene.appearance import Light, Material
from lfcore.scene.arrays import check_appearance, check_array, check_texture, check_triple
from lfcore.scene.baked import BakedLight

if TYPE_CHECKING:
    from lfcore.scene.model import Scene

PER_CORNER = {"normals": 3, "uvs": 2, "colours": 3}
"""The arrays that a scene may lack, with their numbers per corner."""


def check_scene(scene: Scene) -> None:
    """Raise :class:`SceneError` for an array of another shape or type, for triangles that are not
    finite, and for numbers of triangles, materials and textures that do not exist."""
    check_kind(scene.camera, Camera, "camera")
    check_array("triangles", scene.triangles, (None, 3, 3))
    count = len(scene.triangles)
    for name, width in PER_CORNER.items():
        array = getattr(scene, name)
        length = 0 if hasattr(array, "shape") and not len(array) else count
        check_array(name, array, (length, 3, width))
    for name in ("triangles", "normals"):
        if not np.isfinite(getattr(scene, name)).all():
            raise SceneError("are not finite", key=name, remedy="Leave the triangles out")
    check_kind(scene.floor, Material | None, "floor", "a Material")
    check_array("material_ids", scene.material_ids, (count,), "integers")
    check_numbers("material_ids", scene.material_ids, len(scene.every_material))
    for number, texture in enumerate(scene.textures):
        check_texture(f"textures[{number}]", texture)
    for number, material in enumerate(scene.every_material):
        _check_material(f"materials[{number}]", material, len(scene.textures))
    for number, light in enumerate(scene.lights):
        check_kind(light, Light, f"lights[{number}]")
        for name in ("vector", "colour", "normal"):
            check_triple(f"lights[{number}].{name}", getattr(light, name))
    for name in ("ambient", "background"):
        check_triple(name, getattr(scene, name))
    check_array("sky", scene.sky, (len(scene.sky), len(scene.sky), 3))
    for number, motion in enumerate(scene.motions):
        ends = np.array([motion.first, motion.first + motion.count])
        check_numbers(f"motions[{number}]", ends, count + 1)
    check_kind(scene.light, BakedLight | None, "light", "a BakedLight")
    if scene.light is not None:
        check_array("light.grids", scene.light.grids, (count, 3), "integers")


def _check_material(key: str, material: Material, textures: int) -> None:
    check_kind(material, Material, key)
    check_appearance(key, material)
    for name in ("texture", "metal_texture", "normal_texture", "emission_texture"):
        number = getattr(material, name)
        if not isinstance(number, Integral):
            raise SceneError(f"must be a whole number, not {number!r}", key=f"{key}.{name}")
        check_numbers(f"{key}.{name}", np.array([int(number)], object), textures, -1)


def check_numbers(key: str, numbers: np.ndarray, count: int, least: int = 0) -> None:
    """Raise :class:`SceneError` unless all are whole, from ``least`` to before ``count``."""
    whole = numbers.dtype.kind in "iuO"
    if whole and not len(numbers):
        return
    if not whole or numbers.min() < least or numbers.max() >= count:
        actual = f"{numbers.min()} to {numbers.max()}" if whole else repr(numbers.tolist()[:1])
        problem = f"must be whole numbers from {least} to {count - 1}, not {actual}"
        raise SceneError(problem, key=key)

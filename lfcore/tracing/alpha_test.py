"""The alpha of textures that cut holes into triangles or make them transparent, for the kernels."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from lfcore.scene.model import Scene
    from lfcore.scene.needs import Needs

ALPHA_TEST = np.dtype([
    ("u", np.float32, 4),  # of a point P on the triangle u = n . P + c: n, c
    ("v", np.float32, 4),
    ("offset", np.int32),  # of the picture in the alphas
    ("width", np.int32),
    ("height", np.int32),
    ("least", np.float32),  # the least alpha that is no hole, in codes; -1 without holes
])  # fmt: skip
"""The record of a triangle with holes, or of partial transparency."""
SLACK = 0.01
"""The tolerance of the test, in codes: far above the rounding errors of interpolation."""


def pack_alpha_tests(scene: Scene, needs: Needs) -> dict[str, np.ndarray]:
    """Arrays for ``traversal/alpha_test.cl``; all empty if no alpha is used.

    ``alpha_test_of`` (T,) int32 is the record of a triangle, -1 without alpha; ``alpha_tests`` (C,)
    ALPHA_TEST; ``alpha`` (A,) uint8, the pictures one after the other.
    """
    materials = scene.every_material
    blends = np.array([needs.specular and scene.has_alpha_blend(each) for each in materials], bool)
    tests = np.array([scene.has_alpha_test(each) for each in materials], bool)
    has_alpha = blends | tests
    if not has_alpha[scene.material_ids].any() and not needs.clear:
        empty: dict[str, Any] = {
            "alpha_test_of": np.int32,
            "alpha_tests": ALPHA_TEST,
            "alpha": np.uint8,
        }
        return {name: np.zeros(0, dtype) for name, dtype in empty.items()}
    numbers = np.flatnonzero(has_alpha[scene.material_ids])
    record_of = np.full(scene.triangle_count, -1, np.int32)
    record_of[numbers] = np.arange(len(numbers))
    offsets, pictures, at = {}, [], 0
    packed = np.zeros(len(materials), ALPHA_TEST)
    for number in np.flatnonzero(has_alpha).tolist():
        record, material = packed[number], materials[number]
        if material.texture not in offsets:
            picture = scene.textures[material.texture][..., 3]
            offsets[material.texture] = at
            pictures.append(picture.ravel())
            at += picture.size
        record["offset"] = offsets[material.texture]
        record["height"], record["width"] = scene.textures[material.texture].shape[:2]
        record["least"] = 255 * material.alpha_cutoff - SLACK if tests[number] else -1
    records = packed[scene.material_ids[numbers]]
    u, v = _coordinates(scene.triangles[numbers], scene.uvs[numbers])
    records["u"], records["v"] = u, v
    alpha = np.concatenate([np.zeros(0, np.uint8), *pictures])
    return {"alpha_test_of": record_of, "alpha_tests": records, "alpha": alpha}


def _coordinates(triangles: np.ndarray, uvs: np.ndarray) -> list[np.ndarray]:
    """For u, then v, (C, 4) float32 n and c: a point P on the triangle has u = n . P + c.

    Whole turns are taken off, so that c keeps its digits.
    """
    p, q, r = triangles.astype(np.float64).swapaxes(0, 1)
    a, b = q - p, r - p
    n = np.cross(a, b)
    along_a, along_b = np.cross(b, n), np.cross(n, a)
    area = (n**2).sum(1, keepdims=True)
    functions, most = [], np.finfo(np.float32).max
    for k in (0, 1):
        corner = uvs[..., k].astype(np.float64)
        rise = corner[:, 1:] - corner[:, :1]
        gradient = (rise[:, :1] * along_a + rise[:, 1:] * along_b) / area
        constant = corner[:, 0] - np.floor(corner[:, 0]) - (gradient * p).sum(1)
        affine = np.concatenate([gradient, constant[:, None]], 1)
        functions.append(np.clip(affine, -most, most).astype(np.float32))
    return functions

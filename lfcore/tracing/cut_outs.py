"""Triangles with holes, packed for the kernels: where the alpha of a texture cuts them out."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from lfcore.scene.model import Scene
    from lfcore.scene.needs import Needs

CUT_OUT = np.dtype([
    ("u", np.float32, 4),  # of a point P on the triangle u = n . P + c: n, c
    ("v", np.float32, 4),
    ("offset", np.int32),  # of the picture in the alphas
    ("width", np.int32),
    ("height", np.int32),
    ("least", np.float32),  # the least alpha that is no hole, in codes
])  # fmt: skip
"""The record of a triangle with holes."""
SLACK = 0.01
"""Of an alpha's code: what interpolation between equal texels rounds is far less."""


def pack_cut_outs(scene: Scene, needs: Needs) -> dict[str, np.ndarray]:
    """Arrays for ``traversal/cut_outs.cl``; all empty without cut-outs.

    ``cut_out_of`` (T,) int32 is the record of a triangle, -1 without holes; ``cut_outs`` (C,)
    CUT_OUT; ``alpha`` (A,) uint8, the pictures one after the other.
    """
    if not needs.cut_outs:
        empty: dict[str, Any] = {"cut_out_of": np.int32, "cut_outs": CUT_OUT, "alpha": np.uint8}
        return {name: np.zeros(0, dtype) for name, dtype in empty.items()}
    cut = np.array([scene.is_cut_out(material) for material in scene.every_material])
    numbers = np.flatnonzero(cut[scene.material_ids])
    of = np.full(scene.triangle_count, -1, np.int32)
    of[numbers] = np.arange(len(numbers))
    offsets, pictures, at = {}, [], 0
    for material in scene.every_material:
        if scene.is_cut_out(material) and material.texture not in offsets:
            picture = scene.textures[material.texture][..., 3]
            offsets[material.texture] = at
            pictures.append(picture.ravel())
            at += picture.size
    materials = np.zeros(len(scene.every_material), CUT_OUT)
    for record, material in zip(materials, scene.every_material, strict=True):
        if scene.is_cut_out(material):
            record["offset"] = offsets[material.texture]
            record["height"], record["width"] = scene.textures[material.texture].shape[:2]
            record["least"] = 255 * material.alpha_cutoff - SLACK
    records = materials[scene.material_ids[numbers]]
    u, v = _coordinates(scene.triangles[numbers], scene.uvs[numbers])
    records["u"], records["v"] = u, v
    alpha = np.concatenate([np.zeros(0, np.uint8), *pictures])
    return {"cut_out_of": of, "cut_outs": records, "alpha": alpha}


def _coordinates(triangles: np.ndarray, uvs: np.ndarray) -> list[np.ndarray]:
    """For u, then v, (C, 4) float32 n and c: a point P on the triangle has u = n . P + c.

    Whole turns are taken off, so that c keeps its digits.
    """
    p, q, r = triangles.astype(np.float64).swapaxes(0, 1)
    a, b = q - p, r - p
    n = np.cross(a, b)
    along_a, along_b = np.cross(b, n), np.cross(n, a)
    area = (n**2).sum(1, keepdims=True)
    found, most = [], np.finfo(np.float32).max
    for k in (0, 1):
        corner = uvs[..., k].astype(np.float64)
        rise = corner[:, 1:] - corner[:, :1]
        gradient = (rise[:, :1] * along_a + rise[:, 1:] * along_b) / area
        constant = corner[:, 0] - np.floor(corner[:, 0]) - (gradient * p).sum(1)
        affine = np.concatenate([gradient, constant[:, None]], 1)
        found.append(np.clip(affine, -most, most).astype(np.float32))
    return found

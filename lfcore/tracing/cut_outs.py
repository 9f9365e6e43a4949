"""Triangles with holes, packed for the kernels: where the alpha of a texture cuts them out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs

RECORD_WORDS = 12
SLACK = 0.01
"""Of an alpha's code: what interpolation between equal texels rounds is far less."""


@dataclass(frozen=True)
class CutOuts:
    """Arrays in the layout that ``traversal/cut_outs.cl`` reads; all empty without cut-outs.

    ``of`` (T,) int32 is the record of a triangle, -1 without holes; ``records`` (C, 12) float32;
    ``alpha`` (A,) uint8, the pictures one after the other.
    """

    of: np.ndarray
    records: np.ndarray
    alpha: np.ndarray


def pack_cut_outs(scene: Scene, needs: Needs) -> CutOuts:
    """What :func:`Needs.of` calls cut-outs."""
    if not needs.cut_outs:
        nothing = np.zeros(0, np.int32), np.zeros((0, RECORD_WORDS), np.float32)
        return CutOuts(*nothing, np.zeros(0, np.uint8))
    cut = np.array([scene.is_cut_out(material) for material in scene.materials])
    numbers = np.flatnonzero(cut[scene.material_ids])
    of = np.full(scene.triangle_count, -1, np.int32)
    of[numbers] = np.arange(len(numbers))
    offsets, pictures, at = {}, [], 0
    for material in scene.materials:
        if scene.is_cut_out(material) and material.texture not in offsets:
            picture = scene.textures[material.texture][..., 3]
            offsets[material.texture] = at
            pictures.append(picture.ravel())
            at += picture.size
    records = np.zeros((len(numbers), RECORD_WORDS), np.float32)
    records[:, :8] = _coordinate_forms(scene.triangles[numbers], scene.uvs[numbers])
    images = np.zeros((len(scene.materials), 4), np.int32)
    for entry, material in zip(images, scene.materials, strict=True):
        if scene.is_cut_out(material):
            height, width = scene.textures[material.texture].shape[:2]
            entry[:3] = offsets[material.texture], width, height
            entry[3:].view(np.float32)[0] = 255 * material.alpha_cutoff - SLACK
    records[:, 8:].view(np.int32)[:] = images[scene.material_ids[numbers]]
    return CutOuts(of, records, np.concatenate([np.zeros(0, np.uint8), *pictures]))


def _coordinate_forms(triangles: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """(C, 8) float32: of a place P on each triangle u = n . P + c, as n and c, and v likewise.

    Whole turns are taken off, so that c keeps its digits.
    """
    p, q, r = triangles.astype(np.float64).swapaxes(0, 1)
    a, b = q - p, r - p
    n = np.cross(a, b)
    along_a, along_b = np.cross(b, n), np.cross(n, a)
    area = (n**2).sum(1, keepdims=True)
    forms = []
    for k in (0, 1):
        corner = uvs[..., k].astype(np.float64)
        rise = corner[:, 1:] - corner[:, :1]
        gradient = (rise[:, :1] * along_a + rise[:, 1:] * along_b) / area
        constant = corner[:, 0] - np.floor(corner[:, 0]) - (gradient * p).sum(1)
        forms += [gradient, constant[:, None]]
    most = np.finfo(np.float32).max
    return np.clip(np.concatenate(forms, 1), -most, most).astype(np.float32)

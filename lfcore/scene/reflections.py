"""Notes on reflections that pictures lack: mirrors, glass and smooth coats alone show surfaces."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.scene.appearance import Material
from lfcore.scene.model import Scene
from lfcore.scene.needs import TRACED_ROUGHNESS, emitting_triangles
from lfcore.scene.notes import LEFT_OUT, Note

_SMOOTH = 0.5
"""The roughness below which one recognises what a surface reflects; up to
:data:`~lfcore.scene.needs.TRACED_ROUGHNESS` its pictures have it."""
_METAL = 0.5
"""The least ``metallic`` of a metal: more than half of its reflection is specular."""
_LEAST_SHARE = 0.1
"""The share of a material's texture that must be smooth: a few texels hardly show."""
_TEXEL_STEP = 8
"""Texels of a texture, per side, of which one is read: averages suffice."""
_MOST_NAMES = 3
"""The most materials that a note names."""


def with_reflection_notes(scene: Scene, file: str | Path) -> Scene:
    """Return the scene with notes on the reflections that its pictures lack.

    One note is on smooth metals near other things: nearer to the box around a metal than that is
    long.  The other one is on emitting surfaces, in a scene with smooth surfaces.
    """
    numbers, names = np.unique(scene.material_ids).tolist(), scene.every_material
    shares = {number: _smooth_shares(scene, names[number]) for number in numbers}
    metals = [n for n, (_, of_metal) in shares.items() if of_metal >= _LEAST_SHARE]
    emitters = np.unique(scene.material_ids[emitting_triangles(scene)]).tolist()
    glossy = [
        n for n, (smooth, _) in shares.items() if smooth >= _LEAST_SHARE and {*emitters} - {n}
    ]
    notes = []
    if near := _near_others(scene, metals):
        what = "reflections of things near metals ({}), which reflect sky and lights alone"
        notes.append(what.format(_named(names, near)))
    if glossy:
        what = "reflections of emitting surfaces ({}) in glossy ones ({})"
        notes.append(what.format(_named(names, emitters), _named(names, glossy)))
    found = (Note(LEFT_OUT, Path(file), 0, what) for what in notes)
    return replace(scene, notes=(*scene.notes, *found))


def _smooth_shares(scene: Scene, material: Material) -> tuple[float, float]:
    """Return the share of a material that is smooth, and the share that is smooth metal.

    Blinn-Phong's exponent s is a roughness of (2 / (s + 2))^(1/4); source: B. Walter et al.,
    "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007.
    """
    if not material.is_metallic:
        width = (2 / (max(material.shininess, 0) + 2)) ** 0.25
        is_coated = material.clearcoat > 0 and material.clearcoat_roughness <= TRACED_ROUGHNESS
        return float(any(material.specular) and width < _SMOOTH and not is_coated), 0.0
    texels = np.ones((1, 1, 3))
    if material.metal_texture >= 0 and len(scene.uvs):
        texels = scene.textures[material.metal_texture][::_TEXEL_STEP, ::_TEXEL_STEP] / 255
    roughness = material.roughness * texels[..., 1]
    smooth = (roughness > TRACED_ROUGHNESS) & (roughness < _SMOOTH)
    is_metal = material.metallic * texels[..., 2] >= _METAL
    return float(smooth.mean()), float((smooth & is_metal).mean())


def _near_others(scene: Scene, materials: list[int]) -> list[int]:
    """Return those of the materials whose triangles are near triangles of another material."""
    if not materials:
        return []
    p, q, r = scene.triangles.swapaxes(0, 1)
    low, high = np.minimum(np.minimum(p, q), r), np.maximum(np.maximum(p, q), r)
    found = []
    for number in materials:
        own = scene.material_ids == number
        start, end = low[own].min(0), high[own].max(0)
        reach = (end - start).max()
        near = ((low <= end + reach) & (high >= start - reach)).all(1)
        if (near & ~own).any():
            found.append(number)
    return found


def _named(materials: list[Material], numbers: list[int]) -> str:
    names = list(dict.fromkeys(materials[number].name for number in numbers))
    more = [f"{len(names) - _MOST_NAMES} more"] if len(names) > _MOST_NAMES else []
    return ", ".join([*names[:_MOST_NAMES], *more])

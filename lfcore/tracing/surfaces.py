"""A scene packed for the kernels: attributes, materials, lights, mipmapped textures."""

import itertools
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.baked import BakedLight
from lfcore.scene.limits import within_limits
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs, is_clear, is_specular
from lfcore.scene.sky_gloss import sky_gloss
from lfcore.tracing.layouts import (
    ALPHA_TESTS,
    BAKED_BIAS,
    BAKED_BITS,
    LIGHT,
    MATERIAL,
    MIP_LEVEL,
    MIP_LEVELS,
    PHYSICAL,
    TEXEL_BITS,
)

LEAST_HIGHLIGHT = 2.0**-24
"""The share of its peak below which a highlight is omitted: it would change no float near 1."""
UNEVEN = 0.08
"""The relative difference of baked light to the mean of opposite neighbours above which there are
no coarser levels."""


@dataclass(frozen=True)
class Surfaces:
    """Arrays of the records in :mod:`lfcore.tracing.layouts`, and the matching defines.

    ``lights`` has the lights without shadows, then the ``shadow_lights`` with shadows.
    ``clear_box`` (2, 3) is around the triangles that light passes.
    """

    corners: np.ndarray
    attributes: np.ndarray
    material_ids: np.ndarray
    materials: np.ndarray
    lights: np.ndarray
    mip_levels: np.ndarray
    texels: np.ndarray
    grids: np.ndarray
    baked_light: np.ndarray
    sky: np.ndarray
    shadow_lights: int
    clear_box: np.ndarray
    defines: dict[str, int]


def pack_surfaces(
    scene: Scene, needs: Needs, *, mipmaps: bool = True, left_out: Collection[str] = ()
) -> Surfaces:
    """Pack the features in ``needs``; arrays of other features are empty.

    Without ``mipmaps`` every texture has its finest level only.  ``left_out`` may name ``texels``
    and ``baked_light``, which are empty then.

    Raises :class:`SceneError` for a light, material or camera that float32 cannot hold.
    """
    within_limits(scene, scene.name)
    count = scene.triangle_count
    parts = [np.zeros((count, 0), np.float32)]
    if needs.smooth_normals:
        parts.append(scene.normals.reshape(count, 9))
    if needs.textures:
        parts.append(scene.uvs.reshape(count, 6))
    if needs.vertex_colours:
        parts.append(scene.colours.reshape(count, 9))
    shining = [light for light in scene.lights if any(light.colour)]
    lights = sorted(shining, key=lambda light: light.casts_shadows)
    data = {number for material in scene.every_material for number in material.data_textures}
    textures = scene.textures if needs.textures and "texels" not in left_out else []
    levels, texels = pack_textures(textures, MIP_LEVELS if mipmaps else 1, data)
    shadows = sum(light.casts_shadows for light in lights)
    materials = _pack_materials(scene)
    is_clear = (materials["clear"] > 0)[scene.material_ids] & needs.clear
    clear = scene.triangles[is_clear].reshape(-1, 3)
    light = None if "baked_light" in left_out else scene.light
    grids, values = with_levels(light) if light else ((), np.zeros((0, 3)))
    colours = scene.sky.reshape(-1, 3)  # followed by the maps of sky_gloss
    if len(colours) and (needs.rough or (needs.physical and scene.light is not None)):
        colours = np.concatenate([colours, sky_gloss(scene.sky)])
    return Surfaces(
        corners=np.ascontiguousarray(scene.triangles, np.float32),
        attributes=np.ascontiguousarray(np.concatenate(parts, axis=1), np.float32),
        material_ids=np.ascontiguousarray(scene.material_ids, np.int32),
        materials=materials,
        lights=_pack_lights(lights),
        mip_levels=levels,
        texels=texels,
        grids=np.ascontiguousarray(grids, np.int32),
        baked_light=pack_light(values),
        sky=np.concatenate([colours, np.zeros_like(colours[:, :1])], 1, dtype=np.float32),
        shadow_lights=shadows,
        clear_box=np.stack([clear.min(0), clear.max(0)]) if len(clear) else np.zeros((2, 3)),
        defines=macros_of(needs),
    )


def macros_of(needs: Needs) -> dict[str, int]:
    """The macros that programs for the features are built with."""
    return {
        "SMOOTH": int(needs.smooth_normals),
        "TEXTURES": needs.textures
        | ALPHA_TESTS * (needs.alpha_tests or needs.clear)
        | PHYSICAL * needs.physical,
        "VERTEX_COLOURS": int(needs.vertex_colours),
        "SHADOWS": int(needs.shadows),
        "CLEAR": int(needs.clear),
        "SPECULAR": int(needs.specular),
        "ROUGH": int(needs.rough),
        "BAKED": int(needs.baked),
        "SKY": int(needs.sky),
    }


def with_levels(light: BakedLight) -> tuple[np.ndarray, np.ndarray]:
    """The grids and their points.

    The coarser levels of a grid follow it, each with half the cells, until their number is odd.
    """
    grids, values, end = light.grids.copy(), [], 0
    for side in np.unique(grids[:, 2]).tolist():
        rows = np.flatnonzero(light.grids[:, 2] == side)
        first, grid_of = np.unique(light.grids[rows, :2], return_inverse=True)
        levels = [light.values[first[:, None] + np.arange((side + 1) * (side + 2) // 2)]]
        while side % 2 == 0:
            levels.append(_halved(levels[-1], side))
            side //= 2
        points = np.concatenate(levels, 1)
        grids[rows, :2] = end + points.shape[1] * grid_of.reshape(-1, 2)
        values.append(points.reshape(-1, 3))
        end += len(values[-1])
    return grids, np.concatenate(values)


def _halved(points: np.ndarray, side: int) -> np.ndarray:
    """Grids (G, P, 3) of half the cells.

    A point becomes the mean of itself and of the means of opposite neighbours in the triangle, so
    that edges depend only on their points.  It is infinite if one of these means differs much, as
    at the edge of a shadow.
    """
    i, j = np.array([(i, j) for j in range(0, side + 1, 2) for i in range(0, side + 1 - j, 2)]).T
    centres = points[:, j * (2 * side + 3 - j) // 2 + i]
    total, weight, even = 2 * centres, np.full((len(i), 1), 2.0), np.ones(centres.shape, bool)
    for di, dj in ((1, 0), (0, 1), (1, -1)):
        inside = (i >= di) & (j >= abs(dj)) & (i + j + (di + dj) <= side)
        pair = np.zeros_like(centres[:, inside])
        for sign in (-1, 1):
            a, b = (i + sign * di)[inside], (j + sign * dj)[inside]
            near = points[:, b * (2 * side + 3 - b) // 2 + a]
            pair += near / 2
        even[:, inside] &= pair <= (1 + UNEVEN) * centres[:, inside]
        even[:, inside] &= (1 - UNEVEN) * centres[:, inside] <= pair
        total[:, inside] += 2 * pair
        weight[inside] += 2
    return np.where(even.all(-1, keepdims=True), total / weight, np.inf).astype(np.float32)


def pack_light(values: np.ndarray) -> np.ndarray:
    """(P,) uint32 of linear RGB (P, 3): BAKED_BITS per channel, an exponent of BAKED_BIAS above.

    Source: OpenGL's EXT_texture_shared_exponent, 2004.
    """
    bits, bias, steps = BAKED_BITS, BAKED_BIAS, 2**BAKED_BITS
    values = np.clip(values, 0, (1 - 1 / steps) * 2.0 ** (bias + 1))
    rounded = values.max(-1, initial=0) * (2 * steps / (2 * steps - 1))
    exponent = np.frexp(rounded)[1].clip(-bias, bias + 1)
    codes = np.rint(np.ldexp(values, (bits - exponent)[:, None])).astype(np.uint32)
    codes <<= np.arange(3, dtype=np.uint32) * bits
    return np.bitwise_or.reduce(codes, axis=-1) | (exponent + bias).astype(np.uint32) << 3 * bits


def _pack_materials(scene: Scene) -> np.ndarray:
    packed = np.zeros(len(scene.every_material), MATERIAL)
    same = set(MATERIAL.names or ()) - {"specular_cutoff", "maps", "clear", "sends_on"}
    for row, m in zip(packed, scene.every_material, strict=True):
        for name in same:
            row[name] = getattr(m, name)
        row["specular_cutoff"] = LEAST_HIGHLIGHT ** (1 / m.shininess) if m.shininess > 0 else 0
        row["alpha_blend"] = scene.has_alpha_blend(m)
        row["clear"], row["sends_on"] = is_clear(scene, m), is_specular(scene, m)
        row["maps"] = m.texture, m.normal_texture, m.metal_texture, m.emission_texture
    return packed


def _pack_lights(lights: list[Light]) -> np.ndarray:
    packed = np.zeros(len(lights), LIGHT)
    for row, light in zip(packed, lights, strict=True):
        row["vector"], row["is_point"] = light.vector, light.kind == POINT
        row["colour"], row["reference_distance"] = light.colour, light.reference_distance_m
        row["normal"], row["triangles"] = light.normal, light.own
        row["visible"] = light.is_visible
        if light.is_spot:
            inner, outer = light.cone
            slope = np.float32(1 / max(inner - outer, 0.001))
            row["cone"] = slope, -outer * slope
    return packed


def pack_textures(
    textures: list[np.ndarray], limit: int = MIP_LEVELS, data: Collection[int] = ()
) -> tuple[np.ndarray, np.ndarray]:
    """Mip chains of up to ``limit`` levels of sRGB uint8 pictures (H, W, 3 or more) in one buffer.

    Returns the levels (textures, MIP_LEVELS) MIP_LEVEL and the ``texels`` uint32, the square roots
    of linear RGB in TEXEL_BITS each.  Levels are box-filtered in linear light.  Codes of the
    textures numbered in ``data`` are linear.
    """
    levels = np.zeros((len(textures), MIP_LEVELS), MIP_LEVEL)
    chunks, offset = [], 0
    for number, (entry, texture) in enumerate(zip(levels, textures, strict=True)):
        codes = np.arange(256, dtype=np.uint8)
        linear = (codes / 255 if number in data else srgb_decode(codes)).astype(np.float32)
        chain = itertools.islice(_mip_chain(texture[..., :3], linear), limit)
        for level, packed in enumerate(chain):
            height, width = packed.shape
            entry[level:] = offset, width, height, 0
            chunks.append(packed.ravel())
            offset += width * height
        entry["levels"] = level + 1
    return levels, np.concatenate(chunks) if chunks else np.zeros(0, np.uint32)


def _mip_chain(texture: np.ndarray, linear: np.ndarray) -> Iterator[np.ndarray]:
    """The texels of a uint8 picture (H, W, 3), then of its halves down to one texel; ``linear``
    (256,) float32 are the values of its codes."""
    import cv2  # loaded for textures alone

    yield _packed(_codes(linear)[texture])
    colours = cv2.LUT(np.ascontiguousarray(texture), linear)
    for _ in range(MIP_LEVELS - 1):
        height, width = colours.shape[:2]
        if height == width == 1:
            return
        size = max(width // 2, 1), max(height // 2, 1)
        colours = cv2.resize(colours, size, interpolation=cv2.INTER_AREA)
        yield _packed(_codes(colours))


def _codes(linear: np.ndarray) -> np.ndarray:
    """Linear values as uint32 codes of TEXEL_BITS."""
    most = (1 << TEXEL_BITS) - 1
    return np.rint(np.sqrt(np.clip(linear, 0, 1)) * most).astype(np.uint32)


def _packed(codes: np.ndarray) -> np.ndarray:
    """Codes (H, W, 3) of red, green and blue, side by side in one number."""
    return codes[..., 0] | codes[..., 1] << TEXEL_BITS | codes[..., 2] << 2 * TEXEL_BITS

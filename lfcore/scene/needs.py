"""The features of a scene: programs, buffers and jobs omit the others."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.appearance import POINT, Light, Material

if TYPE_CHECKING:
    from lfcore.scene.model import Scene

MOST_STOPS = 16
"""The most stops above white: sums of planes and stored light fields hold 2^16 times white."""
LEAST_ROUGHNESS = 0.05
"""The least roughness that is shaded: the highlight of a smoother surface falls between rays."""
DIELECTRIC = 0.04
"""The reflectance of dielectrics at normal incidence: an index of refraction of 1.5."""
MIRROR_ROUGHNESS = 0.03
"""The largest roughness of a plain mirror, whose rays leave in one direction."""
TRACED_ROUGHNESS = 0.3
"""The largest roughness of metal or of a coat whose reflections are traced."""
MOST_DISTANCES = 1 << 26
"""The most pairs of light and triangle whose distance is measured; beyond, lights count as near."""


def stops_above_white(scene: Scene) -> int:
    """The least number of stops above white, 0 to 16, that bounds the radiance of all rays.

    Highlights, near lights, vertex colours, the sky and baked light count with their maxima.
    """
    if scene.clip:
        return 0
    tint = float(scene.colours.max(initial=1.0)) if len(scene.colours) else 1.0
    arriving = sum(_arriving(scene, light) for light in scene.lights if any(light.colour))
    sky = float(scene.sky.max(initial=0.0))
    around = max(scene.ambient) if scene.light is None else float(scene.light.values.max(initial=0))
    around = max(around, sky)  # which metals reflect
    most = sky if len(scene.sky) else max(scene.background)
    for number in np.unique(scene.material_ids):
        m = scene.every_material[number]
        base = max(m.diffuse) * tint + (DIELECTRIC if m.is_metallic else 0.0)
        reflected = (around + arriving) * base + arriving * _highlight(m, base)
        most = max(most, max(m.emission) + reflected)
    most = min(most, 2.0**MOST_STOPS)
    return math.ceil(math.log2(most)) if most > 1 + 1e-6 else 0


def _highlight(material: Material, base: float) -> float:
    """The largest factor of a highlight, per irradiance."""
    if not material.is_metallic:
        return max(material.specular)
    # pi D V (N . L) of a microfacet is at most 1 / roughness^6.
    roughness = 0.0 if material.metal_texture >= 0 else material.roughness
    return max(base, 1.0) / max(roughness, LEAST_ROUGHNESS) ** 6


def _arriving(scene: Scene, light: Light) -> float:
    """The largest irradiance of a surface by a light; infinite at the position of a light that
    falls off."""
    strength = max(light.colour)
    if light.kind != POINT or not light.reference_distance_m:
        return strength
    if scene.motions or len(scene.triangles) * len(scene.lights) > MOST_DISTANCES:
        return math.inf
    low, high = scene.triangles.min(axis=1), scene.triangles.max(axis=1)
    away = np.maximum(np.maximum(low - light.vector, light.vector - high), 0.0)
    numbers = np.arange(len(away))
    distances = away[(numbers < light.own[0]) | (numbers >= light.own[1])]
    nearest = float((distances**2).sum(axis=1).min(initial=math.inf))
    return strength * light.reference_distance_m**2 / nearest if nearest else math.inf


FLAT_NORMALS = 1e-5
"""The least difference between the corners' normals of a curved triangle."""
AT_A_TIME = 1 << 16
"""The triangles that are searched for curves at a time: the first ones mostly have some."""


def emitting_triangles(scene: Scene) -> np.ndarray:
    """Return the mask (T,) of triangles that emit and are not part of a light."""
    emits = np.array([any(material.emission) for material in scene.every_material], bool)
    emitting = emits[scene.material_ids]
    for light in scene.lights:
        emitting[light.own[0] : light.own[1]] = False
    return emitting


@dataclass(frozen=True)
class Needs:
    """The features that affect a scene's picture.

    Attributes
    ----------
    textures, alpha_tests, smooth_normals, vertex_colours, shadows, baked, sky : bool
        Whether the scene has them.
    physical : bool
        Whether a material has metal and roughness, or textures beside its colour's.
    curved : bool
        Whether shadow rays start beside hit points, on curved surfaces.
    specular : bool
        Whether rays go on from a surface: see :func:`is_specular`.
    rough : bool
        Whether some of these surfaces are no plain mirrors.
    clear : bool
        Whether lights shine through a surface and tint its shadow: see :func:`is_clear`.
    stops : int
        The stops above white of the brightest ray.
    """

    textures: bool
    alpha_tests: bool
    physical: bool
    smooth_normals: bool
    curved: bool
    vertex_colours: bool
    shadows: bool
    baked: bool
    sky: bool
    specular: bool
    rough: bool
    clear: bool
    stops: int

    @classmethod
    def of(cls, scene: Scene) -> Needs:
        """The needs of a scene; unused materials and black lights do not count."""
        used = [scene.every_material[i] for i in np.unique(scene.material_ids).tolist()]
        casting = any(light.casts_shadows and any(light.colour) for light in scene.lights)
        return cls(
            textures=any(material.textures for material in used) and len(scene.uvs) > 0,
            alpha_tests=any(scene.has_alpha_test(material) for material in used),
            physical=any(material.is_metallic or material.has_maps for material in used),
            smooth_normals=len(scene.normals) > 0,
            curved=casting and _has_curves(scene),
            vertex_colours=len(scene.colours) > 0,
            shadows=casting,
            baked=scene.light is not None,
            sky=len(scene.sky) > 0,
            specular=any(is_specular(scene, material) for material in used),
            rough=any(is_rough(scene, material) for material in used),
            clear=casting and any(is_clear(scene, material) for material in used),
            stops=stops_above_white(scene),
        )


def is_metal(material: Material) -> bool:
    """Whether all that a material does is reflect, as metal of one roughness."""
    return material.metallic == 1 and material.metal_texture < 0 and material.opacity == 1


def is_specular(scene: Scene, material: Material) -> bool:
    """Whether rays go on from a material's surfaces: mirrored, refracted or straight through."""
    return (
        is_clear(scene, material)
        or (material.clearcoat > 0 and material.clearcoat_roughness <= TRACED_ROUGHNESS)
        or (material.is_metallic and _roughness(scene, material)[0] <= TRACED_ROUGHNESS)
    )


def is_rough(scene: Scene, material: Material) -> bool:
    """Whether reflections of a material are traced, but blurred."""
    least, most = _roughness(scene, material)
    base = material.is_metallic and least <= TRACED_ROUGHNESS and most > MIRROR_ROUGHNESS
    coat = MIRROR_ROUGHNESS < material.clearcoat_roughness <= TRACED_ROUGHNESS
    return (base and not material.transmission) or (coat and material.clearcoat > 0)


def is_clear(scene: Scene, material: Material) -> bool:
    """Whether light passes a material's surfaces."""
    return material.transmission > 0 or material.opacity < 1 or scene.has_alpha_blend(material)


def _roughness(scene: Scene, material: Material) -> tuple[float, float]:
    """The least and the largest roughness of a material."""
    if material.metal_texture < 0 or not len(scene.uvs):
        return material.roughness, material.roughness
    texels = scene.textures[material.metal_texture][..., 1]
    least, most = (material.roughness * int(end) / 255 for end in (texels.min(), texels.max()))
    return least, most


def _has_curves(scene: Scene) -> bool:
    """Whether a triangle of a curved material has unlike normals."""
    curved = np.array([material.curved for material in scene.every_material], bool)
    if not len(scene.normals) or not curved.any():
        return False
    for first in range(0, len(scene.normals), AT_A_TIME):
        part = slice(first, first + AT_A_TIME)
        normals = scene.normals[part][curved[scene.material_ids[part]]]
        if (np.abs(normals - normals[:, :1]) >= FLAT_NORMALS).any():
            return True
    return False


def check_exportable(scene: Scene, program: str, *, may_be_specular: bool = False) -> None:
    """Raise :class:`SceneError` for features that the exporter to ``program`` does not support.

    One that ``may_be_specular`` exports metal, glass without absorption, coats and veils.
    """
    needs = Needs.of(scene)
    used = [scene.every_material[number] for number in np.unique(scene.material_ids)]
    if may_be_specular:
        physical = any(m.has_maps or (m.is_metallic and not is_metal(m)) for m in used)
        specular = any(scene.has_alpha_blend(m) or any(m.absorption) for m in used)
    else:
        physical, specular = needs.physical, needs.specular
    for has_feature, subject in (
        (len(scene.colours), "colours at corners are"),
        (scene.motions, "motion is"),
        (needs.alpha_tests or physical, "holes, metal and bent normals are"),
        (specular, "glass, coats and transparency are"),
        (
            any(light.is_of_emitter or light.is_spot for light in scene.lights),
            "spots and points of area lights are",
        ),
    ):
        if has_feature:
            raise SceneError(f"{subject} not exported to {program}", file=scene.name)

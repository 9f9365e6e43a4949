"""A bound of the light that a scene's rays can bring."""

from __future__ import annotations

import math

import numpy as np

from lfcore.scene.appearance import POINT, Light, Material
from lfcore.scene.model import Scene

MOST_STOPS = 16
"""Sums of planes and stored light fields hold up to 2^16 times white."""
LEAST_ROUGHNESS, DIELECTRIC = 0.05, 0.04
"""As the kernels have them (tracing/kernels/shading/gloss.cl)."""
MOST_DISTANCES = 1 << 26
"""Distances of lights from triangles that are measured at most; with more, lights count as near."""


def stops_above_white(scene: Scene) -> int:
    """The least number of stops above white, 0 to 16, that no ray's radiance exceeds.

    0 of a scene that clips its light.  Highlights, near lights, vertex colours, the sky and baked
    light are counted at their most, each alone.
    """
    most = 1.0 if scene.clip else _brightest(scene)
    return min(MOST_STOPS, math.ceil(math.log2(most))) if most > 1 + 1e-6 else 0


def _brightest(scene: Scene) -> float:
    tint = float(scene.colours.max(initial=1.0)) if len(scene.colours) else 1.0
    arriving = sum(_arriving(scene, light) for light in scene.lights if any(light.colour))
    sky = float(scene.sky.max(initial=0.0))
    around = max(scene.ambient) if scene.light is None else float(scene.light.values.max(initial=0))
    around = max(around, sky)  # which metals reflect
    most = sky if len(scene.sky) else max(scene.background)
    for number in np.unique(scene.material_ids):
        m = scene.materials[number]
        base = max(m.diffuse) * tint + (DIELECTRIC if m.is_metallic else 0.0)
        reflected = (around + arriving) * base + arriving * _highlight(m, base)
        most = max(most, max(m.emission) + reflected)
    return min(most, 2.0**MOST_STOPS)


def _highlight(material: Material, base: float) -> float:
    """The most that a highlight adds to light that arrives."""
    if not material.is_metallic:
        return max(material.specular)
    # pi D V (N . L) of a microfacet is at most the roughness to the sixth power, inverse.
    roughness = 0.0 if material.metal_texture >= 0 else material.roughness
    return max(base, 1.0) / max(roughness, LEAST_ROUGHNESS) ** 6


def _arriving(scene: Scene, light: Light) -> float:
    """The most light that falls on a surface; infinite at a light that falls off."""
    strength = max(light.colour)
    if light.kind != POINT or not light.reference_distance_m:
        return strength
    if scene.motions or len(scene.triangles) * len(scene.lights) > MOST_DISTANCES:
        return math.inf
    low, high = scene.triangles.min(axis=1), scene.triangles.max(axis=1)
    away = np.maximum(np.maximum(low - light.vector, light.vector - high), 0.0)
    own = np.arange(len(away))
    others = away[(own < light.own[0]) | (own >= light.own[1])]
    nearest = float((others**2).sum(axis=1).min(initial=math.inf))
    return strength * light.reference_distance_m**2 / nearest if nearest else math.inf

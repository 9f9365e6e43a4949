"""Shading in float64, written as the formulas read: Blinn-Phong, and ``metal`` for the rest.

    colour = emission + ambient * diffuse, ambient that which was baked, where something was,
             + sum over lights in sight: strength * (diffuse * (N . L)
                                                     + specular * max(N . H, 0) ^ shininess)

A light is in sight of a point when N . L > 0 and, if it casts shadows, when no other triangle
lies between that is not the light's own.  Of curved materials the way to the light starts at
:func:`shadow_origins`.  Of a point of an emitter strength includes the cosine
there.  N is the interpolated normal turned towards the viewer, H halfway between L and the
direction to the viewer.  Textures are filtered bilinearly at full size: no mip levels.

Source: J. F. Blinn, "Models of light reflection for computer synthesized pictures", 1977.
"""

import numpy as np

from lfcore.oracle.intersect import Hits, closest_hits, occluded
from lfcore.oracle.metal import bent_normals, metals, reflected_sky
from lfcore.oracle.textures import Spots, solid_of
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.model import Scene
from lfcore.scene.sky import radiance as sky_radiance

# An occluder nearer than this share of the way touches the point: another triangle there.
TOUCHING = 1e-9
# Normals of corners that differ by less are those of a flat triangle.
FLAT_NORMALS = 1e-5


def radiance(scene: Scene, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(R, 3) float64 linear RGB seen along rays (R, 3) float32."""
    hits = closest_hits(scene.triangles, origins, directions, solid=solid_of(scene))
    return shade(scene, directions, hits)


def shade(scene: Scene, directions: np.ndarray, hits: Hits) -> np.ndarray:
    """(R, 3) float64 linear RGB of ``hits`` seen along ``directions`` (R, 3)."""
    colours = np.tile(np.array(scene.background, np.float64), (len(hits.triangle), 1))
    if len(scene.sky):
        colours = sky_radiance(scene.sky, directions).astype(np.float64)
    hit = np.flatnonzero(hits.triangle >= 0)
    if len(hit):
        view = -_unit(np.asarray(directions, np.float64)[hit])
        colours[hit] = _shade(Spots(scene, hits.triangle[hit], hits.weights[hit], view))
    return np.clip(colours, 0, 1 if scene.clip else 2.0**16)


def _shade(spots: Spots) -> np.ndarray:
    scene, view, point = spots.scene, spots.view, spots.interpolated(spots.scene.triangles)
    normal = normals(spots)
    start = shadow_origins(spots, point, normal)
    diffuse, specular, shininess = albedo(spots), *map(spots.of_material, ("specular", "shininess"))
    bent, metal = bent_normals(spots, normal), metals(spots, diffuse)
    is_metal = spots.of_material("metallic")[:, None] >= 0
    colour = spots.of_material("emission") * spots.sampled("emission_texture", encoded=True)
    around = surroundings(spots)
    of_metal = around * metal.surrounded()
    if len(scene.sky):
        of_metal = reflected_sky(scene, metal, around, bent, view)
    colour += np.where(is_metal, of_metal, around * diffuse)
    for light in scene.lights:
        towards, strength = arriving(light, point)
        cosine = (bent * towards).sum(1)
        half = _unit(towards + view)
        gloss = np.maximum((bent * half).sum(1), 0) ** shininess
        seen = (cosine > 0) & ((normal * towards).sum(1) > 0)
        if light.casts_shadows:
            seen &= ~_in_shadow(scene, light, start, spots.triangle)
        plain = diffuse * cosine[:, None] + specular * gloss[:, None]
        reflected = np.where(is_metal, metal.reflected(bent, towards, view), plain)
        colour += np.where(seen[:, None], strength * reflected, 0)
    return colour


def surroundings(spots: Spots) -> np.ndarray:
    """(R, 3) light from everywhere: ambient, or what was baked on the side of the viewer.

    Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
    """
    scene, weights = spots.scene, spots.weights
    if scene.light is None:
        return np.tile(np.array(scene.ambient, np.float64), (len(weights), 1))
    front = (spots.face_normals() * spots.view).sum(1) > 0
    of_front, of_back, side = scene.light.grids[spots.triangle].T
    first = np.where(front, of_front, of_back)
    x, y = weights[:, 1] * side, weights[:, 2] * side
    i = np.clip(np.floor(x), 0, side - 1).astype(int)
    j = np.clip(np.floor(y), 0, side - 1 - i).astype(int)
    f, g = x - i, y - j
    near = f + g <= 1
    one = 1 - near
    corners = ((i + one, j + one, abs(1 - f - g)), (i + 1, j, np.where(near, f, 1 - g)),
               (i, j + 1, np.where(near, g, 1 - f)))  # fmt: skip
    light = np.zeros((len(weights), 3))
    for column, row, share in corners:
        # Row j has R + 1 - j points.
        point = first + row * (side + 1) - row * (row - 1) // 2 + column
        light += share[:, None] * scene.light.values[np.minimum(point, len(scene.light.values) - 1)]
    return light


def normals(spots: Spots) -> np.ndarray:
    """(R, 3) unit normals on the viewer's side."""
    of_corners = spots.scene.normals
    normal = _unit(spots.interpolated(of_corners) if len(of_corners) else spots.face_normals())
    return np.where((normal * spots.view).sum(1, keepdims=True) < 0, -normal, normal)


def shadow_origins(spots: Spots, point: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(R, 3) where shadow rays start: on curved materials beside ``point`` (R, 3), on the mean of
    its places on the tangent planes of the corners that it is behind, seen from ``normal``.

    Source: J. Hanika, "Hacking the shadow terminator", Ray Tracing Gems II, chapter 4, 2021.
    """
    scene, triangle = spots.scene, spots.triangle
    if not len(scene.normals):
        return point
    of_corner = scene.normals[triangle].astype(np.float64)
    unlike = (np.abs(of_corner - of_corner[:, :1]) >= FLAT_NORMALS).any((1, 2))
    is_curved = (spots.of_material("curved") > 0) & unlike
    side = np.sign((of_corner.sum(1) * normal).sum(1))
    of_corner *= np.where(side < 0, -1.0, 1.0)[:, None, None]
    away = ((point[:, None] - scene.triangles[triangle]) * of_corner).sum(-1)
    moved = ((spots.weights * np.minimum(away, 0))[..., None] * of_corner).sum(1)
    return point - np.where(is_curved[:, None], moved, 0.0)


def albedo(spots: Spots) -> np.ndarray:
    """(R, 3) diffuse colour: material times texture times vertex colour."""
    colour = spots.of_material("diffuse") * spots.sampled("texture", encoded=True)
    of_corners = spots.scene.colours
    return colour * spots.interpolated(of_corners) if len(of_corners) else colour


def arriving(light: Light, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions to the light (R, 3) and its colour (R, 3) at ``point`` (R, 3)."""
    vector, colour = np.array(light.vector, np.float64), np.array(light.colour, np.float64)
    if light.kind != POINT:
        ones = np.ones((len(point), 1))
        return _unit(vector * ones), colour * ones
    away = vector - point
    # Zero at the light itself, whose direction is then zero, too.
    distance = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-150)
    fall_off = np.ones_like(distance)
    if light.reference_distance_m:
        fall_off = (light.reference_distance_m / distance) ** 2
    if any(light.normal):
        cosine = -(away / distance) @ np.array(light.normal, np.float64)
        if any(light.cone):
            inner, outer = light.cone
            cosine = np.clip((cosine - outer) / max(inner - outer, 0.001), 0, 1) ** 2
        fall_off *= np.maximum(cosine, 0)[:, None]
    return away / distance, colour * fall_off


def _in_shadow(scene: Scene, light: Light, point: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    vector = np.array(light.vector, np.float64)
    if light.kind == POINT:
        towards, until = vector - point, 1 - TOUCHING
        after = TOUCHING
    else:
        towards, until = np.tile(vector, (len(point), 1)), np.inf
        after = TOUCHING * np.linalg.norm(point, axis=1)
    first, end = light.own
    others = np.concatenate([np.arange(first), np.arange(end, len(scene.triangles))])
    # The numbers of the triangles that are left.
    own = (triangle >= first) & (triangle < end)
    left = np.where(own, -1, np.where(triangle >= end, triangle - (end - first), triangle))
    solid = solid_of(scene, others)
    return occluded(scene.triangles[others], point, towards, after=after, until=until,
                    exclude=left, solid=solid)  # fmt: skip


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

"""Shading in float64, directly by the formulas: Blinn-Phong, and ``metal`` for glTF's materials.

    colour = emission + (ambient or baked light) * diffuse
             + sum over visible lights: strength * (diffuse * (N . L)
                                                     + specular * max(N . H, 0) ^ shininess)

A light is visible from a point if N . L > 0 and, if it casts shadows, no triangle is between them
except the point's and the light's own.  On curved materials the shadow ray starts at
:func:`shadow_origins`.  The strength of an emitter's point includes the cosine at the emitter.  N
is the interpolated normal turned towards the viewer, H halfway between L and the direction to the
viewer.  Textures are filtered bilinearly at full size: no mip levels.

Source: J. F. Blinn, "Models of light reflection for computer synthesized pictures", 1977.
"""

from dataclasses import dataclass

import numpy as np

from lfcore.oracle.crossings import crosses_beside, crossings
from lfcore.oracle.intersect import Hits, closest_hits, occluded
from lfcore.oracle.metal import Metals, bent_normals, metals, reflected_sky
from lfcore.oracle.textures import Spots, solid_of
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.model import Scene
from lfcore.scene.needs import TRACED_ROUGHNESS, is_clear
from lfcore.scene.sky import radiance as sky_radiance

TOUCHING = 1e-9
"""The least distance of an occluder, as a share of the distance to the light: nearer triangles
touch the point."""
COAT = 1.5
"""The index of refraction of a clear coat."""
FLAT_NORMALS = 1e-5
"""The least difference between the corners' normals of a curved triangle."""


def radiance(scene: Scene, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(R, 3) float64 linear RGB radiance of rays (R, 3) float32."""
    hits = closest_hits(scene.triangles, origins, directions, solid=solid_of(scene))
    return shade(scene, directions, hits)


def shade(scene: Scene, directions: np.ndarray, hits: Hits) -> np.ndarray:
    """(R, 3) float64 linear RGB of the ``hits`` of rays in ``directions`` (R, 3)."""
    colours = np.tile(np.array(scene.background, np.float64), (len(hits.triangle), 1))
    if len(scene.sky):
        colours = sky_radiance(scene.sky, directions).astype(np.float64)
    hit = np.flatnonzero(hits.triangle >= 0)
    if len(hit):
        view = -_unit(np.asarray(directions, np.float64)[hit])
        colours[hit] = own_light(Spots(scene, hits.triangle[hit], hits.weights[hit], view))
    return np.clip(colours, 0, 1 if scene.clip else 2.0**16)


@dataclass(frozen=True)
class Traced:
    """What other rays bring to R points: their own light lacks it.

    ``mirrors`` and ``coats`` (R, 1) bool tell where the reflection of the base and of its coat is
    traced, and ``rough`` where their rays meet no suns; ``reflected`` (R, 1) what the base reflects
    before light is scattered below, and ``transmitted`` (R, 1) the share of that which is replaced
    by light from behind.
    """

    mirrors: np.ndarray
    coats: np.ndarray
    rough: np.ndarray
    reflected: np.ndarray
    transmitted: np.ndarray


def own_light(spots: Spots, traced: Traced | None = None) -> np.ndarray:
    """(R, 3) linear RGB of points by emission and diffuse reflection, highlights of lights and,
    unless they are ``traced``, reflections of the sky."""
    scene, view, point = spots.scene, spots.view, spots.interpolated(spots.scene.triangles)
    normal = normals(spots)
    start = shadow_origins(spots, point, normal)
    diffuse, specular, shininess = albedo(spots), *map(spots.of_material, ("specular", "shininess"))
    bent, metal = bent_normals(spots, normal), metals(spots, diffuse)
    is_metal = spots.of_material("metallic")[:, None] >= 0
    colour = spots.of_material("emission") * spots.sampled("emission_texture", encoded=True)
    colour += _of_surroundings(spots, metal, diffuse, bent, traced)
    matt = 1.0 if traced is None else 1 - traced.transmitted
    for light in scene.lights:
        towards, strength = arriving(light, point)
        cosine = (bent * towards).sum(1)
        half = _unit(towards + view)
        gloss = np.maximum((bent * half).sum(1), 0) ** shininess
        visible = (cosine > 0) & ((normal * towards).sum(1) > 0)
        if light.casts_shadows:
            visible &= ~_in_shadow(scene, light, start, spots.triangle)
            strength = strength * _tints(scene, light, start, spots.triangle)
        of_metal, shine_of_metal = metal.reflected(bent, towards, view)
        plain = np.where(is_metal, of_metal, diffuse * cosine[:, None])
        shine = np.where(is_metal, shine_of_metal, specular * gloss[:, None])
        if traced is not None and light.is_visible:  # to mirrored rays
            met = traced.mirrors | (traced.coats & ~is_metal)
            met = met & ~traced.rough if light.angular_radius else met
            shine = np.where(met, 0.0, shine)
        colour += np.where(visible[:, None], strength * (matt * plain + shine), 0)
    return colour


def _of_surroundings(
    spots: Spots, metal: Metals, diffuse: np.ndarray, bent: np.ndarray, traced: Traced | None
) -> np.ndarray:
    """(R, 3) reflection of ambient or baked light, and of the sky."""
    scene, around = spots.scene, surroundings(spots)
    is_metal = spots.of_material("metallic")[:, None] >= 0
    glossy = around * metal.surrounded()
    if len(scene.sky):
        glossy = reflected_sky(scene, metal, around, bent, spots.view)
    if traced is None:
        return np.where(is_metal, glossy, around * diffuse)
    matt = (1 - np.where(is_metal, metal.metal, 0)) * diffuse * (1 - traced.reflected)
    matt *= (1 - traced.transmitted) * around
    return np.where(is_metal & ~traced.mirrors, glossy, matt)


def surroundings(spots: Spots) -> np.ndarray:
    """(R, 3) ambient light, or the baked light on the viewer's side.

    Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
    """
    scene, weights = spots.scene, spots.weights
    if scene.light is None:
        return np.tile(np.array(scene.ambient, np.float64), (len(weights), 1))
    front = (spots.face_normals() * spots.view).sum(1) > 0
    front_points, back_points, side = scene.light.grids[spots.triangle].T
    first = np.where(front, front_points, back_points)
    x, y = weights[:, 1] * side, weights[:, 2] * side
    i = np.clip(np.floor(x), 0, side - 1).astype(int)
    j = np.clip(np.floor(y), 0, side - 1 - i).astype(int)
    f, g = x - i, y - j
    near = f + g <= 1
    upper = 1 - near
    corners = ((i + upper, j + upper, abs(1 - f - g)), (i + 1, j, np.where(near, f, 1 - g)),
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
    """(R, 3) origins of shadow rays.

    On curved materials ``point`` (R, 3) is offset to the weighted mean of its projections on the
    tangent planes of the corners that it is behind, on the side of ``normal``.

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
        per_point = np.ones((len(point), 1))
        return _unit(vector * per_point), colour * per_point
    away = vector - point
    # Zero at the light itself, with a direction of zero.
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
    towards, after, until = _way(light, point)
    first, end = light.own
    numbers = np.arange(len(scene.triangles))
    occludes = (numbers < first) | (numbers >= end)
    occludes &= ~_clear(scene)[scene.material_ids]
    occluders = np.flatnonzero(occludes)
    place = np.append(np.where(occludes, np.cumsum(occludes) - 1, -1), -1)
    solid = solid_of(scene, occluders)
    return occluded(scene.triangles[occluders], point, towards, after=after, until=until,
                    exclude=place[triangle], solid=solid)  # fmt: skip


def _way(light: Light, point: np.ndarray) -> tuple[np.ndarray, np.ndarray | float, float]:
    """Vectors (R, 3) to a light, and where on the way occluders are, from and until."""
    vector = np.array(light.vector, np.float64)
    if light.kind == POINT:
        return vector - point, TOUCHING, 1 - TOUCHING
    return np.tile(vector, (len(point), 1)), TOUCHING * np.linalg.norm(point, axis=1), np.inf


def _clear(scene: Scene) -> np.ndarray:
    """(M,) bool of materials that light passes."""
    return np.array([is_clear(scene, material) for material in scene.every_material], bool)


def _tints(scene: Scene, light: Light, point: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """(R, 3) shares of a light that reach points straight through clear surfaces.

    Volumes absorb light between where it enters and where it leaves.
    """
    tints, absorbed = np.ones((len(point), 3)), np.zeros((len(point), 3))
    clear = np.flatnonzero(_clear(scene)[scene.material_ids])
    clear = clear[(clear < light.own[0]) | (clear >= light.own[1])]
    if not len(clear):
        return tints
    towards, after, until = _way(light, point)
    after, length = np.broadcast_to(after, len(point)), np.linalg.norm(towards, axis=1)
    for pairs in crossings(scene.triangles[clear], point, towards, near=0.0):
        number = clear[pairs.triangle]
        on = pairs.inside & (pairs.t > after[pairs.ray]) & (pairs.t < until)
        on &= number != triangle[pairs.ray]
        on[on] = crosses_beside(
            scene.triangles[number[on]], point[pairs.ray[on]], towards[pairs.ray[on]],
            pairs.weights[on],
        )  # fmt: skip
        ray, number, t = pairs.ray[on], number[on], pairs.t[on]
        if not len(ray):
            continue
        unit = towards[ray] / length[ray, None]
        spots = Spots(scene, number, pairs.weights[on], unit)
        shares, signs = _passing(spots)
        np.multiply.at(tints, ray, shares)
        rates = np.array([m.absorption for m in spots.materials]).reshape(-1, 3)
        np.add.at(absorbed, ray, signs * rates * (t * length[ray])[:, None])
    return tints * np.exp(-np.maximum(absorbed, 0))


def _passing(spots: Spots) -> tuple[np.ndarray, np.ndarray]:
    """Shares (R, 3) that pass surfaces; and -1 where volumes begin, 1 where they end, (R, 1)."""
    number = spots.of_material
    plane = _unit(spots.face_normals())
    slant = (plane * spots.view).sum(1)
    sharp = fresnel(np.abs(slant), 1 / number("ior"))
    glass = np.where(number("thin_walled") > 0, 2 * sharp / (1 + sharp), sharp)
    smooth = number("clearcoat_roughness") <= TRACED_ROUGHNESS
    shield = number("clearcoat") * smooth * fresnel(np.abs(slant), np.full(len(slant), 1 / COAT))
    base, opacity = albedo(spots), spots.opacity()
    metal = np.maximum(metals(spots, base).metal[:, 0], 0)
    through = (1 - shield) * (1 - metal) * number("transmission") * (1 - glass)
    shares = opacity * through[:, None] * base + 1 - opacity
    volume = (number("transmission") > 0) & (number("thin_walled") == 0)
    return shares, (volume * np.where(slant < 0, -1.0, 1.0))[:, None]


def fresnel(cosine: np.ndarray, eta: np.ndarray) -> np.ndarray:
    """Reflectance of smooth dielectrics for unpolarised light; ``eta`` is the index in front over
    that behind, and the cosine that in front."""
    cosine = np.clip(cosine, 0, 1)
    behind = np.sqrt(np.maximum(1 - eta**2 * (1 - cosine**2), 0))
    across = (eta * cosine - behind) / np.maximum(eta * cosine + behind, 1e-300)
    along = (cosine - eta * behind) / np.maximum(cosine + eta * behind, 1e-300)
    total = eta**2 * (1 - cosine**2) >= 1
    return np.where(eta == 1, 0.0, np.where(total, 1.0, (across**2 + along**2) / 2))


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

"""Light of rays that mirrors, glass, coats and veils send on, in float64: the reference.

At a hit, a share of the light is that of the surface itself (``shading.own_light``); the rest comes
along a mirrored ray, and along a ray that passes: refracted into or out of a volume, straight
through thin walls and in proportion to 1 - opacity.

    own = a (1 - K) (diffuse (1 - metal) (1 - F) (1 - transmission) + highlights + emission)
    mirrored = a (K + (1 - K) R)
    passed = a (1 - K) (1 - metal) transmission base (1 - F) + 1 - a

a is the opacity, K the clear coat's strength times its reflectance, F the exact reflectance of the
dielectric, and R = (1 - metal) F + metal (base + (1 - base) (1 - cosine)^5).  K and R are 0 where
they are rough; glass is always smooth.  Both faces of a thin wall reflect 2 F / (1 + F).  Radiance
is not scaled by squared indices, as shadows and baked light pass glass straight.

A ray remembers the last two volumes that it entered.  It enters at fronts and leaves at backs; at
the back of a volume that it is not in, and where opacity is 0, nothing happens.  A ray that passes
starts a rounding error early, so that it meets both of two coincident faces, but, within that
error, no triangle of the same material that faces the same side: a neighbour that it met on an
edge.

A path splits at its first two events.  At further ones, it leaves volumes, or else follows the
stronger ray, with the weight of both: grazing rays would be reflected within a ball to the end.
The surface after ``MOST_EVENTS`` is matt: it reflects light of its surroundings instead.

Metal and coats of more roughness than a plain mirror's are facets, of which a ray meets one: by two
numbers that it has from its lens sample and pixel, with the chance by which facets are seen.  Its
weight is the reflectance of this facet times the chance that light leaves it unhindered.  Where
base and coat are both mirrors, it meets one of them, by their shares.

Source: B. Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007, for
F and the facets; J. Dupuy and A. Benyoub, "Sampling visible GGX normals with spherical caps", HPG
2023; Khronos, KHR_materials_transmission, _volume and _clearcoat, for the shares.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from differentials_reference import Differentials, dot, normal_bends

from lfcore.oracle.intersect import Hits, closest_hits
from lfcore.oracle.metal import bent_normals, metals
from lfcore.oracle.shading import COAT, TOUCHING, Traced, albedo, fresnel, normals, own_light
from lfcore.oracle.textures import Spots, solid_of
from lfcore.scene.model import Scene
from lfcore.scene.needs import MIRROR_ROUGHNESS, TRACED_ROUGHNESS
from lfcore.scene.sky import radiance as sky_radiance
from lfcore.scene.surface_mesh import face_normals

MOST_EVENTS, SPLITS = 8, 2
NEAREST = 4.0
"""The largest virtual inverse depth, in inverse depths of the first surface: rays near a focus of
curved glass have any."""
MOST_HITS = 64
"""The most hits of a path, with those at which nothing happens."""


@dataclass(frozen=True)
class Paths:
    """What R rays see: light (R, 3), and inverse depth (R,) at which it appears, 1 / m.

    ``own`` is the first surface's light, or the sky's, and ``specular`` all that is seen by it, at
    the depth of the strongest part.  ``cut`` is the mean weight that took another way than its own.
    """

    own: np.ndarray
    own_inverse_depth: np.ndarray
    specular: np.ndarray
    inverse_depth: np.ndarray
    cut: np.ndarray


@dataclass(frozen=True)
class Rays:
    """Rays on their way.

    ``number`` (R,) is the first ray's, ``weight`` (R, 3) what it gets of their light, ``events``
    (R,) and ``hits`` (R,) what they met, ``media`` (R, 2) the materials of the volumes they are in,
    the last one first, and ``last`` (R, 2) the triangles they met last; -1 is none.  ``passes``
    (R,) bool are those that did not turn back at the last one.  ``numbers`` (R, 2) uint32 choose
    facets; they are multiplied by 5 from event to event.
    """

    number: np.ndarray
    origin: np.ndarray
    direction: np.ndarray
    moves: Differentials
    weight: np.ndarray
    events: np.ndarray
    hits: np.ndarray
    media: np.ndarray
    last: np.ndarray
    passes: np.ndarray
    numbers: np.ndarray

    def some(self, mask: np.ndarray, **changes: np.ndarray) -> Rays:
        rows: Any = {name: value[mask] for name, value in vars(self).items() if name != "moves"}
        return Rays(moves=self.moves.some(mask), **{**rows, **changes})


def trace_paths(
    scene: Scene,
    origins: np.ndarray,
    directions: np.ndarray,
    delta: float,
    most_events: int = MOST_EVENTS,
    numbers: np.ndarray | None = None,
) -> Paths:
    """Follow rays of a camera, (R, 3) each; z of the directions is 1.

    ``numbers`` (R, 2) uint32 are those of :func:`ray_numbers`, or any.
    """
    count, directions = len(origins), np.asarray(directions, np.float64)
    none = np.zeros(count, int)
    rays = Rays(
        np.arange(count), np.asarray(origins, np.float64), _unit(directions),
        Differentials.of_camera(directions, delta), np.ones((count, 3)), none, none,
        np.full((count, 2), -1), np.full((count, 2), -1), none > 0,
        np.zeros((count, 2), np.uint32) if numbers is None else numbers,
    )  # fmt: skip
    out = _Collected(scene, delta, count)
    while len(rays.number):
        rays = _step(scene, rays, out, most_events)
    return out.paths()


def ray_numbers(
    origins: np.ndarray, directions: np.ndarray, lens_pitch: float, pixel_pitch: float, bits: int
) -> np.ndarray:
    """(R, 2) uint32 of rays of a slab with 2^bits lens samples per axis, at most 8.

    A lens sample (i, j) and a pixel (u, v) give u its stratum of 8: first the last bits of u, then
    those of i + 2 j, the last one first.  What follows is a lattice in the four numbers.
    """
    pitches, rays = np.float32([lens_pitch, pixel_pitch]), (origins, directions)
    lens, pixel = (np.floor(np.float32(ray)[:, :2] / pitch + np.float32(0.25)).astype(np.int64)
                   for ray, pitch in zip(rays, pitches, strict=True))  # fmt: skip
    mixed, fields = lens + 2 * lens[:, ::-1], np.zeros_like(lens)
    for bit in range(bits):
        fields += (mixed >> bit & 1) << bits - 1 - bit
    fields += (pixel & (1 << 3 - bits) - 1) << bits
    turned = [np.stack([each[:, 1], -each[:, 0]], 1) for each in (pixel, lens)]
    lattice = 3242174889 * pixel + 2447445414 * turned[0] + 1640531527 * lens
    lattice += 1013904223 * turned[1]
    return (fields * 2**29 + lattice % 2**32 // 8).astype(np.uint32)


class _Collected:
    """Light that arrived, by ray: part 0 is that of first surfaces, part 1 what they show."""

    def __init__(self, scene: Scene, delta: float, count: int):
        self.delta, self.most = delta, 1.0 if scene.clip else 2.0**16
        self.light, self.depths = np.zeros((2, count, 3)), np.zeros((2, count))
        self.strongest, self.cut = np.zeros((2, count)), np.zeros(count)

    def add(self, rays: Rays, light: np.ndarray, share: np.ndarray, at_end: np.ndarray) -> None:
        """Add the light (R, 3) of rays, of which a ``share`` (R, 3) ends here: at surfaces where
        ``at_end`` (R,)."""
        matrices = rays.moves.inverse_depths(rays.direction, self.delta, at_end)
        depths, strength = np.trace(matrices, axis1=1, axis2=2) / 2, (rays.weight * share).mean(1)
        place = (rays.events > 0).astype(int), rays.number  # several times the same
        np.add.at(self.light, place, rays.weight * light)
        np.maximum.at(self.strongest, place, strength)
        wins = (strength == self.strongest[place]) & ((strength > 0) | (rays.events == 0))
        self.depths[place[0][wins], place[1][wins]] = depths[wins]

    def paths(self) -> Paths:
        own, specular = np.clip(self.light, 0, self.most)
        first = np.maximum(self.depths[0], 0)
        most = np.where(first > 0, NEAREST * first, np.inf)
        virtual = np.clip(np.nan_to_num(self.depths[1], nan=0.0, neginf=0.0), 0, most)
        return Paths(own, first, specular, virtual, self.cut)


@dataclass(frozen=True)
class _Events:
    """What surfaces do with R rays.

    ``coated`` (R, 1) is the coat's share of ``mirrored``, ``reflect`` gives both shares at other
    cosines, and ``widths`` (R, 2) are the squared roughness of base and coat; 0 is a plain mirror.
    """

    own: np.ndarray
    traced: Traced
    mirrored: np.ndarray
    passed: np.ndarray
    bent: np.ndarray
    eta: np.ndarray
    media: np.ndarray
    coated: np.ndarray
    reflect: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
    widths: np.ndarray


def _step(scene: Scene, rays: Rays, out: _Collected, most_events: int) -> Rays:
    """Let rays meet their next surfaces; return those that go on."""
    hits = _next_hits(scene, rays)
    missed = hits.triangle < 0
    far = _far(scene, rays.direction[missed])
    out.add(rays.some(missed), far, np.ones_like(far), np.zeros(len(far), bool))
    met = ~missed
    if not met.any():
        return rays.some(met)
    rays, t, triangle = rays.some(met), hits.t[met], hits.triangle[met]
    spots = Spots(scene, triangle, hits.weights[met], -rays.direction)
    plane = spots.face_normals()
    absorption = np.array([(0.0,) * 3, *(m.absorption for m in scene.every_material)])
    moved = replace(
        rays,
        origin=rays.origin + t[:, None] * rays.direction,
        moves=rays.moves.moved(t, rays.direction, plane),
        weight=rays.weight * np.exp(-absorption[rays.media[:, 0] + 1] * np.maximum(t, 0)[:, None]),
        hits=rays.hits + 1,
        last=np.stack([triangle, rays.last[:, 0]], 1),
    )
    front = dot(plane, rays.direction)[:, 0] < 0
    left = rays.media == scene.material_ids[triangle][:, None]
    volume = _volumes(spots)
    nothing = (volume & ~front & ~left[:, 0]) | (spots.opacity()[:, 0] == 0)
    idle = moved.some(
        nothing,
        media=_removed(rays.media, left & volume[:, None])[nothing],
        passes=nothing[nothing],
    )
    idle = idle.some(idle.hits < MOST_HITS)
    there = ~nothing
    if not there.any():
        return idle
    return _joined(
        [idle, *_meet(moved.some(there), spots.some(there), front[there], out, most_events)]
    )


def _next_hits(scene: Scene, rays: Rays) -> Hits:
    touching = TOUCHING * np.linalg.norm(rays.origin, axis=1)
    after, ignored = np.where(rays.passes, -touching, touching), rays.last[:, :1]
    planes = np.concatenate([face_normals(scene.triangles), np.zeros((1, 3))])
    while True:
        hits = closest_hits(
            scene.triangles, rays.origin, rays.direction, after=after, exclude=ignored,
            solid=solid_of(scene),
        )  # fmt: skip
        met, before = hits.triangle, ignored[:, 0]
        facing = [dot(planes[number], rays.direction)[:, 0] for number in (met, before)]
        neighbour = scene.material_ids[met] == scene.material_ids[before]
        neighbour &= facing[0] * facing[1] > 0
        again = (met >= 0) & (hits.t < touching) & (neighbour | (met == rays.last[:, 1]))
        if not again.any():
            return hits
        ignored = np.concatenate([ignored, np.where(again, hits.triangle, -1)[:, None]], 1)


def _meet(
    rays: Rays, spots: Spots, front: np.ndarray, out: _Collected, most_events: int
) -> list[Rays]:
    """Add the own light of surfaces; return the rays that go on."""
    plane = _unit(spots.face_normals()) * np.where(front, 1.0, -1.0)[:, None]
    normal = bent_normals(spots, normals(spots))
    events = _events(spots, rays, normal, front)
    goes_on = (np.maximum(events.mirrored, events.passed) > 0).any(1)
    ends = goes_on & (rays.events >= most_events)
    plain, on = ~goes_on | ends, goes_on & ~ends
    if plain.any():
        light = own_light(spots.some(plain))
        out.add(rays.some(plain), light, np.ones_like(light), np.ones(len(light), bool))
    if on.any():
        traced = Traced(**{name: value[on] for name, value in vars(events.traced).items()})
        light = events.own[on] * own_light(spots.some(on), traced)
        share = 1 - events.mirrored[on] - events.passed[on]
        out.add(rays.some(on), light, share, np.ones(len(light), bool))
    facet, events = _meet_facets(rays, normal, events)
    weights = rays.weight[:, None] * np.stack([events.mirrored, events.passed], 1)  # (R, 2, 3)
    strength = weights.mean(2)
    leaves = _volumes(spots) & ~front & (strength[:, 1] > 0)
    single, chosen = rays.events >= SPLITS, np.where(leaves, 1, strength.argmax(1))
    other = np.where(chosen, strength[:, 0], strength[:, 1])
    lost = np.where(ends, strength.sum(1), np.where(single, other, 0))
    np.add.at(out.cut, rays.number, lost)
    bends, children = normal_bends(spots, rays.moves.point, normal), []
    for way, send in enumerate((_mirrored, _passed)):
        goes = on & (strength[:, way] > 0) & (~single | (chosen == way))
        weight = np.where(single[:, None], weights.sum(1), weights[:, way])
        direction, moves = send(rays, normal if way else facet, plane, bends, events)
        media = events.media if way else rays.media
        changed = replace(
            rays, direction=direction, moves=moves, weight=weight, media=media,
            events=rays.events + 1, passes=np.full(len(media), way == 1),
            numbers=rays.numbers * np.uint32(5),
        )  # fmt: skip
        children.append(changed.some(goes))
    return children


def _events(spots: Spots, rays: Rays, normal: np.ndarray, front: np.ndarray) -> _Events:
    number = spots.of_material
    base, opacity = albedo(spots), spots.opacity()
    surface, physical = metals(spots, base), number("metallic")[:, None] >= 0
    metal = np.where(physical, surface.metal, 0.0)
    transmitted = number("transmission")[:, None]
    mirrors = (transmitted > 0) | (physical & (surface.roughness <= TRACED_ROUGHNESS))
    rough_coat = number("clearcoat_roughness")[:, None]
    coat = number("clearcoat")[:, None] * (rough_coat <= TRACED_ROUGHNESS)
    eta, media = _indices(spots, rays, front)
    cosine = -dot(rays.direction, normal)
    thin = number("thin_walled")[:, None] > 0

    def glass_at(cosine: np.ndarray) -> np.ndarray:
        sharp = fresnel(cosine[:, 0], eta)[:, None]
        return np.where(thin & (transmitted > 0), 2 * sharp / (1 + sharp), sharp)

    def coat_at(cosine: np.ndarray) -> np.ndarray:
        return coat * fresnel(cosine[:, 0], np.full(len(cosine), 1 / COAT))[:, None]

    glass, shield = glass_at(cosine), coat_at(cosine)

    def reflect(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reflected = (1 - metal) * glass_at(at) + metal * (base + (1 - base) * (1 - at) ** 5)
        return opacity * (1 - shield) * np.where(mirrors, reflected, 0.0), opacity * coat_at(at)

    of_base, coated = reflect(cosine)
    mirrored = of_base + coated
    rough = surface.roughness * ((transmitted == 0) & mirrors), rough_coat * (coat > 0)
    widths = np.hstack([np.where(each > MIRROR_ROUGHNESS, each, 0.0) ** 2 for each in rough])
    through = (1 - metal) * transmitted * base * (1 - glass)
    return _Events(
        own=opacity * (1 - shield),
        traced=Traced(
            mirrors,
            coat > 0,
            widths.any(1, keepdims=True),
            np.where(mirrors, glass, 0.0),
            transmitted,
        ),
        mirrored=mirrored,
        passed=opacity * (1 - shield) * through + 1 - opacity,
        bent=_volumes(spots),
        eta=eta,
        media=media,
        coated=coated,
        reflect=reflect,
        widths=widths,
    )


def _meet_facets(rays: Rays, normal: np.ndarray, events: _Events) -> tuple[np.ndarray, _Events]:
    """The normals (R, 3) that mirror, and the events with what these reflect."""
    rough = events.widths.any(1)
    if not rough.any():
        return normal, events
    first, second = rays.numbers.T / 2.0**32
    chance = (events.coated[:, 0] / np.maximum(events.mirrored.mean(1), 1e-30)).clip(0, 1)
    of_coat = second < chance
    share = np.maximum(np.where(of_coat, chance, 1 - chance), 1e-30)
    width = np.where(of_coat, events.widths[:, 1], events.widths[:, 0])
    facet = visible_facets(
        normal, -rays.direction, width, first, (second - np.where(of_coat, 0, chance)) / share
    )
    seen = -dot(rays.direction, facet)
    base, coat = events.reflect(seen)
    away = dot(rays.direction + 2 * seen * facet, normal)[:, 0]
    shown = np.where(of_coat[:, None], coat, base) * (unhidden(away, width) / share)[:, None]
    rough = rough[:, None]
    return np.where(rough, facet, normal), replace(
        events, mirrored=np.where(rough, shown, events.mirrored)
    )


def unhidden(cosine: np.ndarray, width: np.ndarray) -> np.ndarray:
    """The share of facets that nothing hides in directions of a cosine: Smith's, 0 from behind."""
    tangent2 = 1 / np.maximum(cosine, 1e-30) ** 2 - 1
    return np.where(cosine > 0, 2 / (1 + np.sqrt(1 + width**2 * np.maximum(tangent2, 0))), 0.0)


def visible_facets(
    normal: np.ndarray, view: np.ndarray, width: np.ndarray, first: np.ndarray, second: np.ndarray
) -> np.ndarray:
    """(R, 3) unit normals of facets that are seen from ``view``, by numbers (R,) from 0 to 1."""
    n = np.where(normal[:, 2:] < 0, -1.0, 1.0)[:, 0]
    x, y, z = normal.T
    frame = np.stack([
        np.stack([1 - n * x * x / (n + z), -n * x * y / (n + z), -n * x], 1),
        np.stack([-x * y / (n + z), n - y * y / (n + z), -y], 1), normal,
    ], 1)  # fmt: skip
    stretch = np.stack([width, width, np.ones_like(width)], 1)
    above = _unit(np.einsum("rij,rj->ri", frame, view) * stretch)
    height = 1 - second * (1 + above[:, 2])
    radius, turn = np.sqrt(np.maximum(1 - height**2, 0)), 2 * np.pi * first
    cap = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], 1)
    return _unit(np.einsum("ri,rij->rj", (cap + above) * stretch, frame))


def _indices(spots: Spots, rays: Rays, front: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(R,) index in front over that behind, and the volumes (R, 2) behind."""
    iors = np.array([1.0, *(material.ior for material in spots.scene.every_material)])
    number = spots.scene.material_ids[spots.triangle].astype(int)
    inner, volume = iors[number + 1], _volumes(spots)
    entered = np.stack([number, rays.media[:, 0]], 1)
    left = _removed(rays.media, rays.media == number[:, None])
    around = np.where(front, iors[rays.media[:, 0] + 1], iors[left[:, 0] + 1])
    ratio = np.where(front, around / inner, inner / around)
    media = np.where(front[:, None], entered, left)
    return np.where(volume, ratio, 1 / inner), np.where(volume[:, None], media, rays.media)


def _removed(media: np.ndarray, which: np.ndarray) -> np.ndarray:
    """The volumes without the first one of ``which`` (R, 2)."""
    kept = media.copy()
    kept[which[:, 0]] = np.stack([media[:, 1], np.full(len(media), -1)], 1)[which[:, 0]]
    kept[~which[:, 0] & which[:, 1], 1] = -1
    return kept


def _volumes(spots: Spots) -> np.ndarray:
    """(R,) bool of points on the surface of a volume of glass."""
    return (spots.of_material("transmission") > 0) & (spots.of_material("thin_walled") == 0)


Sent = tuple[np.ndarray, Differentials]
"""Directions and differentials."""


def _mirrored(
    rays: Rays, normal: np.ndarray, plane: np.ndarray, bends: np.ndarray, events: _Events
) -> Sent:
    def by(normal: np.ndarray) -> np.ndarray:
        return rays.direction - 2 * dot(rays.direction, normal) * normal

    # A smooth normal may send a ray into the triangle that it came from: the flat one does not.
    inward = dot(by(normal), plane) <= 0
    normal, bends = np.where(inward, plane, normal), np.where(inward[..., None], 0.0, bends)
    return by(normal), rays.moves.mirrored(rays.direction, normal, bends)


def _passed(
    rays: Rays, normal: np.ndarray, plane: np.ndarray, bends: np.ndarray, events: _Events
) -> Sent:
    eta = np.where(events.bent, events.eta, 1.0)

    def by(normal: np.ndarray) -> np.ndarray:
        cosine = -dot(rays.direction, normal)
        behind = np.sqrt(np.maximum(1 - eta[:, None] ** 2 * (1 - cosine**2), 0))
        return eta[:, None] * rays.direction + (eta[:, None] * cosine - behind) * normal

    outward = dot(by(normal), plane) >= 0
    normal, bends = np.where(outward, plane, normal), np.where(outward[..., None], 0.0, bends)
    moves = rays.moves.refracted(rays.direction, normal, bends, eta)
    straight = eta == 1
    moves = Differentials(
        moves.point, np.where(straight[:, None, None], rays.moves.direction, moves.direction)
    )
    return np.where(straight[:, None], rays.direction, _unit(by(normal))), moves


def _far(scene: Scene, directions: np.ndarray) -> np.ndarray:
    """(R, 3) light of rays that meet nothing."""
    if len(scene.sky):
        return sky_radiance(scene.sky, directions).astype(np.float64)
    return np.tile(np.array(scene.background, np.float64), (len(directions), 1))


def _joined(parts: list[Rays]) -> Rays:
    columns = {name: [vars(part)[name] for part in parts] for name in vars(parts[0])}
    moves = columns.pop("moves")
    point, direction = (np.concatenate([getattr(m, name) for m in moves])
                        for name in ("point", "direction"))  # fmt: skip
    return Rays(
        moves=Differentials(point, direction),
        **{name: np.concatenate(values) for name, values in columns.items()},
    )


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)

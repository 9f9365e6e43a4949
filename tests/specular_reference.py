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

Source: B. Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007, for
F; Khronos, KHR_materials_transmission, _volume and _clearcoat, for the shares.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from differentials_reference import Differentials, dot, normal_bends

from lfcore.oracle.intersect import Hits, closest_hits
from lfcore.oracle.metal import bent_normals, metals
from lfcore.oracle.shading import COAT, TOUCHING, Traced, albedo, fresnel, normals, own_light
from lfcore.oracle.textures import Spots, solid_of
from lfcore.scene.model import Scene
from lfcore.scene.needs import MIRROR_ROUGHNESS
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
    (R,) bool are those that did not turn back at the last one.
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

    def some(self, mask: np.ndarray, **changes: np.ndarray) -> Rays:
        rows: Any = {name: value[mask] for name, value in vars(self).items() if name != "moves"}
        return Rays(moves=self.moves.some(mask), **{**rows, **changes})


def trace_paths(
    scene: Scene,
    origins: np.ndarray,
    directions: np.ndarray,
    delta: float,
    most_events: int = MOST_EVENTS,
) -> Paths:
    """Follow rays of a camera, (R, 3) each; z of the directions is 1."""
    count, directions = len(origins), np.asarray(directions, np.float64)
    none = np.zeros(count, int)
    rays = Rays(
        np.arange(count), np.asarray(origins, np.float64), _unit(directions),
        Differentials.of_camera(directions, delta), np.ones((count, 3)), none, none,
        np.full((count, 2), -1), np.full((count, 2), -1), none > 0,
    )  # fmt: skip
    out = _Collected(scene, delta, count)
    while len(rays.number):
        rays = _step(scene, rays, out, most_events)
    return out.paths()


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
    """What surfaces do with R rays."""

    own: np.ndarray
    traced: Traced
    mirrored: np.ndarray
    passed: np.ndarray
    bent: np.ndarray
    eta: np.ndarray
    media: np.ndarray


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
        direction, moves = send(rays, normal, plane, bends, events)
        media = events.media if way else rays.media
        changed = replace(
            rays, direction=direction, moves=moves, weight=weight, media=media,
            events=rays.events + 1, passes=np.full(len(media), way == 1),
        )  # fmt: skip
        children.append(changed.some(goes))
    return children


def _events(spots: Spots, rays: Rays, normal: np.ndarray, front: np.ndarray) -> _Events:
    number = spots.of_material
    base, opacity = albedo(spots), spots.opacity()
    surface, physical = metals(spots, base), number("metallic")[:, None] >= 0
    metal = np.where(physical, surface.metal, 0.0)
    transmitted = number("transmission")[:, None]
    mirrors = (transmitted > 0) | (physical & (surface.roughness <= MIRROR_ROUGHNESS))
    coat = (
        number("clearcoat")[:, None] * (number("clearcoat_roughness") <= MIRROR_ROUGHNESS)[:, None]
    )
    eta, media = _indices(spots, rays, front)
    cosine = -dot(rays.direction, normal)
    sharp = fresnel(cosine[:, 0], eta)[:, None]
    thin = number("thin_walled")[:, None] > 0
    glass = np.where(thin & (transmitted > 0), 2 * sharp / (1 + sharp), sharp)
    reflected = (1 - metal) * glass + metal * (base + (1 - base) * (1 - cosine) ** 5)
    reflected = np.where(mirrors, reflected, 0.0)
    shield = coat * fresnel(cosine[:, 0], np.full(len(cosine), 1 / COAT))[:, None]
    mirrored = opacity * (shield + (1 - shield) * reflected)
    through = (1 - metal) * transmitted * base * (1 - glass)
    return _Events(
        own=opacity * (1 - shield),
        traced=Traced(mirrors, coat > 0, np.where(mirrors, glass, 0.0), transmitted),
        mirrored=mirrored,
        passed=opacity * (1 - shield) * through + 1 - opacity,
        bent=_volumes(spots),
        eta=eta,
        media=media,
    )


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

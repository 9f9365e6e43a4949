"""Rays that gather light at points: their directions, and what they see."""

import math
from functools import cache

import numpy as np

from lfcore.baking.points import GOLDEN, Points, dot, extent, shuffled
from lfcore.colour import srgb_decode
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.model import Scene
from lfcore.scene.sky import radiance, suns
from lfcore.tracing.tracer import Tracer

BATCH = 1 << 19
"""Rays at a time."""
TURNS = 4096
# Steps of the additive recurrence R2, of 2^32: M. Roberts, "The unreasonable effectiveness of
# quasirandom sequences", 2018.
R2 = tuple(round(2**32 / 1.32471795724474602596**power) for power in (1, 2))
_TEXELS = 64
"""Side of the textures that reflected light is coloured by, at most."""
_DIELECTRIC = 0.04
_LENS = (0, 0), (0.7, 0.7), (-0.7, 0.7), (0.7, -0.7), (-0.7, -0.7)
ALONG = np.float32(1e-5)
_NEAR, _ASLANT = 1 / 512, 4.0
"""The distance that counts as nearby, as a share of the scene's size: across the surface; along a
ray it is longer by the second number."""
FIELD = 1.05
"""The part of the camera's field where light is as good as is asked for."""


@cache
def circle() -> np.ndarray:
    """(2, TURNS) float32 cosines and sines, which every processor rounds alike."""
    turns = np.arange(TURNS) * (2 * math.pi / TURNS)
    return np.stack([np.cos(turns), np.sin(turns)]).astype(np.float32)


def samples(seeds: np.ndarray, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Two (P, count) float64 in ]0, 1[: a low-discrepancy sequence from ``first`` on, shifted for
    each point by its seed."""
    number = np.arange(first, first + count, dtype=np.uint64)
    shift = shifts(seeds)
    a, b = (
        (number * np.uint64(step) + shift[:, k, None]) & np.uint64(0xFFFFFFFF)
        for k, step in enumerate(R2)
    )
    return (a + 0.5) * 2.0**-32, (b + 0.5) * 2.0**-32


def shifts(seeds: np.ndarray) -> np.ndarray:
    """(P, 2) uint32 by which the samples of a point's two sequences are shifted, of 2^32."""
    mixed = shuffled((seeds.astype(np.uint64) + np.uint64(1)) * GOLDEN)
    return np.stack([mixed, mixed >> np.uint64(32)], -1).astype(np.uint32)


def directions(points: Points, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(P, n, 3) float32 directions, as dense as the cosine to the normal, of samples (P, n)."""
    share = a.astype(np.float32)
    cosine, sine = circle()[:, (b * TURNS).astype(np.int64)]
    radius, up = np.sqrt(share), np.sqrt(1 - share)
    n = points.normals[:, None]
    # The frame of T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    sign = np.copysign(np.float32(1), n[..., 2])
    one = -1 / (sign + n[..., 2])
    two = n[..., 0] * n[..., 1] * one
    x, y = radius * cosine, radius * sine
    return np.stack(
        [
            x * (1 + sign * n[..., 0] ** 2 * one) + y * two + up * n[..., 0],
            x * (sign * two) + y * (sign + n[..., 1] ** 2 * one) + up * n[..., 1],
            -x * sign * n[..., 0] - y * n[..., 1] + up * n[..., 2],
        ],
        -1,
    )


def mean_colour(a: np.ndarray) -> np.ndarray:
    """The mean of red, green and blue (..., 3); numpy's own takes several times as long."""
    return (a[..., 0] + a[..., 1] + a[..., 2]) / 3


class Surroundings:
    """What rays of a scene's points see: the sky, and what surfaces glow with and reflect."""

    def __init__(self, scene: Scene, tracer: Tracer):
        self.scene, self.tracer = scene, tracer
        self.sky = suns(scene.sky)[0] if len(scene.sky) else None
        p, q, r = scene.triangles.swapaxes(0, 1)
        flat = np.cross(q - p, r - p)
        self.unit = flat / np.sqrt(dot(flat, flat))[:, None]
        self._near = _NEAR * extent(scene.triangles)[1]
        self._lift = np.float32(2e-6 * np.abs(scene.triangles).max(initial=0))
        self.small = [_reduced(texture) for texture in scene.textures]
        self.rays = 0
        self.lens = scene.camera.lens_radius_m * np.array(_LENS)
        # Their points are lights already.
        self._lamps = np.zeros(scene.triangle_count, bool)
        for light in scene.lights:
            self._lamps[light.own[0] : light.own[1]] = True
        self._materials()
        glows = self.emission.max(1, initial=0) > 0
        self.emits = glows[scene.material_ids] & ~self._lamps

    def _materials(self) -> None:
        materials, has = self.scene.materials, len(self.scene.uvs)
        self.diffuse = np.array([m.diffuse for m in materials], np.float32).reshape(-1, 3)
        self.emission = np.array([m.emission for m in materials], np.float32).reshape(-1, 3)
        metal = [
            max(m.metallic, 0.0)
            * (self.small[m.metal_texture][..., 2].mean() if m.metal_texture >= 0 < has else 1.0)
            for m in materials
        ]
        # As the kernels reflect ambient light: diffuse, and specular as at normal incidence.
        parts = zip(materials, metal, strict=True)
        self.base = [_DIELECTRIC * (1 - share) * m.is_metallic for m, share in parts]

    def hits(self, points: Points, towards: np.ndarray) -> tuple[np.ndarray, ...]:
        """As :meth:`cast` of rays (P, n, 3) from points."""
        of = np.repeat(np.arange(len(points)), towards.shape[1])
        towards = towards.reshape(-1, 3)
        return self.cast(self.starts(points, of, towards), towards)

    def starts(self, points: Points, of: np.ndarray | slice, towards: np.ndarray) -> np.ndarray:
        """(R, 3) float32 starts of rays of points ``of``: off the triangle, on the side to which
        the ray goes.  A bent normal lets rays go to the back, too."""
        lift, flat = self.lifts(points)[of], points.flat[of]
        lift = np.where(dot(flat, towards) < -ALONG, -lift, lift)
        return points.places[of] + lift[:, None] * flat

    def lifts(self, points: Points) -> np.ndarray:
        """(P,) how far off its triangle a point's rays start, metres."""
        return np.maximum(self._lift, np.float32(1e-4) * points.cells.astype(np.float32))

    def flat_of(self, faces: np.ndarray) -> np.ndarray:
        """(F, 3) unit normals of the triangles, on the side of faces."""
        return self.unit[faces // 2] * np.array([1, -1], np.float32)[faces % 2, None]

    def covered(self, points: Points) -> np.ndarray:
        """(P,) whether a surface nearby hides a point from the whole lens.  Such a point is behind
        or below an object that touches its surface, and has not the light beside that object."""
        hidden, within = np.arange(len(points)), np.minimum(points.cells, self._near)
        for at in self.lens:
            some = points.of(hidden)
            towards = np.append(at, 0).astype(np.float32) - some.places
            length = np.sqrt(dot(towards, towards))
            faces, _, far = self.cast(self.starts(some, slice(None), towards), towards)
            far, limit = np.where(faces < 0, 0, far * length), within[hidden]
            cosine = dot(self.unit[faces // 2], towards) / length
            near = (far < _ASLANT * limit) & (far * abs(cosine) < limit)
            hidden = hidden[(faces >= 0) & near]
        return np.isin(np.arange(len(points)), hidden)

    def in_view(self, places: np.ndarray) -> np.ndarray:
        """(P,) whether places (P, 3) are in the camera's field or a little beside it, as seen from
        some point of the lens."""
        camera, (x, y, depth) = self.scene.camera, places.T
        spread = camera.lens_radius_m * abs(1 - depth / camera.focus_m)
        half = FIELD * camera.field_width / 2 * depth + spread
        return (depth > 0) & (abs(x) <= half) & (abs(y) <= half)

    def cast(self, origins: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, ...]:
        """Faces (R,) that rays (R, 3) hit, -1 none; barycentric weights (R, 3), distances (R,)."""
        triangle, distance, weights = self.tracer.closest_hit(origins, towards)
        self.rays += len(origins)
        behind = dot(self.unit[triangle], towards) > 0
        faces = np.where(triangle < 0, -1, 2 * triangle.astype(np.int64) + behind)
        return faces, np.where((triangle < 0)[:, None], 0, weights), distance

    def glow(self, faces: np.ndarray, weights: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """(R, 3) what the sky and glowing surfaces send back along rays."""
        light = np.zeros((len(faces), 3), np.float32)
        if self.sky is not None:
            out = faces < 0
            light[out] = radiance(self.sky, towards[out])
        triangle = faces // 2
        material = self.scene.material_ids[triangle]
        on = np.flatnonzero((faces >= 0) & self.emits[triangle])
        if len(on):
            kinds = np.array([m.emission_texture for m in self.scene.materials])
            light[on] = self.emission[material[on]]
            light[on] *= self._texels(kinds, triangle[on], weights[on])
        return light

    def _texels(
        self, kinds: np.ndarray, triangle: np.ndarray, weights: np.ndarray
    ) -> np.ndarray | float:
        """Colours of the textures ``kinds`` of materials at hits; 1 without."""
        if not len(self.scene.uvs) or (kinds < 0).all():
            return 1.0
        number = kinds[self.scene.material_ids[triangle]]
        found = np.ones((len(triangle), 3), np.float32)
        for texture in np.unique(number[number >= 0]).tolist():
            rows = np.flatnonzero(number == texture)
            corners, small = self.scene.uvs[triangle[rows]], self.small[texture]
            uv = sum(weights[rows, k, None] * corners[:, k] for k in range(3))
            size = np.array(small.shape[1::-1])
            at = np.clip(((uv - np.floor(uv)) * size).astype(np.int64), 0, size - 1)
            found[rows] = small[size[1] - 1 - at[:, 1], at[:, 0]]
        return found

    def direct(self, points: Points) -> np.ndarray:
        """(P, 3) light of the scene's lights on points."""
        total = np.zeros((len(points), 3), np.float32)
        for light in self.scene.lights:
            if any(light.colour):
                total += self._of_light(light, points)
        return total

    def _of_light(self, light: Light, points: Points) -> np.ndarray:
        vector = np.array(light.vector, np.float32)
        towards = (
            vector - points.places if light.kind == POINT else np.tile(vector, (len(points), 1))
        )
        distance = np.sqrt(dot(towards, towards))
        unit = towards / distance[:, None]
        strength = np.maximum(dot(unit, points.normals), 0)
        if light.kind == POINT and light.reference_distance_m:
            strength *= (np.float32(light.reference_distance_m) / distance) ** 2
        if any(light.normal):
            cosine = -dot(unit, np.array(light.normal, np.float32))
            if light.is_spot:
                inner, outer = light.cone
                cosine = np.clip((cosine - outer) / max(inner - outer, 0.001), 0, 1) ** 2
            strength *= np.maximum(cosine, 0)
        lit = np.flatnonzero(strength > 0)
        if light.casts_shadows and len(lit):
            start = self.starts(points, lit, unit[lit])
            triangle, far, _ = self.tracer.closest_hit(start, towards[lit])
            self.rays += len(lit)
            own = (triangle >= light.own[0]) & (triangle < light.own[1])
            dark = (triangle >= 0) & ~own & ((far < 1) | (light.kind != POINT))
            strength[lit[dark]] = 0
        return strength[:, None] * np.array(light.colour, np.float32)


def _reduced(texture: np.ndarray) -> np.ndarray:
    """A texture's colours in linear light, shrunk to at most _TEXELS a side."""
    import cv2  # loaded for textures alone

    linear = srgb_decode(texture[..., :3])
    height, width = linear.shape[:2]
    size = min(width, _TEXELS), min(height, _TEXELS)
    return cv2.resize(linear, size, interpolation=cv2.INTER_AREA)

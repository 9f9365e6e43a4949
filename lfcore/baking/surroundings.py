"""What gather rays see: sky, emission, reflectance, and the scene's lights."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from lfcore.baking.mesh_colours import Points
from lfcore.colour import srgb_decode
from lfcore.opencl.device import Device
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.arrays import dot
from lfcore.scene.baked import NO_SKY
from lfcore.scene.limits import MOST_ATTENUATION, SMALLEST_LENGTH
from lfcore.scene.model import Scene
from lfcore.scene.needs import emitting_triangles
from lfcore.scene.sky import suns
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.given_rays import HitSurfaces, RayHits
from lfcore.tracing.tracer import Tracer

_TEXELS = 64
"""The largest side of textures that colour reflected light, texels: averages suffice."""
_LENS_POINTS = (0, 0), (0.7, 0.7), (-0.7, 0.7), (0.7, -0.7), (-0.7, -0.7)
"""Lens points from which visibility is tested, shares of the lens radius."""
ALONG_SURFACE = np.float32(1e-5)
"""The cosine to the triangle's normal below which a ray starts behind the triangle."""
_LEAST_LIFT = 2e-6
"""The least distance of a ray's start from its triangle, a share of the largest coordinate: 16 ulp
of float32."""
_LIFT_PER_CELL = 1e-4
"""The distance of a ray's start from its triangle, a share of a cell: it covers interpolation
errors and is too small to see."""
_NEAR = 1 / 512
"""The distance across a surface below which an occluder is near, a share of the picture's width
there: about a pixel."""
_ASLANT = 4.0
"""Along a ray, near is this many times as far."""
FIELD = 1.05
"""The part of the camera's field of view, per side, where irradiance has the required error."""


def mean_colour(a: np.ndarray) -> np.ndarray:
    """Return the mean of red, green and blue of (..., 3); numpy's takes several times as long."""
    return (a[..., 0] + a[..., 1] + a[..., 2]) / 3


class FaceHits(NamedTuple):
    """The hits of rays.

    Attributes
    ----------
    faces : (R,) the faces; -1 for a miss.
    weights : (R, 3) barycentric weights; 0 for a miss.
    distances : (R,) in units of the rays' directions.
    """

    faces: np.ndarray
    weights: np.ndarray
    distances: np.ndarray


class Surroundings:
    """What rays from a scene's points see.

    Attributes
    ----------
    sky : (S, S, 3) the octahedral map without its suns, or None.
    suns : the lights that replace suns.
    tracer : traces the scene without lights, normal maps and smooth normals.
    unit : (T, 3) unit normals of the triangles, in front.
    emits : (T,) whether a triangle emits, and is not part of a light.
    lens : (n, 2) lens points from which visibility is tested, metres.
    rays : the number of rays traced so far.
    """

    def __init__(self, scene: Scene, bvh: Bvh, device: Device):
        self.scene = scene
        self.sky: np.ndarray | None = None
        self.suns: list[Light] = []
        if len(scene.sky):
            self.sky, self.suns = suns(scene.sky)
        self.tracer = Tracer(_matt(scene, self.sky), bvh, device)
        p, q, r = scene.triangles.swapaxes(0, 1)
        flat = np.cross(q - p, r - p)
        self.unit = flat / np.sqrt(dot(flat, flat))[:, None]
        self._least_lift = np.float32(_LEAST_LIFT * np.abs(scene.triangles).max(initial=0))
        self.rays = 0
        self.lens = scene.camera.lens_radius_m * np.array(_LENS_POINTS)
        self.emits = emitting_triangles(scene)

    def hits(self, points: Points, towards: np.ndarray) -> FaceHits:
        """Trace rays (P, n, 3) from points."""
        owners = np.repeat(np.arange(len(points)), towards.shape[1])
        towards = towards.reshape(-1, 3)
        return self.cast(self.starts(points, owners, towards), towards)

    def starts(self, points: Points, owners: np.ndarray | slice, towards: np.ndarray) -> np.ndarray:
        """Return the starts (R, 3), float32, of rays from points ``owners``: off the triangle, on
        the side to which the ray goes.  With a bent normal, that side can be the back."""
        lift, flat = self.lifts(points)[owners], points.flat[owners]
        lift = np.where(dot(flat, towards) < -ALONG_SURFACE, -lift, lift)
        return points.places[owners] + lift[:, None] * flat

    def lifts(self, points: Points) -> np.ndarray:
        """Return the distances (P,) of the rays' starts from the points' triangles, metres."""
        per_cell = np.float32(_LIFT_PER_CELL) * points.cells.astype(np.float32)
        return np.maximum(self._least_lift, per_cell)

    def flat_of(self, faces: np.ndarray) -> np.ndarray:
        """Return the unit normals (F, 3) of the triangles, on the side of faces."""
        return self.unit[faces // 2] * np.array([1, -1], np.float32)[faces % 2, None]

    def covered(self, points: Points) -> np.ndarray:
        """Return the mask (P,) of points that a near surface hides from the whole lens.  Such a
        point is below an object that touches its surface, and is darker than the surface beside
        that object."""
        near = _NEAR * self.scene.camera.field_width * np.maximum(points.places[:, 2], 0)
        hidden, within = np.arange(len(points)), np.minimum(points.cells, near)
        for lens_point in self.lens:
            tested = points.take(hidden)
            towards = np.append(lens_point, 0).astype(np.float32) - tested.places
            length = np.sqrt(dot(towards, towards))
            faces, _, far = self.cast(self.starts(tested, slice(None), towards), towards)
            far, limit = np.where(faces < 0, 0, far * length), within[hidden]
            cosine = dot(self.unit[faces // 2], towards) / length
            near = (far < _ASLANT * limit) & (far * abs(cosine) < limit)
            hidden = hidden[(faces >= 0) & near]
        return np.isin(np.arange(len(points)), hidden)

    def in_view(self, places: np.ndarray) -> np.ndarray:
        """Return the mask (P,) of places (P, 3) in the camera's field, or a little beside it, as
        seen from some point of the lens."""
        camera, (x, y, depth) = self.scene.camera, places.T
        spread = camera.lens_radius_m * abs(1 - depth / camera.focus_m)
        half = FIELD * camera.field_width / 2 * depth + spread
        return (depth > 0) & (abs(x) <= half) & (abs(y) <= half)

    def cast(self, origins: np.ndarray, towards: np.ndarray) -> FaceHits:
        """Trace rays (R, 3)."""
        triangle, distance, weights = self.tracer.closest_hit(origins, towards)
        self.rays += len(origins)
        behind = dot(self.unit[triangle], towards) > 0
        faces = np.where(triangle < 0, -1, 2 * triangle.astype(np.int64) + behind)
        return FaceHits(faces, np.where((triangle < 0)[:, None], 0, weights), distance)

    def surfaces(self, origins: np.ndarray, towards: np.ndarray) -> tuple[RayHits, HitSurfaces]:
        """Trace rays (R, 3); returns their hits, and the surfaces there: their emission, or the
        light of the sky, and what they reflect."""
        self.rays += len(origins)
        hits = self.tracer.closest_hit(origins, towards)
        return hits, self.tracer.hit_surfaces(origins, towards, hits, normals=False)

    def emitted(self, faces: np.ndarray, weights: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Return the radiance (R, 3) that sky and emitters send back along rays that hit ``faces``
        at ``weights`` (R, 3)."""
        triangle, weights = np.where(faces < 0, -1, faces // 2), weights.astype(np.float32)
        hits = RayHits(triangle.astype(np.int32), np.zeros(len(faces), np.float32), weights)
        rays = np.zeros_like(towards), towards
        light = self.tracer.hit_surfaces(*rays, hits, normals=False).emission
        light[(faces >= 0) & ~self.emits[triangle]] = 0
        return light

    def of_lights(self, points: Points, lights: list[Light] | None = None) -> np.ndarray:
        """Return the irradiance over pi (P, 3) from lights; by default the scene's."""
        total = np.zeros((len(points), 3), np.float32)
        for light in self.scene.lights if lights is None else lights:
            if any(light.colour):
                total += self._of_light(light, points)
        return total

    def _of_light(self, light: Light, points: Points) -> np.ndarray:
        vector = np.array(light.vector, np.float32)
        towards = (
            vector - points.places if light.kind == POINT else np.tile(vector, (len(points), 1))
        )
        distance = np.maximum(np.sqrt(dot(towards, towards)), np.float32(SMALLEST_LENGTH))
        unit = towards / distance[:, None]  # zero at the light itself
        strength = np.maximum(dot(unit, points.normals), 0)
        if light.kind == POINT and light.reference_distance_m:
            nearness = (np.float32(light.reference_distance_m) / distance) ** 2
            strength *= np.minimum(nearness, np.float32(MOST_ATTENUATION))
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


def _matt(scene: Scene, sky: np.ndarray | None) -> Scene:
    """The scene as gather rays see it: matt, with small textures, lit by nothing but its sky."""
    whole = {m.texture for m in scene.every_material if scene.has_alpha_test(m)}
    data = {number for m in scene.every_material for number in m.data_textures}
    textures = [
        texture if number in whole else _reduced(texture, number in data)
        for number, texture in enumerate(scene.textures)
    ]
    matt = [replace(material, normal_texture=-1) for material in scene.every_material]
    count = len(scene.materials)
    return replace(
        scene, bake=None, light=None, lights=[], background=(0.0, 0.0, 0.0),
        sky=NO_SKY if sky is None else sky, normals=scene.normals[:0], textures=textures,
        materials=matt[:count], floor=matt[count] if scene.floor else None,
    )  # fmt: skip


def _reduced(texture: np.ndarray, is_data: bool) -> np.ndarray:
    """Return the colours of a texture, shrunk to at most _TEXELS per side in linear light."""
    import cv2  # loaded for textures alone

    height, width = texture.shape[:2]
    size = min(width, _TEXELS), min(height, _TEXELS)
    if size == (width, height):
        return texture
    linear = texture[..., :3] / np.float32(255) if is_data else srgb_decode(texture[..., :3])
    small = cv2.resize(linear, size, interpolation=cv2.INTER_AREA)
    codes = np.arange(256, dtype=np.uint8)
    values = codes / np.float32(255) if is_data else srgb_decode(codes)
    # A power would be rounded otherwise on other processors.
    return np.searchsorted((values[1:] + values[:-1]) / 2, small).astype(np.uint8)

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
from lfcore.scene.needs import TRACED_ROUGHNESS, emitting_triangles
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
MOST_SURFACES = 16
"""The most surfaces of a ray that veils let pass or mirrors reflect."""
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
    veils : what passes surfaces of partial opacity.
    mirrors : (T + 1,) whether a triangle is a smooth metal; False for a miss.
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
        self.veils = Veils(scene)
        mirrors = [
            m.metallic > 0.5 and m.roughness <= TRACED_ROUGHNESS for m in scene.every_material
        ]
        self.mirrors = np.append(np.array(mirrors, bool)[scene.material_ids], False)

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
        triangle, distance, weights = self._closest(origins, towards)
        behind = dot(self.unit[triangle], towards) > 0
        faces = np.where(triangle < 0, -1, 2 * triangle.astype(np.int64) + behind)
        return FaceHits(faces, np.where((triangle < 0)[:, None], 0, weights), distance)

    def surfaces(self, origins: np.ndarray, towards: np.ndarray) -> tuple[RayHits, HitSurfaces]:
        """Trace rays (R, 3); returns their hits, and the surfaces there: their emission, or the
        light of the sky, and what they reflect."""
        hits = self._closest(origins, towards)
        return hits, self.tracer.hit_surfaces(origins, towards, hits, normals=False)

    def _closest(self, origins: np.ndarray, towards: np.ndarray) -> RayHits:
        """Return the hits of rays (R, 3): a veil stops a share of them, which their bits choose."""
        hits, going = self.tracer.closest_hit(origins, towards), np.arange(len(origins))
        self.rays += len(origins)
        for step in range(MOST_SURFACES if self.veils.any else 0):
            share = self.veils.passing(hits.triangle[going], hits.barycentric[going])
            passes = _numbers(origins[going], towards[going], step) < share
            going = going[passes]
            if not len(going):
                break
            hits = RayHits(*(np.array(part) for part in hits))
            before = self.beyond(hits.distance[going], towards[going])
            start = origins[going] + before[:, None] * towards[going]
            found = self.tracer.closest_hit(start, towards[going])
            self.rays += len(going)
            for part, new in zip(
                hits, found._replace(distance=before + found.distance), strict=True
            ):
                part[going] = new
        return hits

    def beyond(self, distance: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Return distances (R,) behind surfaces at ``distance``, in units of ``towards``."""
        length = np.sqrt(dot(towards, towards))
        return (distance + self._least_lift / np.maximum(length, SMALLEST_LENGTH)).astype(
            np.float32
        )

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
            strength[lit] *= self._arriving(light, start, towards[lit])
        return strength[:, None] * np.array(light.colour, np.float32)

    def _arriving(self, light: Light, start: np.ndarray, towards: np.ndarray) -> np.ndarray:
        """Return the share (R,) of a light that arrives at ``start`` (R, 3): none in shadow, and
        what veils leave of it."""
        share, going = np.ones(len(start), np.float32), np.arange(len(start))
        distance = np.zeros(len(start), np.float32)
        for _ in range(MOST_SURFACES):
            rays = start[going] + distance[going, None] * towards[going], towards[going]
            triangle, far, weights = self.tracer.closest_hit(*rays)
            self.rays += len(going)
            far = distance[going] + far
            own = (triangle >= light.own[0]) & (triangle < light.own[1])
            met = (triangle >= 0) & ~own & ((far < 1) | (light.kind != POINT))
            going, far, triangle, weights = (part[met] for part in (going, far, triangle, weights))
            passing = self.veils.passing(triangle, weights)
            share[going] *= passing
            going, far = going[passing > 0], far[passing > 0]
            if not len(going):
                break
            distance[going] = self.beyond(far, towards[going])
        return share


class Veils:
    """What surfaces of partial opacity let pass.

    Attributes
    ----------
    any : whether there is such a surface.
    """

    def __init__(self, scene: Scene):
        self._scene = scene
        materials = scene.every_material
        opacity = np.array([material.opacity for material in materials], np.float32)
        blends = np.array([scene.has_alpha_blend(material) for material in materials], bool)
        self._opacity, self._blends = opacity[scene.material_ids], blends[scene.material_ids]
        self.is_veil = np.append((self._opacity < 1) | self._blends, False)
        self.any = bool(self.is_veil.any())

    def passing(self, triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Return the shares (R,) of light that pass surfaces at ``weights`` (R, 3); 0 for a
        miss."""
        share, scene = np.zeros(len(triangle), np.float32), self._scene
        veiled = np.flatnonzero(self.is_veil[triangle])
        triangle, weights = triangle[veiled], weights[veiled]
        opacity = self._opacity[triangle]
        for number, material in enumerate(scene.every_material):
            mine = np.flatnonzero(self._blends[triangle] & (scene.material_ids[triangle] == number))
            if len(mine):
                alpha = scene.textures[material.texture][..., 3]
                uv = (weights[mine, :, None] * scene.uvs[triangle[mine]]).sum(1)
                opacity[mine] *= _nearest(alpha, uv) / np.float32(255)
        share[veiled] = 1 - opacity
        return share


def _nearest(texels: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """Return the texels (R,) of a texture (H, W) at uv (R, 2), which repeats, v up."""
    height, width = texels.shape
    column = np.floor(uv[:, 0] * width).astype(np.int64) % width
    row = np.floor((1 - uv[:, 1]) * height).astype(np.int64) % height
    return texels[row, column]


def _numbers(origins: np.ndarray, towards: np.ndarray, step: int) -> np.ndarray:
    """Return a number (R,) from 0 to 1 for each ray, by chance: of its bits."""
    bits = np.concatenate([origins, towards], axis=1).astype(np.float32).view(np.uint32)
    mixed = np.full(len(bits), step, np.uint64)
    for column in bits.T:
        mixed = (mixed ^ column) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    return (mixed >> np.uint64(40)).astype(np.float32) / np.float32(1 << 24)


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

"""glTF's metallic-roughness materials in float64, with their textures and normal maps.

The reflection of a light of strength 1, with pi times the BRDF f of appendix B:

    pi f cos = ((1 - F) c_diff + F pi D V) cos
    c_diff = (1 - metal) base,  f0 = 0.04 (1 - metal) + metal base,  F = f0 + (1 - f0) (1 - V . H)^5
    D = a^2 / (pi ((N . H)^2 (a^2 - 1) + 1)^2),  a = roughness^2
    V = 1 / ((L + sqrt(a^2 + (1 - a^2) L^2)) (E + sqrt(a^2 + (1 - a^2) E^2)))

with L = N . L and E = |N . V|.  Roughness is at least 0.05.  Reflections of a sky are looked up in
the tables of :mod:`lfcore.scene.sky_gloss`.

Source: Khronos, "glTF 2.0 Specification", appendix B.
"""

from dataclasses import dataclass

import numpy as np

from lfcore.oracle.textures import Spots
from lfcore.scene.model import Scene
from lfcore.scene.sky_gloss import LEVELS, SHARES, SIDE, sky_gloss

LEAST_ROUGHNESS = 0.05


@dataclass(frozen=True)
class Metals:
    """Surface values: ``base`` (R, 3), ``metal`` and ``roughness`` (R, 1)."""

    base: np.ndarray
    metal: np.ndarray
    roughness: np.ndarray

    @property
    def straight(self) -> np.ndarray:
        """The reflectance f0 at normal incidence, (R, 3)."""
        return 0.04 * (1 - self.metal) + self.metal * self.base

    def surrounded(self) -> np.ndarray:
        """(R, 3): the reflected share of uniform light, c_diff + f0."""
        return (1 - self.metal) * self.base + self.straight

    def reflected(
        self, normal: np.ndarray, towards: np.ndarray, view: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """(R, 3) each: the diffuse part of pi f cos of unit vectors (R, 3), and the highlight; 0
        for light from behind."""
        half = towards + view
        half /= np.linalg.norm(half, axis=1, keepdims=True)
        light, view_cosine = np.maximum(_dot(normal, towards), 0), np.abs(_dot(normal, view))
        square = np.maximum(self.roughness, LEAST_ROUGHNESS) ** 4
        peaks = square / (_dot(normal, half) ** 2 * (square - 1) + 1) ** 2
        shadowed = [c + np.sqrt(square + (1 - square) * c**2) for c in (light, view_cosine)]
        visible = 1 / (shadowed[0] * shadowed[1])
        fresnel = self.straight + (1 - self.straight) * (1 - _dot(view, half)) ** 5
        diffuse = (1 - fresnel) * (1 - self.metal) * self.base
        return diffuse * light, fresnel * peaks * visible * light


def metals(spots: Spots, base: np.ndarray) -> Metals:
    """The surface values for base colours (R, 3)."""
    factors = spots.sampled("metal_texture", encoded=False)
    metal, rough = (spots.of_material(name)[:, None] for name in ("metallic", "roughness"))
    return Metals(base, metal * factors[:, 2:], rough * factors[:, 1:2])


def bent_normals(every: Spots, normal: np.ndarray) -> np.ndarray:
    """(R, 3) unit normals with their maps; ``normal`` (R, 3) are on the viewer's side.

    The tangent is the direction of growing u on the triangle, made perpendicular to the normal; the
    bitangent is perpendicular to both, on the side of growing v.
    """
    bent, scene = normal.copy(), every.scene
    mapped = (every.of_material("normal_texture") >= 0) & (len(scene.uvs) > 0)
    if not mapped.any():
        return bent
    spots = every.some(mapped)
    unturned = spots.interpolated(scene.normals) if len(scene.normals) else spots.face_normals()
    front = np.where(_dot(unturned, spots.view) > 0, 1.0, -1.0)
    outward = normal[mapped] * front
    uv = scene.uvs[spots.triangle].astype(np.float64)
    steps = uv[:, 1:] - uv[:, :1]  # (R, edge, u and v)
    along_u, along_v = (np.linalg.inv(steps) @ spots.edges).swapaxes(0, 1)
    tangent = along_u - _dot(along_u, outward) * outward
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    across = np.cross(outward, tangent)
    across *= np.sign(_dot(across, along_v))
    x, y, z = (2 * spots.sampled("normal_texture", encoded=False) - 1)[..., None].swapaxes(0, 1)
    turned = spots.of_material("normal_scale")[:, None] * (x * tangent + y * across) + z * outward
    bent[mapped] = front * turned / np.linalg.norm(turned, axis=1, keepdims=True)
    return bent


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a * b).sum(1, keepdims=True)


def reflected_sky(
    scene: Scene, metal: Metals, light: np.ndarray, normal: np.ndarray, view: np.ndarray
) -> np.ndarray:
    """(R, 3): diffuse and glossy reflection with baked ``light`` (R, 3).

    ``normal`` (R, 3) is that of the normal map.
    """
    tables = sky_gloss(scene.sky).astype(np.float64)
    maps = tables[: (LEVELS + 1) * SIDE**2].reshape(LEVELS + 1, SIDE, SIDE, 3)
    shares = tables[(LEVELS + 1) * SIDE**2 :].reshape(SHARES, SHARES, 3)
    rough = np.maximum(metal.roughness[:, 0], LEAST_ROUGHNESS)
    cosine = np.clip((normal * view).sum(1), 0, 1)
    place = _place(2 * cosine[:, None] * normal - view)
    level = np.minimum(np.floor(rough * (LEVELS - 1)).astype(int), LEVELS - 2)
    between = (rough * (LEVELS - 1) - level)[:, None]
    lobe = (1 - between) * _at(maps, level, place) + between * _at(maps, level + 1, place)
    open_sky = _at(maps, np.full(len(rough), LEVELS), _place(normal))
    lobe = lobe * np.clip(light / np.maximum(open_sky, 1e-20), 0, 1)
    a, b, _ = _at(shares[None], 0 * level, np.stack([cosine, rough], 1) * (SHARES - 1)).T
    share = a[:, None] * metal.straight + b[:, None]
    return (1 - metal.metal) * metal.base * (1 - share) * light + share * lobe


def _place(d: np.ndarray) -> np.ndarray:
    """(R, 2) columns and rows on a map."""
    d = d / np.abs(d).sum(1, keepdims=True)
    folded = np.copysign(1 - np.abs(d[:, 1::-1]), d[:, :2])
    return (np.where(d[:, 2:] < 0, folded, d[:, :2]) + 1) / 2 * (SIDE - 1)


def _at(maps: np.ndarray, number: np.ndarray, place: np.ndarray) -> np.ndarray:
    column, row = np.clip(np.floor(place).astype(int), 0, maps.shape[1] - 2).T
    f, g = (place - np.stack([column, row], 1)).T[..., None]
    top = (1 - f) * maps[number, row, column] + f * maps[number, row, column + 1]
    end = (1 - f) * maps[number, row + 1, column] + f * maps[number, row + 1, column + 1]
    return (1 - g) * top + g * end

"""Values of corners, materials and textures at points on triangles, in float64."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lfcore.oracle.colour import srgb_decode
from lfcore.oracle.intersect import Solid
from lfcore.scene.appearance import Material
from lfcore.scene.model import Scene


@dataclass(frozen=True)
class Spots:
    """R points on triangles (R,) at ``weights`` (R, 3), with unit directions ``view`` (R, 3) to the
    viewer."""

    scene: Scene
    triangle: np.ndarray
    weights: np.ndarray
    view: np.ndarray

    def some(self, mask: np.ndarray) -> Spots:
        """The points of a mask (R,)."""
        return Spots(self.scene, self.triangle[mask], self.weights[mask], self.view[mask])

    @cached_property
    def materials(self) -> list[Material]:
        return [self.scene.every_material[k] for k in self.scene.material_ids[self.triangle]]

    def of_material(self, name: str) -> np.ndarray:
        """(R,) numbers or (R, 3) colours."""
        return np.array([getattr(material, name) for material in self.materials], np.float64)

    @cached_property
    def edges(self) -> np.ndarray:
        """(R, 2, 3) edges from the first corner to the others."""
        corners = self.scene.triangles[self.triangle].astype(np.float64)
        return corners[:, 1:] - corners[:, :1]

    def opacity(self) -> np.ndarray:
        """(R, 1) shares of light that meet the surface."""
        share = self.of_material("opacity")
        for number, material in enumerate(self.scene.every_material):
            mine = self.scene.material_ids[self.triangle] == number
            if self.scene.has_alpha_blend(material) and mine.any():
                alpha = self.scene.textures[material.texture][..., 3:]
                uv = self.some(mine).interpolated(self.scene.uvs)
                share[mine] *= bilinear(alpha, uv, encoded=False)[:, 0]
        return share[:, None]

    def face_normals(self) -> np.ndarray:
        """(R, 3) geometric normals, not unit."""
        return np.cross(self.edges[:, 0], self.edges[:, 1])

    def interpolated(self, corners: np.ndarray) -> np.ndarray:
        """(R, K) values interpolated from the corners' (T, 3, K)."""
        return (self.weights[:, :, None] * corners[self.triangle].astype(np.float64)).sum(1)

    def sampled(self, name: str, *, encoded: bool) -> np.ndarray:
        """(R, 3) of the materials' textures ``name``; 1 without a texture."""
        values = np.ones((len(self.triangle), 3))
        if len(self.scene.uvs):
            number, uv = self.of_material(name), self.interpolated(self.scene.uvs)
            for index in set(number.astype(int).tolist()) - {-1}:
                mine = number == index
                texture = self.scene.textures[index][..., :3]
                values[mine] = bilinear(texture, uv[mine], encoded=encoded)
        return values


def bilinear(texture: np.ndarray, uv: np.ndarray, *, encoded: bool = True) -> np.ndarray:
    """(R, 3) linear RGB of ``texture`` (H, W, 3) uint8, row 0 on top, at ``uv`` (R, 2); codes are
    sRGB or, unless ``encoded``, linear.

    v runs up from the bottom; texel (0, 0) has its centre at u = 0.5 / W, v = 1 - 0.5 / H; both
    coordinates wrap.
    """
    linear = srgb_decode(texture / 255.0) if encoded else texture / 255.0
    height, width = texture.shape[:2]
    x, y = uv[:, 0] * width - 0.5, (1 - uv[:, 1]) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    colour = np.zeros((len(uv), texture.shape[2]))
    for right in (0, 1):
        for below in (0, 1):
            share_x = x - left if right else 1 - (x - left)
            share_y = y - top if below else 1 - (y - top)
            texel = linear[(top + below) % height, (left + right) % width]
            colour += (share_x * share_y)[:, None] * texel
    return colour


def solid_of(scene: Scene, numbers: np.ndarray | None = None) -> Solid | None:
    """The test for holes: alpha, bilinear at full size, below the material's cutoff.

    None for a scene without holes.  ``numbers`` are the tested triangles; default all.
    """
    holes = {
        number: material
        for number, material in enumerate(scene.every_material)
        if material.alpha_cutoff > 0 and material.texture >= 0 and len(scene.uvs)
        and scene.textures[material.texture].shape[2] == 4
    }  # fmt: skip
    if not holes:
        return None

    def solid(triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        tested = triangle if numbers is None else numbers[triangle]
        stopped = np.ones(len(tested), bool)
        for number, material in holes.items():
            mine = scene.material_ids[tested] == number
            uv = (weights[mine][:, :, None] * scene.uvs[tested[mine]].astype(np.float64)).sum(1)
            alpha = bilinear(scene.textures[material.texture][..., 3:], uv, encoded=False)[:, 0]
            stopped[mine] = alpha >= material.alpha_cutoff
        return stopped

    return solid

"""Textures at single places, in float64, and the holes that their alpha cuts."""

import numpy as np

from lfcore.oracle.colour import srgb_decode
from lfcore.oracle.intersect import Solid
from lfcore.scene.model import Scene


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
    """Where ``scene`` stops rays; None if all of it does, everywhere.

    ``numbers`` (T,) are the scene's triangles that are asked about, all of them without.
    """
    holes = {
        number: material
        for number, material in enumerate(scene.materials)
        if material.alpha_cutoff > 0 and material.texture >= 0 and len(scene.uvs)
        and scene.textures[material.texture].shape[2] == 4
    }  # fmt: skip
    if not holes:
        return None

    def solid(triangle: np.ndarray, weights: np.ndarray) -> np.ndarray:
        which = triangle if numbers is None else numbers[triangle]
        stopped = np.ones(len(which), bool)
        for number, material in holes.items():
            mine = scene.material_ids[which] == number
            uv = (weights[mine][:, :, None] * scene.uvs[which[mine]].astype(np.float64)).sum(1)
            alpha = bilinear(scene.textures[material.texture][..., 3:], uv, encoded=False)[:, 0]
            stopped[mine] = alpha >= material.alpha_cutoff
        return stopped

    return solid

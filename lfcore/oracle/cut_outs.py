"""Holes that the alpha of a texture cuts, in float64: bilinear at full size, below the cutoff."""

import numpy as np

from lfcore.oracle.intersect import Solid
from lfcore.oracle.textures import bilinear
from lfcore.scene.model import Scene


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

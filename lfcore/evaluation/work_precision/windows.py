"""Parts of a picture where the lens integral is hard: edges, highlights, textures, and the rest.

Four windows of 16 x 16 pixels, the richest in each kind, stand for the picture: a few pixels can
afford lens samples that a whole picture cannot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lfcore.optics.bundles import macropixels
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.tracing.tracer import Tracer

SIDE = 16
KINDS = ("edges", "highlights", "textures", "smooth")
LOOK = 4  # lens samples a side to tell kinds by
DEPTHS = 1.02  # ratio of depths within a pixel that makes an edge
GLOSS = 0.1  # spread of luminance over the lens that makes a highlight


@dataclass(frozen=True)
class Windows:
    """``corners`` (W, 2) of the windows, columns and rows of a picture of ``pixels`` a side;
    ``kinds`` (W, 16, 16) index :data:`KINDS`."""

    pixels: int
    corners: np.ndarray
    kinds: np.ndarray

    @property
    def masks(self) -> dict[str, np.ndarray]:
        """Masks (W 16, 16) by kind, of windows one above the other."""
        flat = self.kinds.reshape(-1, SIDE)
        return {name: flat == number for number, name in enumerate(KINDS)}


def choose(tracer: Tracer, camera: Camera, pixels: int) -> Windows:
    """For each kind the window with most pixels of it, none twice."""
    slab = Slab(camera, LOOK, pixels)
    places = np.stack(np.meshgrid(np.arange(pixels), np.arange(pixels)), -1).reshape(-1, 2)
    kinds = _kinds(tracer, slab, places).reshape(pixels, pixels)
    across = pixels // SIDE
    whole = kinds[: across * SIDE, : across * SIDE].reshape(across, SIDE, across, SIDE)
    tiles = whole.transpose(0, 2, 1, 3).reshape(-1, SIDE, SIDE)
    chosen: list[int] = []
    for number in range(len(KINDS)):
        count = (tiles == number).sum((1, 2))
        count[chosen] = -1
        chosen.append(int(count.argmax()))
    corners = np.array([(c % across * SIDE, c // across * SIDE) for c in chosen])
    return Windows(pixels, corners, tiles[chosen])


def _kinds(tracer: Tracer, slab: Slab, places: np.ndarray) -> np.ndarray:
    """(P,) index of :data:`KINDS` of each pixel."""
    scene = tracer.scene
    triangle, depth = tracer.slab_hits(slab, places)
    triangle, depth = triangle.reshape(len(places), -1), depth.reshape(len(places), -1)
    hit = triangle >= 0
    material = np.where(hit, scene.material_ids[np.maximum(triangle, 0)], -1)
    with np.errstate(invalid="ignore"):
        spread = depth.max(1) > DEPTHS * depth.min(1)
    edges = (material.min(1) != material.max(1)) | (spread & hit.any(1))
    radiance = tracer.bundle_radiance(macropixels(slab, places), places)
    light = np.clip(radiance, 0, 1).mean(-1).reshape(len(places), -1)
    table = scene.materials
    shiny = np.array([any(one.specular) for one in table] + [False])[material[:, 0]]
    textured = np.array([one.texture >= 0 for one in table] + [False])[material[:, 0]]
    gloss = shiny & (np.ptp(light, axis=1) > GLOSS)
    return np.select([edges, gloss, textured], [0, 1, 2], 3)

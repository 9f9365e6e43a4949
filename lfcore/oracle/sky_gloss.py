"""What metals reflect of a sky, in float64: :mod:`lfcore.scene.sky_gloss` has the tables."""

import numpy as np

from lfcore.oracle.metal import LEAST_ROUGHNESS, Metals
from lfcore.scene.model import Scene
from lfcore.scene.sky_gloss import LEVELS, SHARES, SIDE, sky_gloss


def reflected(
    scene: Scene, metal: Metals, light: np.ndarray, normal: np.ndarray, view: np.ndarray
) -> np.ndarray:
    """(R, 3): diffuse and glossy reflection where ``light`` (R, 3) was baked; ``normal`` (R, 3) is
    that of the normal map."""
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

"""Pictures for walls, floors and cloths: art prints, the Earth, wallpaper, rug, quilt, knitting."""

import numpy as np
from numpy.typing import ArrayLike
from PIL.ImageColor import getrgb

from lfcore.scene.procedural import textures


def art_print(seed: int, kind: int) -> np.ndarray:
    """(320, 256, 3) uint8 with a paper margin: 0 hills and sun, 1 sailing boats, 2 branches."""
    v, u = np.mgrid[:320, :256] / np.array([320.0, 256.0])[:, None, None]
    picture = (_hills, _boats, _branches)[kind % 3](seed, u, v)
    margin = np.minimum(np.minimum(u, 1 - u) * 256, np.minimum(v, 1 - v) * 320)
    picture[margin < 28] = (120, 112, 100)
    picture[margin < 26] = (242, 238, 228)
    return textures.finish(picture)


def _hills(seed: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    picture = textures.ramp(v, (246, 214, 160), (244, 226, 196), (236, 200, 170))
    picture[np.hypot((u - 0.6) * 0.8, v - 0.32) < 0.11] = (222, 108, 68)
    tones = ((168, 176, 160), (110, 146, 144), (64, 108, 118), (40, 72, 88))
    for layer, tone in enumerate(tones):
        crest = 0.44 + 0.13 * layer + 0.07 * np.sin(u * (5 + layer) + seed + 2.1 * layer)
        picture[v > crest + 0.03 * np.sin(u * 13 + layer)] = tone
    return picture


def _boats(seed: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    wave = textures.noise(seed, cells=(10, 3), octaves=3, size=u.shape)
    sea = textures.ramp(np.clip(0.6 * wave + 0.5 * (v - 0.5), 0, 1), (52, 98, 128), (120, 168, 180))
    sky = textures.ramp(np.clip(v * 1.8, 0, 1), (176, 208, 222), (248, 232, 204))
    picture = np.where((v > 0.55)[..., None], sea, sky)
    boats = (0.38, 0.66, 0.30, (236, 232, 222)), (0.70, 0.60, 0.16, (206, 92, 70))
    for x, y, size, tone in boats:
        rise = (y - v) / size
        sail = (rise > 0.05) & (rise < 1) & (u - x > -0.42 * size * (1 - rise)) & (u - x < 0.02)
        jib = (rise > 0.05) & (rise < 0.8) & (u - x < 0.3 * size * (0.8 - rise)) & (u - x > 0.02)
        hull = (rise > -0.14) & (rise <= 0.02) & (np.abs(u - x) < size * (0.42 + rise))
        picture[sail | jib] = tone
        picture[hull] = (84, 54, 42)
    return picture


def _branches(seed: int, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    picture = np.broadcast_to(np.array([226.0, 222, 206]), (*u.shape, 3)).copy()
    stem = 0.5 + 0.06 * np.sin(v * 4)
    picture[np.abs(u - stem) < 0.008] = (70, 84, 62)
    tones = ((94, 128, 98), (134, 160, 118), (190, 130, 100))
    for leaf in range(14):
        y, side = 0.14 + 0.055 * leaf, 1 if leaf % 2 else -1
        angle, size = side * (0.75 + 0.02 * leaf), 0.16 + 0.05 * np.sin(leaf * 1.3)
        dx, dy = (u - 0.5 - 0.06 * np.sin(y * 4)) * 0.8, y - v
        along = dx * np.sin(angle) + dy * np.cos(angle)
        across = dx * np.cos(angle) - dy * np.sin(angle)
        inside = np.abs(across) < 0.035 * np.sin(np.pi * np.clip(along / size, 0, 1))
        picture[inside] = tones[leaf % 3]
    return picture


def earth_map(seed: int) -> np.ndarray:
    """(256, 512, 3) uint8: continents by noise, ice at the poles, a graticule."""
    v, u = np.mgrid[:256, :512] / np.array([256.0, 512.0])[:, None, None]
    land = textures.noise(seed, cells=(3, 5), octaves=6, size=(256, 512), gain=0.6)
    relief = textures.noise(seed + 1, cells=(12, 24), octaves=3, size=(256, 512))
    ocean = textures.ramp(np.clip(land * 1.5, 0, 1), (58, 104, 140), (112, 164, 184))
    ground = textures.ramp(relief, (150, 140, 84), (196, 176, 120), (112, 140, 84))
    picture = np.where((land > 0.55)[..., None], ground, ocean)
    picture[np.abs(v - 0.5) + 0.04 * relief > 0.46] = (238, 238, 232)
    lines = ((u * 12) % 1 < 0.03) | ((v * 6) % 1 < 0.03)
    return textures.finish(np.where(lines[..., None], picture * 0.82, picture))


def wallpaper(seed: int) -> np.ndarray:
    """(512, 512, 3) uint8: small sprigs in offset rows on a pale ground."""
    v, u = np.mgrid[:512, :512] / 512.0
    ground = textures.plaster(seed, (214, 214, 198), contrast=4, size=(512, 512)).astype(np.float64)
    row = np.floor(v * 6)
    x, y = (u * 6 + 0.5 * (row % 2)) % 1 - 0.5, v * 6 % 1 - 0.5
    for turn in (-0.9, -0.3, 0.3, 0.9):
        along = x * np.sin(turn) - y * np.cos(turn) + 0.22
        across = x * np.cos(turn) + y * np.sin(turn)
        length = 0.42 if abs(turn) < 0.5 else 0.32
        leaf = np.abs(across) < 0.050 * np.sin(np.pi * np.clip(along / length, 0, 1))
        ground[leaf] = (150, 172, 150) if abs(turn) < 0.5 else (168, 186, 160)
    bud = np.hypot(x, y + 0.26) < 0.045
    ground[bud] = (212, 160, 140)
    return textures.finish(ground)


def rug_pattern(seed: int) -> np.ndarray:
    """(360, 512, 3) uint8: borders and a field of diamonds, hand-woven tones."""
    v, u = np.mgrid[:360, :512] / np.array([360.0, 512.0])[:, None, None]
    edge = np.minimum(np.minimum(u, 1 - u) * 1.42, np.minimum(v, 1 - v))
    red, navy, sand, teal = (158, 62, 52), (44, 58, 84), (222, 200, 160), (92, 136, 132)
    p, q = u * 10, v * 7
    diamond = np.abs(p % 1 - 0.5) + np.abs(q % 1 - 0.5)
    ochre = (214, 150, 70)
    big = np.abs(u - 0.5) * 1.42 + np.abs(v - 0.5)
    picture = np.full((360, 512, 3), red, np.float64)
    for distance, *bands in (
        (diamond, (0.40, sand), (0.28, navy), (0.14, ochre)),
        (big, (0.40, sand), (0.375, teal), (0.28, sand), (0.262, navy), (0.12, ochre)),
        (edge, (0.15, navy), (0.135, sand), (0.045, teal), (0.03, red)),
    ):
        for reach, tone in bands:
            picture[distance < reach] = tone
    teeth = np.abs(((u * 1.42 + v) * 14) % 1 - 0.5)
    picture[(edge > 0.06) & (edge < 0.06 + 0.06 * 2 * teeth)] = red
    weave = textures.noise(seed, cells=(180, 16), octaves=1, size=(360, 512))
    wear = textures.noise(seed + 1, cells=(4, 6), octaves=4, size=(360, 512))
    return textures.finish(picture * (0.84 + 0.14 * weave + 0.08 * wear)[..., None])


def patchwork(seed: int) -> np.ndarray:
    """(512, 512, 3) uint8: 4 x 4 squares of different cloths, stitched."""
    rng = np.random.default_rng(seed)
    tones = ("#e2d6be", "#6c8c96", "#ca8a76", "#e8c478", "#4a6880", "#96a88c")
    picture = np.zeros((512, 512, 3), np.uint8)
    v, u = np.mgrid[:128, :128] / 128.0
    masks = (
        np.hypot((u * 4) % 1 - 0.5, (v * 4) % 1 - 0.5) < 0.22,
        (u * 6 % 1) < 0.4,
        np.abs(u - 0.5) + np.abs(v - 0.5) < 0.34,
        ((np.floor(u * 4) + np.floor(v * 4)) % 2) > 0,
    )
    seam = np.minimum.reduce([u, 1 - u, v, 1 - v])
    stitch = (np.abs(seam - 0.075) < 0.008) & (((u + v) * 16 % 1) < 0.6)
    for number in range(16):
        row, column = divmod(number, 4)
        base = np.array(getrgb(tones[(row * 2 + column * 5 + (row * column) % 3) % 6]))
        second_tone = np.array(getrgb(tones[(row * 3 + column + 2) % 6]))
        mask = masks[int(rng.integers(4))]
        cloth = textures.weave(seed + number, (255, 255, 255), size=(128, 128), threads=32)
        patch = np.where(mask[..., None], 0.55 * base + 0.45 * second_tone, base) * (cloth / 255.0)
        patch *= (0.80 + 0.20 * np.clip(seam / 0.05, 0, 1))[..., None]
        patch[stitch] = (246, 240, 228)
        square = slice(row * 128, row * 128 + 128), slice(column * 128, column * 128 + 128)
        picture[square] = textures.finish(patch)
    return picture


def knitting(seed: int, colour: ArrayLike) -> np.ndarray:
    """(256, 256, 3) uint8: stocking stitch with a cable."""
    v, u = np.mgrid[:256, :256] / 256.0
    x = u * 20 % 1
    stitch = np.sin(np.pi * ((v * 20 + np.abs(x - 0.5)) % 1)) * np.sin(np.pi * x) ** 0.6
    cable = np.exp(-(((u % 0.5 - 0.25 - 0.05 * np.sin(v * 2 * np.pi * 4)) / 0.04) ** 2))
    fuzz = textures.noise(seed, cells=(40, 40), octaves=2, size=(256, 256))
    shade = 0.62 + 0.30 * stitch + 0.12 * cable + 0.10 * fuzz
    return textures.finish(np.asarray(colour) * shade[..., None])

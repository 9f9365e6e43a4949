"""Procedural textures: (H, W, 3) uint8, sRGB encoded, deterministic by seed, tileable.

Colours are given as sRGB triples in [0, 255]; mixing happens on encoded values, as painters do.
"""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw, ImageFont

from lfcore.scene.procedural.basics import Size

SQUARE = (512, 512)
Tone = ArrayLike
"""An sRGB triple."""
Colours = Sequence[Tone]
"""The tones of a gradient."""


def noise(
    seed: int, *, cells: Size = (8, 8), octaves: int = 4, size: Size = SQUARE, gain: float = 0.55
) -> np.ndarray:
    """(H, W) float64 tileable value noise in [0, 1]; ``cells`` (rows, columns) of octave one."""
    rng = np.random.default_rng(seed)
    total, weight = np.zeros(size), 0.0
    for octave in range(octaves):
        rows, columns = (min(c * 2**octave, s) for c, s in zip(cells, size, strict=True))
        lattice = np.pad(rng.random((rows, columns)), 2, mode="wrap")
        scale_y, scale_x = size[0] / rows, size[1] / columns
        wide = cv2.resize(
            lattice,
            (round((columns + 4) * scale_x), round((rows + 4) * scale_y)),
            interpolation=cv2.INTER_CUBIC,
        )
        top, left = round(2 * scale_y), round(2 * scale_x)
        total += gain**octave * wide[top : top + size[0], left : left + size[1]]
        weight += gain**octave
    total /= weight
    low, high = np.percentile(total, [1, 99])
    return np.clip((total - low) / (high - low), 0, 1)


def ramp(values: np.ndarray, *colours: Tone) -> np.ndarray:
    """(..., 3) float64: ``values`` in [0, 1] to a gradient through evenly spaced colours."""
    stops = np.linspace(0, 1, len(colours))
    table = np.asarray(colours, np.float64)
    return np.stack([np.interp(values, stops, table[:, c]) for c in range(3)], -1)


def finish(picture: np.ndarray) -> np.ndarray:
    """Round to uint8."""
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)


def speckle(
    seed: int, colours: Colours, *, cells: Size = (12, 12), octaves: int = 5, size: Size = SQUARE
) -> np.ndarray:
    """Plain fractal noise through a gradient: plaster, earth, bark, rust."""
    return finish(ramp(noise(seed, cells=cells, octaves=octaves, size=size), *colours))


def plaster(
    seed: int, colour: Tone, *, contrast: float = 10.0, size: Size = (256, 256)
) -> np.ndarray:
    fine = noise(seed, cells=(24, 24), octaves=3, size=size) - 0.5
    broad = noise(seed + 1, cells=(3, 3), octaves=3, size=size) - 0.5
    return finish(np.asarray(colour) + contrast * (fine + broad)[..., None])


def wood(
    seed: int, dark: Tone, light: Tone, *, size: Size = (256, 512), rings: float = 7.0
) -> np.ndarray:
    """Grain along u (columns): stretched noise warps parallel lines."""
    warp = noise(seed, cells=(4, 1), octaves=3, size=size)
    fibre = noise(seed + 1, cells=(64, 4), octaves=2, size=size)
    v = np.linspace(0, 1, size[0], endpoint=False)[:, None]
    grain = 0.5 + 0.5 * np.sin(2 * np.pi * (rings * v + 2.2 * warp))
    return finish(ramp(0.6 * grain + 0.4 * fibre, dark, light))


def planks(
    seed: int, dark: Tone, light: Tone, *, rows: int = 6, size: Size = SQUARE, stagger: bool = True
) -> np.ndarray:
    """Boards along u, each with a tone and grain of its own, dark joints between."""
    rng = np.random.default_rng(seed)
    height, width = size[0] // rows, size[1]
    picture = np.zeros((*size, 3))
    for row in range(rows):
        board = wood(int(rng.integers(1 << 30)), dark, light, size=(height, width), rings=2.5)
        board = np.roll(board.astype(np.float64), int(rng.integers(width)), 1)
        board *= rng.uniform(0.82, 1.06)
        board[: max(2, height // 28)] *= 0.55
        board[-1:] *= 0.8
        if stagger:
            cut = int((row * 0.37 + rng.uniform(0, 0.25)) % 1 * width)
            board[:, cut : cut + 3] *= 0.55
        picture[row * height : (row + 1) * height] = board
    picture[rows * height :] = picture[rows * height - 1]
    return finish(picture)


def bricks(
    seed: int,
    colours: Colours,
    mortar: Tone,
    *,
    rows: int = 8,
    columns: int = 4,
    size: Size = SQUARE,
    gap: float = 0.09,
) -> np.ndarray:
    """Running bond; ``colours`` is a gradient from which each brick draws its tone."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[: size[0], : size[1]]
    wobble = 3.0 * (noise(seed + 5, cells=(16, 16), octaves=2, size=size) - 0.5)
    y = (v + wobble) / size[0] * rows
    row = np.floor(y).astype(int) % rows
    x = (u + wobble) / size[1] * columns + 0.5 * (row % 2)
    column = np.floor(x).astype(int) % columns
    edge_y = np.minimum(y % 1, 1 - y % 1)
    edge_x = np.minimum(x % 1, 1 - x % 1) * rows / columns * 2 * size[1] / size[0] / 2 * 2
    edge = np.minimum(edge_y, edge_x)
    tone = rng.random((rows, columns))[row, column]
    grain = noise(seed + 1, cells=(40, 40), octaves=3, size=size)
    brick = ramp(0.7 * tone + 0.3 * grain, *colours) * (0.88 + 0.24 * grain[..., None])
    brick *= 0.72 + 0.28 * np.clip((edge - gap) / 0.10, 0, 1)[..., None]
    joint = np.asarray(mortar) * (0.85 + 0.3 * grain[..., None])
    mix = np.clip((edge - gap * 0.6) / (gap * 0.5), 0, 1)[..., None]
    return finish(mix * brick + (1 - mix) * joint)


def cobbles(
    seed: int, colours: Colours, gap_colour: Tone, *, cells: int = 9, size: Size = SQUARE
) -> np.ndarray:
    """Rounded setts in jittered rows: distance to the two nearest of wrapped seeds."""
    rng = np.random.default_rng(seed)
    rows, columns = np.mgrid[:cells, :cells].reshape(2, -1)
    x = (columns + 0.5 * (rows % 2) + rng.uniform(-0.16, 0.16, rows.size) + 0.5) / cells
    y = (rows + 0.5 + rng.uniform(-0.14, 0.14, rows.size)) / cells
    first, second = np.full(size, 9.0), np.full(size, 9.0)
    owner = np.zeros(size, int)
    reach = [int(1.7 * side / cells) for side in size]  # farther seeds are never the second
    for index in range(rows.size):
        dv = np.arange(-reach[0], reach[0] + 1) + round(y[index] * size[0])
        du = np.arange(-reach[1], reach[1] + 1) + round(x[index] * size[1])
        window = np.ix_(dv % size[0], du % size[1])
        dy, dx = np.abs(dv / size[0] - y[index])[:, None], np.abs(du / size[1] - x[index])
        distance = (dx**3 + dy**3) ** (1 / 3) * cells
        nearest, next_nearest = first[window], second[window]
        closer = distance < nearest
        second[window] = np.where(closer, nearest, np.minimum(next_nearest, distance))
        first[window] = np.where(closer, distance, nearest)
        owner[window] = np.where(closer, index, owner[window])
    edge = (second - first) / 2
    tone = rng.random(rows.size)[owner]
    grain = noise(seed + 1, cells=(40, 40), octaves=3, size=size)
    stone = ramp(0.75 * tone + 0.25 * grain, *colours) * (0.86 + 0.28 * grain[..., None])
    # Rounded tops: lighter towards the upper left, darker towards the joints.
    round_off = np.clip(edge / 0.22, 0, 1)
    slope = cv2.GaussianBlur(round_off, (0, 0), 2.5, borderType=cv2.BORDER_REFLECT)
    lit = np.roll(slope, 3, 0) - np.roll(slope, -3, 0)
    stone *= (0.62 + 0.38 * round_off)[..., None] * (1 - 0.35 * lit)[..., None]
    mix = np.clip((edge - 0.03) / 0.04, 0, 1)[..., None]
    return finish(mix * stone + (1 - mix) * np.asarray(gap_colour) * (0.8 + 0.4 * grain[..., None]))


def weave(
    seed: int, colour: Tone, *, threads: int = 64, depth: float = 0.16, size: Size = (256, 256)
) -> np.ndarray:
    """Plain cloth: crossing threads, and the slow shading of wear."""
    v, u = np.mgrid[: size[0], : size[1]] / np.array(size)[:, None, None] * 2 * np.pi
    over = 0.5 + 0.25 * (np.sin(threads / 2 * u) * np.sin(threads / 2 * v) + np.sin(threads * v))
    wear = noise(seed, cells=(4, 4), octaves=4, size=size)
    shade = 1 - depth * over - 0.12 * (1 - wear)
    return finish(np.asarray(colour) * shade[..., None])


def stripes(seed: int, colours: Colours, widths: ArrayLike, *, depth: float = 0.10) -> np.ndarray:
    """Bands across v, over cloth; ``widths`` are relative."""
    edges = np.cumsum(np.asarray(widths, np.float64)) / np.sum(widths)
    band = np.searchsorted(edges, np.linspace(0, 1, 256, endpoint=False), side="right")
    cloth = weave(seed, (255, 255, 255), depth=depth) / 255.0
    return finish(np.asarray(colours, np.float64)[band][:, None] * cloth)


def leaf(seed: int, dark: Tone, light: Tone, *, size: Size = (128, 128)) -> np.ndarray:
    """A leaf's blade: midrib along v in the middle, side veins, mottling."""
    v, u = np.mgrid[: size[0], : size[1]] / np.array(size)[:, None, None]
    rib = np.exp(-(((u - 0.5) / 0.03) ** 2))
    vein = np.exp(-((((v + 0.6 * np.abs(u - 0.5)) * 8 % 1 - 0.5) / 0.12) ** 2))
    mottle = noise(seed, cells=(6, 6), octaves=4, size=size)
    return finish(ramp(np.clip(0.75 * mottle + 0.35 * rib + 0.18 * vein, 0, 1), dark, light))


def bark(seed: int, dark: Tone, light: Tone, *, size: Size = (256, 256)) -> np.ndarray:
    """Furrows along v."""
    furrow = noise(seed, cells=(3, 20), octaves=4, size=size)
    return finish(ramp(np.clip(1.5 * furrow - 0.2, 0, 1), dark, light))


def end_grain(seed: int, dark: Tone, light: Tone, *, size: Size = (256, 256)) -> np.ndarray:
    """Growth rings of a sawn log, one texture over its face, with a crack or two."""
    v, u = np.mgrid[: size[0], : size[1]] / np.array(size)[:, None, None] - 0.5
    warp = noise(seed, cells=(3, 3), octaves=3, size=size) - 0.5
    radius = np.hypot(u, v) + 0.05 * warp
    rings = 0.5 + 0.5 * np.sin(radius * 2 * np.pi * 22)
    picture = ramp(0.55 * rings + 0.3 * noise(seed + 1, cells=(16, 16), size=size), dark, light)
    angle = np.arctan2(v, u) + 0.6 * warp
    crack = (np.abs(angle - 0.8) < 0.05 / (0.4 + 6 * radius)) & (radius > 0.06)
    picture[crack] *= 0.45
    picture[radius > 0.46] *= 0.5
    return finish(picture)


def write(
    picture: np.ndarray,
    text: str,
    centre: tuple[float, float],
    height: float,
    colour: Sequence[float],
    *,
    turn: int = 0,
) -> np.ndarray:
    """A copy of (H, W, 3) uint8 ``picture`` with ``text`` on it, in Pillow's own typeface.

    ``centre`` is (x, y) from the top left and ``height`` the letters' size, in pixels; ``turn``
    counts quarter turns counter-clockwise of the picture under the text.
    """
    image, ink = Image.fromarray(np.ascontiguousarray(np.rot90(picture, -turn))), map(int, colour)
    font = ImageFont.load_default(size=height)
    ImageDraw.Draw(image).text(centre, text, tuple(ink), font=font, anchor="mm")
    return np.rot90(np.array(image), turn).copy()


def blank_page(colour: Tone, size: tuple[int, int]) -> np.ndarray:
    """(H, W, 3) uint8 of one colour."""
    return np.broadcast_to(np.asarray(colour, np.uint8), (*size, 3)).copy()

"""Blur from one sharp picture and its depth, in place of rays, as others do it.

Pictures are (H, W, 3) float32, linear light.  ``radius`` (H, W) is that of the circle of confusion
in pixels, above 0 behind the focus.
"""

from collections.abc import Callable

import cv2
import numpy as np

FINE = 8
"""The points per pixel and direction over which a kernel is averaged."""
STEP = 0.5
"""The step of radius between layers, pixels."""
FOOTPRINT = 0.3
"""The variance of a splat of one pixel, as viewers' antialiasing adds, square pixels."""
Kernel = Callable[[float], np.ndarray]


def fossa(
    sharp: np.ndarray, radius: np.ndarray, power: float = 32.0, reach: int | None = None
) -> np.ndarray:
    """Blur as FOSSA's program: a pixel is the mean of neighbours by c^-2 exp(-2 (r / c)^power).

    c is the neighbour's own radius; depth does not count.  A pixel of a radius up to 1 px is
    copied, and gives nothing to others.  Source: github.com/princeton-vl/FOSSA, power_exp_psf/,
    after Gur and Wolf, "Single image depth estimation trained via depth from defocus cues", CVPR
    2019.  Their window reaches 7 px; by default ours reaches as far as the blur.
    """
    wide = np.abs(radius)
    reach = int(np.ceil(wide.max())) if reach is None else reach
    scale = np.where(wide > 1, wide, 1.0).astype(np.float32)
    given = np.dstack([sharp, np.ones_like(scale)]) * ((wide > 1) / scale**2)[..., None]
    padded = np.pad(given, [(reach, reach), (reach, reach), (0, 0)])
    wider = np.pad(scale, reach, mode="edge")
    total = np.zeros((*radius.shape, 4), np.float32)
    for y in range(-reach, reach + 1):
        for x in range(-reach, reach + 1):
            there = tuple(slice(reach + step, reach + step + side)
                          for step, side in zip((y, x), radius.shape, strict=True))  # fmt: skip
            falloff = np.exp(-2 * (np.hypot(y, x) / wider[there]) ** power)
            total += padded[there] * falloff[..., None]
    blurred = total[..., :3] / np.maximum(total[..., 3:], 1e-12)
    return np.where((wide > 1)[..., None], blurred, sharp)


def _kernel(radius: float, weight: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """Average ``weight`` (of x, y as shares of the radius) within the circle over each pixel."""
    size = abs(radius)
    reach = max(0, int(np.ceil(size - 0.5)))
    fine = (np.arange((2 * reach + 1) * FINE) + 0.5) / FINE - reach - 0.5
    x, y = fine[None] / max(size, 0.5), fine[:, None] / max(size, 0.5)
    inside = np.where(np.hypot(x, y) <= 1, weight(x * np.sign(radius), y), 0)
    side = 2 * reach + 1
    mean = inside.reshape(side, FINE, side, FINE).mean((1, 3))
    return mean / mean.sum()


def disc(radius: float) -> np.ndarray:
    """The blur of a round lens."""
    return _kernel(radius, lambda x, y: np.ones(np.broadcast(x, y).shape))


def half_disc(radius: float) -> np.ndarray:
    """The blur of the left half of a round lens."""
    return _kernel(radius, lambda x, y: (x + 0 * y < 0) | (abs(radius) < 0.5))


def translating_disc(radius: float) -> np.ndarray:
    """The left view's blur of Punnappurath et al., "Modeling defocus-disparity in dual-pixel
    sensors", ICCP 2020: a disc times the sum of all discs that are moved to the left."""
    return _kernel(radius, lambda x, y: np.sqrt(np.clip(1 - y * y, 0, 1)) - x)


def butterworth(
    radius: float, order: int = 6, cut: float = 2.5, floor: float = 0.2, smooth: float = 7
) -> np.ndarray:
    """The left view's blur of Abuolaim et al., "Learning to reduce defocus blur by realistically
    modeling dual-pixel data", ICCV 2021: a disc, darker in the middle by a Butterworth filter,
    smoothed, times a ramp.  Parameters are from the middle of theirs; the least radius is 1 px.
    """
    reach = max(1, round(abs(radius)))
    side = 2 * reach + 1
    x = np.arange(-reach, reach + 1)
    distance = np.hypot(x, x[:, None])
    ring = (distance / ((side - 1) / cut)) ** (2 * order)
    ring = ring / (1 + ring)
    whole = (distance <= reach) * (floor + (1 - floor) * ring / ring.max())
    blur = (round(side / smooth) + 1) | 1
    sigma = 0.3 * ((blur - 1) * 0.5 - 1) + 0.8
    soft = cv2.GaussianBlur(np.pad(whole, blur // 2), (blur, blur), sigma)
    ramp = np.linspace(1, 0, len(soft))[:: 1 if radius >= 0 else -1]
    return soft * ramp / (soft * ramp).sum()


def right(kernel: Kernel) -> Kernel:
    """The right view's blur of a left one."""
    return lambda radius: kernel(radius)[:, ::-1]


def blurred(picture: np.ndarray, kernel: np.ndarray, border: int = cv2.BORDER_CONSTANT):
    return cv2.filter2D(picture, -1, kernel[::-1, ::-1].astype(np.float32), borderType=border)


def layered(sharp: np.ndarray, radius: np.ndarray, kernel: Kernel = disc) -> np.ndarray:
    """Blur layers of depth, the farthest first, each over those behind it.

    Colour and coverage of a layer are divided by the blurred coverage of all layers up to it.
    Source: Ikoma et al., "Depth from defocus with learned optics and imaging", ICCP 2021.
    """
    numbers, picture = np.rint(radius / STEP), np.zeros(sharp.shape, np.float32)
    behind = np.zeros(radius.shape, np.float32)
    for number in np.unique(numbers)[::-1]:
        own, psf = (numbers == number).astype(np.float32), kernel(number * STEP)
        behind += own
        parts = blurred(np.dstack([sharp * own[..., None], own, behind]), psf)
        colour, cover = parts[..., :3], parts[..., 3:4]
        whole = np.maximum(parts[..., 4:], 1e-6)
        picture = colour / whole + (1 - cover / whole) * picture
    return picture


def gathered(sharp: np.ndarray, radius: np.ndarray, kernel: Kernel = disc) -> np.ndarray:
    """Blur all by each radius, and take each pixel from that of its own: as Abuolaim et al."""
    numbers, picture = np.rint(radius / STEP), np.zeros(sharp.shape, np.float32)
    for number in np.unique(numbers):
        own = numbers == number
        picture[own] = blurred(sharp, kernel(number * STEP), cv2.BORDER_REFLECT)[own]
    return picture


def splats(sharp: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Draw each pixel as a Gaussian, the farthest first: blur adds variance, and divides opacity.

    As github.com/sparkjsdev/spark, src/shaders/splatVertex.glsl, with half its width of blur: the
    variance is that of a disc.  What is not covered is divided out.
    """
    variance = FOOTPRINT + np.square(radius.astype(np.float64)) / 4
    opacity, reach = FOOTPRINT / variance, np.ceil(3 * np.sqrt(variance)).astype(int)
    colours = np.dstack([sharp, np.ones_like(radius)]).astype(np.float64)
    drawn, (high, wide) = np.zeros_like(colours), radius.shape
    rows, columns = np.arange(high), np.arange(wide)
    for v, u in np.stack(np.unravel_index(np.argsort(-radius, axis=None), radius.shape), 1):
        far, spread = reach[v, u], -0.5 / variance[v, u]
        there = np.s_[max(0, v - far) : v + far + 1, max(0, u - far) : u + far + 1]
        across = np.exp(spread * np.square(columns[there[1]] - u))
        down = opacity[v, u] * np.exp(spread * np.square(rows[there[0]] - v))
        weight = (down[:, None] * across)[..., None]
        drawn[there] += weight * (colours[v, u] - drawn[there])
    return (drawn[..., :3] / drawn[..., 3:]).astype(np.float32)

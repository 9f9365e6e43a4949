"""Write a panorama of a sky with sun and clouds: python docs/examples/sky.py sky.hdr"""

import sys

import cv2
import numpy as np

HEIGHT = 256
SUN, SUN_SIZE = np.array([-0.50, 0.62, 0.60]), 0.0055
"""Towards the sun, y up, and the radius of its disc, radians."""
SUNLIGHT = np.array([3.4, 3.0, 2.4])
"""What it gives a surface that faces it."""


def clouds(places: np.ndarray) -> np.ndarray:
    """Smooth noise of a plane (H, W, 2) in five octaves, about 0."""
    total, rng = np.zeros(places.shape[:2]), np.random.default_rng(4)
    for octave in range(5):
        values = rng.uniform(-1, 1, (64, 64)).astype(np.float32)
        at = (places * 2**octave % 64).astype(np.float32)
        total += cv2.remap(values, at[..., 0], at[..., 1], cv2.INTER_CUBIC,
                           borderMode=cv2.BORDER_WRAP) / 2**octave  # fmt: skip
    return total


def sky() -> np.ndarray:
    """(HEIGHT, 2 HEIGHT, 3) linear radiance; -z in the middle, as scene.yaml takes it."""
    across, down = (np.arange(n) + 0.5 for n in (2 * HEIGHT, HEIGHT))
    turn, polar = np.meshgrid((across / (2 * HEIGHT) - 0.5) * 2 * np.pi, down / HEIGHT * np.pi)
    d = np.stack([np.sin(turn) * np.sin(polar), np.cos(polar), -np.cos(turn) * np.sin(polar)], -1)
    up = np.maximum(d[..., 1:2], 0.0)
    towards_sun = (d @ (SUN / np.linalg.norm(SUN)))[..., None]
    blue, haze = np.array([0.18, 0.36, 0.80]), np.array([0.80, 0.85, 0.90])
    made = blue + (haze - blue) * (1 - up) ** 4
    made = made + np.array([1.2, 1.0, 0.7]) * np.maximum(towards_sun, 0) ** 40
    cover = clouds(d[..., [0, 2]] / (up + 0.12) * 1.5 + 32)[..., None]
    cover = np.clip(1.6 * cover - 0.1, 0, 1) * np.clip(up * 6, 0, 1)
    made = made + cover * (np.array([1.1, 1.1, 1.12]) - made)
    ground = np.array([0.20, 0.19, 0.16])
    made = np.where(d[..., 1:2] < 0, ground + (haze * 0.6 - ground) * (1 + d[..., 1:2]) ** 12, made)
    # The sun's light, on the texels that its disc covers, one at least.
    angles = np.sin(polar) * (np.pi / HEIGHT) ** 2
    disc = towards_sun[..., 0] >= min(np.cos(SUN_SIZE), towards_sun.max())
    made[disc] += SUNLIGHT / angles[disc].sum()
    return made.astype(np.float32)


if __name__ == "__main__":
    cv2.imwrite(sys.argv[1], sky()[..., ::-1])

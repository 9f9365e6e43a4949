"""A sphere on a checked floor: the smallest scene that shows depth, for quick trials."""

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Parts, textured
from lfcore.scene.procedural.primitives import rectangle
from lfcore.scene.procedural.turned import sphere as ball

MOST_SEGMENTS = 4096
"""The most segments: 16 million triangles."""


def build(seed: int, *, segments: int = 96) -> Parts:
    """A speckled sphere standing on the origin of a checked floor; ``seed`` draws the speckles."""
    if not 3 <= segments <= MOST_SEGMENTS:
        raise SceneError(f"must be from 3 to {MOST_SEGMENTS}, not {segments}", key="segments")
    skin = textures.speckle(seed, ((150, 40, 30), (226, 120, 60), (246, 220, 170)), cells=(6, 12))
    red = textured("sphere", skin, 0.4, 80.0)
    board = np.full((128, 128, 3), 228, np.uint8)
    board[:64, :64] = board[64:, 64:] = (58, 74, 96)
    floor = textured("floor", board)
    rings = max(2, segments // 2)
    return [
        ball(1.0, red, segments=segments, rings=rings).at(0, 1.0, 0),
        rectangle((-10, 0, 6), (20, 0, 0), (0, 0, -26), floor, repeat=0.5),
    ]

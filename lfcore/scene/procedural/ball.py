"""A beach ball about the origin, to be thrown through a scene."""

from lfcore.scene.procedural import toys
from lfcore.scene.procedural.basics import Parts


def build(seed: int) -> Parts:
    """Six gores in six colours; the radius is 0.13 m, and ``seed`` turns it."""
    return [toys.ball(seed).at(0, -0.13, 0)]

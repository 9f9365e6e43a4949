"""A scene that moves, without a file."""

import dataclasses

import numpy as np

import lfcore
from lfcore.scene.motion import Animation

SQUARE = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]])


def moving_squares():
    """Two squares; for a second the nearer one moves 1 m per second to the right."""
    triangles = np.concatenate([SQUARE * 0.3 + [-0.4, 0, 2], SQUARE * 2 + [0, 0, 4]])
    colours = np.random.default_rng(1).random((4, 3, 3)) * 0.8
    camera = lfcore.Camera(0.1, 0.08, 1.0, 2.5)
    still = lfcore.Scene.from_triangles(triangles, colours=colours, camera=camera)

    def at(now, time):
        moved = now.triangles.copy()
        moved[:2, :, 0] += np.float32(time)
        return dataclasses.replace(now, triangles=moved)

    return dataclasses.replace(still, animation=Animation(0.0, 1.0, at))

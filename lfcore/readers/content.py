"""What a mesh file brings into a scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from lfcore.scene.appearance import Light
from lfcore.scene.framing import FoundCamera
from lfcore.scene.surface_mesh import SurfaceMesh


class Played(NamedTuple):
    """An animation, from ``start_s`` to ``end_s``: the content at an instant.

    It has the same parts, lights and camera, of the same surfaces, elsewhere.
    """

    start_s: float
    end_s: float
    at: Callable[[float], Content]


class Content(NamedTuple):
    """Parts, lights and the camera of a file, in its own coordinates, metres; of an animation when
    it begins."""

    parts: list[SurfaceMesh]
    lights: Sequence[Light] = ()
    camera: FoundCamera | None = None
    animation: Played | None = None

"""What a mesh file brings into a scene."""

from collections.abc import Sequence
from typing import NamedTuple

from lfcore.scene.appearance import Light
from lfcore.scene.framing import FoundCamera
from lfcore.scene.surface_mesh import SurfaceMesh


class Content(NamedTuple):
    """Parts, lights and the camera of a file, in its own coordinates, metres."""

    parts: list[SurfaceMesh]
    lights: Sequence[Light] = ()
    camera: FoundCamera | None = None

"""The random draws of shapes and of their poses, for all kinds of scenes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lfcore.datasets.looks import Looks
from lfcore.datasets.shapes import Shape, builder, mesh
from lfcore.optics.camera import Camera
from lfcore.scene.transforms import rotate, translate


class Draw(Looks):
    """The random draws of one scene, in world space: y is up."""

    def field(self, camera: Camera) -> np.ndarray:
        """Return width and height of what the camera sees at a distance of 1 m."""
        size = self.description.size
        return camera.field_width * np.array(size) / size.shorter

    def shape(self, among: Sequence[str] = ()) -> Shape:
        """Draw a mesh, or a procedural shape of the description, if possible ``among`` these."""
        names: Sequence[str] = self.description.shapes.builders
        names = [name for name in names if name in among] or names
        if self.meshes and (not names or self.chance(self.description.shapes.share_of_meshes)):
            return self.picked(mesh, self.meshes)
        return builder(self.pick(names))

    def pose_at_rest(self, shape: Shape) -> np.ndarray:
        """Draw a pose on y = 0, turned about the vertical axis through the sphere's middle."""
        along = np.cumsum(shape.shares / shape.shares.sum())
        pose = shape.poses[min(int(np.searchsorted(along, self.rng.random())), len(along) - 1)]
        turn = rotate("y", 360 * float(self.rng.random()))
        return turn @ translate(-pose[0, 3], 0, -pose[2, 3]) @ pose

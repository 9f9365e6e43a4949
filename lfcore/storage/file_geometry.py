"""The geometry of a light field file, as its metadata have it, and what pictures need of it."""

from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray
from lfcore.optics.grid_geometry import GIVE_GEOMETRY
from lfcore.optics.slab import Extent, Slab
from lfcore.storage.depth_stream import StoredDepth
from lfcore.storage.layout import FrameLayout
from lfcore.storage.metadata import Metadata

FARTHEST_SURFACE = 0.9
"""The inverse depth below which a ray is a miss, relative to that of the farthest surface: the
codec blurs surfaces into the misses around them."""


class FileGeometry:
    """Geometry, grid and depths of a light field file.

    Attributes
    ----------
    path : Path
        The file, or a :class:`lfcore.storage.remote.RemoteFile`.
    metadata : Metadata
        The file's metadata; of a film those of this instant.
    """

    path: Path
    metadata: Metadata

    @property
    def layout(self) -> FrameLayout:
        """The positions of rays in frames."""
        return self.metadata.layout

    @property
    def slab(self) -> Slab | None:
        """The slab, or the slab with the rays of the camera array; None if there is none."""
        return self.metadata.slab or (self.array.as_slab() if self.array else None)

    def require_slab(self) -> Slab:
        """The slab; raises :class:`OpticsError` for a camera array that is no slab."""
        if self.slab is None:
            problem = "holds a camera array that is no slab"
            raise OpticsError(problem, file=self.path, remedy="Use lfcore imgtool lightfield")
        return self.slab

    @property
    def displaced(self) -> bool:
        """Whether each view is displaced within a pixel against all others."""
        depth = self.metadata.depth
        return depth is not None and depth.displaced

    def require_grid(self) -> Slab:
        """The slab; raises :class:`OpticsError` for displaced views, which are no grid."""
        if self.displaced:
            problem = "has displaced views, which only pictures by depth can use"
            remedy = "Use the filter 'depth', or record it with views that are not displaced"
            raise OpticsError(problem, file=self.path, remedy=remedy)
        return self.require_slab()

    def require_depth(self) -> StoredDepth:
        """The description of the stream of depths; raises :class:`OpticsError` without one."""
        if self.metadata.depth is None:
            problem = "holds no depth"
            remedy = "Record it with depth, or use the filter 'nearest'"
            raise OpticsError(problem, file=self.path, key="filter", remedy=remedy)
        return self.metadata.depth

    @property
    def array(self) -> CameraArray | None:
        """The camera array; None for a slab."""
        return self.metadata.camera_array

    @property
    def white(self) -> float:
        """The linear light of the brightest code: 1, or more for a brighter camera array."""
        return self.metadata.white

    @property
    def extent(self) -> Extent:
        """The stored views and pixels, within the smallest squares that contain them."""
        n, m = self.layout.views, self.layout.pixels
        slab = self.metadata.slab
        return slab.held if slab else Extent((0, 0, n, n), (0, 0, m, m))

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row of the first pixel in the layout's pictures."""
        slab = self.metadata.slab
        return self.layout.corner(slab) if slab else (0, 0)

    @property
    def grid(self) -> tuple[int, int]:
        """Columns and rows of views."""
        return self.extent.views[2:]

    @property
    def picture_size(self) -> tuple[int, int]:
        """Width and height of a view, pixels."""
        return self.extent.pixels[2:]

    @property
    def content(self) -> dict:
        """Facts beside the geometry; see :class:`Metadata`."""
        return self.metadata.content

    @property
    def depth_range(self) -> tuple[float, float] | None:
        """The nearest and farthest visible depth, metres; None if the file lacks it."""
        ends = self.content.get("depth_m")
        return tuple(ends) if ends else None

    @property
    def seen_range(self) -> tuple[float, float] | None:
        """The :attr:`depth_range` without a floor that was added under a mesh."""
        ends = self.content.get("seen_m")
        return tuple(ends) if ends else self.depth_range

    @property
    def metric(self) -> bool:
        """Whether lens, focus and distances are known; else only disparities have a meaning."""
        return bool(self.content.get("metric", True))

    def require_metric(self, key: str) -> None:
        """Raise :class:`OpticsError` naming ``key`` if distances and f-numbers are unknown."""
        if not self.metric:
            problem = "has no camera geometry: distances and f-numbers are unknown"
            remedy = f"Focus by disparity and stop down by views. {GIVE_GEOMETRY}"
            raise OpticsError(problem, file=self.path, key=key, remedy=remedy)

    @property
    def made_views(self) -> Slab:
        """The slab of the plain views that depth makes from displaced views; else the file's."""
        slab, depth = self.require_slab(), self.metadata.depth
        return slab.resized(depth.pixels) if depth and self.displaced else slab

    @property
    def views_to_serve(self) -> int:
        """The views per side that the file was recorded for; it may store fewer, with depth."""
        return int(self.content.get("views") or max(self.grid))

    def metres(self, inverse: np.ndarray) -> np.ndarray:
        """Convert the file's inverse depths, 1/m, to depths; infinity for a miss."""
        least = FARTHEST_SURFACE / self.depth_range[1] if self.depth_range else 0.0
        with np.errstate(divide="ignore"):
            return np.where(inverse > least, 1.0 / inverse, np.inf)

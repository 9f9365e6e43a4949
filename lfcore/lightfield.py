"""Light fields that can be refocused: one call from a file to a picture.

import lfcore
picture = lfcore.LightField.open("lightfield.mkv").refocus(focus_m=3.2, f_number=2.8)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import OpticsError, check_known
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.optics.slab import Extent, Slab
from lfcore.progress import Progress
from lfcore.refocus.field_planes import FieldPlanes
from lfcore.refocus.focal_stack import focal_stack
from lfcore.refocus.free_views import FreeViews, views_at
from lfcore.refocus.from_views import store_arrays
from lfcore.refocus.labelled import labelled_views
from lfcore.refocus.resampling import FILTERS
from lfcore.refocus.shift_sum import shift_sum
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.stored_depth import picture_side, slice_stored
from lfcore.refocus.stored_views import read_views
from lfcore.storage.codecs import Encoding

if TYPE_CHECKING:  # what most uses of a file do without is imported where it is used
    import xarray

    from lfcore.scene.model import Scene
    from lfcore.viewer.page import ViewerPage

METHODS = {"slicing": ("bilinear", "shift-sum"), "shift-sum": ("depth", "slicing")}
"""The methods, each with the filter that it lacks and the method that has it."""
MOST_PLANES = 100


class LightField(FieldPlanes):
    """A light field file: its geometry, its rays, and pictures made of them.

    Made by :meth:`open`, :meth:`from_views`, :func:`lfcore.record` and
    :func:`lfcore.import_lightfield`.  It pickles by path.
    """

    @classmethod
    def from_views(
        cls,
        views: np.ndarray,
        geometry: Camera | CameraArray | float,
        path: str | Path,
        *,
        encoding: Encoding | None = None,
        scene: Scene | None = None,
        name: str | None = None,
        white: float | None = None,
        progress: Progress | None = None,
    ) -> LightField:
        """Store views as a light field file.

        Parameters
        ----------
        views : ndarray
            (rows, columns, height, width, 3): floats are linear light, uint8 and uint16 sRGB codes.
            Row 0 is the top camera, column 0 the leftmost.  Of a :class:`CameraArray` also the
            mosaic that :func:`lfcore.trace_array` returns.
        geometry : Camera, CameraArray or float
            A lens whose samples the views are; parallel cameras; or the metres between neighbouring
            views, where nothing else is known: then refocus by disparity.
        path : str or Path
            The file to write, ``.mkv``.
        encoding : Encoding, optional
            How the views are stored; with ``ffv1``, uint8 codes are kept exactly.
        scene : Scene, optional
            The scene that the views show, for :meth:`depth` and exports with depth.
        name : str, optional
            Default: the scene's, else the file's.
        white : float, optional
            Of a :class:`CameraArray`: light that the brightest code stands for; more is clipped.
            Default: the brightest of the views, and at least 1.
        progress : callable, optional
            Called with (views done, of all).

        Returns
        -------
        LightField
            The file, opened.

        Raises
        ------
        OpticsError
            Views of another shape, or light that the file cannot hold.
        StorageError
            The codec does not take the settings, or the file cannot be written.
        """
        store_arrays(
            Path(path), views, geometry, encoding, scene=scene, name=name, white=white,
            progress=progress,
        )  # fmt: skip
        return cls.open(path)

    def to_xarray(self, *, codes: bool = False) -> xarray.DataArray:
        """Label all views as a lazy array with named dimensions.

        Parameters
        ----------
        codes : bool
            Give the stored sRGB codes.

        Returns
        -------
        xarray.DataArray
            Dimensions ``row``, ``column``, ``y``, ``x``, ``channel``: float32 linear light, or
            uint8 codes.  One dask chunk per segment of the file, which is decoded when computed.
            Of displaced views those that the file is for, a chunk per row, made by depth.

        Raises
        ------
        LfcoreError
            Package xarray or dask is not installed.
        """
        return labelled_views(self, codes=codes)

    def refocus(
        self,
        focus_m: float | str | None = None,
        f_number: float | None = None,
        aperture: str = "circle",
        *,
        focus_at: Sequence[float] | None = None,
        blur: float | str | None = None,
        disparity_px: float | None = None,
        aperture_views: float | None = None,
        method: str | None = None,
        filter: str | None = None,
        pixels: Pixels | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make one picture.

        Parameters
        ----------
        focus_m, f_number, aperture, focus_at, blur, disparity_px, aperture_views : optional
            As in :meth:`plane`, which has more settings.
        method, filter, pixels, device, progress : optional
            As in :meth:`refocus_many`.

        Returns
        -------
        ndarray
            (height, width, 3) float32, linear light.

        Raises
        ------
        OpticsError
            The light field does not hold such a picture.
        StorageError
            The file is damaged.
        """
        plane = self.plane(
            focus_m, f_number, aperture, focus_at=focus_at, blur=blur,
            disparity_px=disparity_px, aperture_views=aperture_views,
        )  # fmt: skip
        return self.refocus_many(
            [plane], method=method, filter=filter, pixels=pixels, device=device,
            progress=progress,
        )[0]  # fmt: skip

    def refocus_many(
        self,
        planes: Sequence[SensorPlane],
        *,
        method: str | None = None,
        filter: str | None = None,
        pixels: Pixels | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make up to 100 pictures from one pass over the file.

        Parameters
        ----------
        planes : sequence of SensorPlane
            What :meth:`plane` returns, one per picture.
        method : str, optional
            ``slicing`` (Algorithm 4), which has the nearest filter only, or ``shift-sum``
            (equation 6.1).  Default: slicing where the filter is the nearest.
        filter : str, optional
            ``depth`` spreads each ray over the part of the picture that its part of the lens
            sweeps, as :func:`lfcore.render` does: the default where the file holds depth.
            ``nearest``, the default else, or ``bilinear``.
        pixels : int or (int, int), optional
            The longer side, or width and height.  Default: by depth the pixels that the file was
            traced for, else those of its views.  Slicing adds rays to pictures coarser than the
            views by their exact place.
        device : Device or str, optional
            An open device, or part of its name.
        progress : callable, optional
            Called with (frames done, of all).

        Returns
        -------
        ndarray
            (P, height, width, 3) float32, linear light.

        Raises
        ------
        OpticsError
            The light field does not hold such a picture, or the method lacks the filter.
        StorageError
            The file is damaged.
        """
        self.require_slab()
        if filter is None:
            filter = "depth" if self.metadata.depth and method is None else "nearest"
        if filter != "depth":
            check_known(OpticsError, "filter", filter, FILTERS)
        method = method or ("shift-sum" if filter == "bilinear" else "slicing")
        check_known(OpticsError, "method", method, METHODS)
        lacks, other = METHODS[method]
        if filter == lacks:
            remedy = f"Use the method {other}"
            raise OpticsError(f"{method} has no {filter} filter", key="filter", remedy=remedy)
        if not 1 <= len(planes) <= MOST_PLANES:
            problem = f"{len(planes)} planes were asked for"
            remedy = f"Ask for 1 to {MOST_PLANES} at a time"
            raise OpticsError(problem, file=self.path, remedy=remedy)
        if filter == "depth":
            return slice_stored(self, planes, pixels, device=device, progress=progress)
        if pixels is not None:
            side = picture_side(self, pixels)
            planes = [replace(plane, pixels=side) for plane in planes]
        if method == "shift-sum":
            pictures = shift_sum(self, planes, filter=filter, device=device, progress=progress)
        else:
            pictures = form_planes(self, planes, device=device, progress=progress).sums.pictures()
        return pictures if self.white == 1.0 else pictures * np.float32(self.white)

    def stack(
        self,
        focus_m: Sequence[float] | None = None,
        f_numbers: Sequence[float] | None = None,
        aperture: str = "circle",
        *,
        focus_at: Sequence[float] | None = None,
        blur: float | str | None = None,
        disparity_px: float | None = None,
        aperture_views: float | None = None,
        fast: bool = False,
        filter: str | None = None,
        pixels: Pixels | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make a focal stack, an aperture stack or both from one pass over the file.

        Parameters
        ----------
        focus_m : sequence of float, optional
            Focus distances in metres.  Default: as recorded.
        f_numbers : sequence of float, optional
            Default: the whole lens.
        aperture, focus_at, blur, disparity_px, aperture_views : optional
            As in :meth:`plane`, for all pictures.
        fast : bool
            Add the views in blocks first: many pictures of one aperture at the cost of a few,
            within half a pixel of blur at the rim of the lens.  Takes neither filter nor pixels.
        filter, pixels, device, progress : optional
            As in :meth:`refocus_many`.

        Returns
        -------
        ndarray
            (P, height, width, 3) float32, linear light: for each distance every f-number, in their
            order.

        Raises
        ------
        OpticsError
            The light field does not hold such a picture.
        StorageError
            The file is damaged.

        Notes
        -----
        Source: thesis, figures 4.2 to 4.4; for ``fast`` :mod:`lfcore.refocus.focal_stack`.
        """
        planes = [
            self.plane(
                distance, f_number, aperture, focus_at=focus_at, blur=blur,
                disparity_px=disparity_px, aperture_views=aperture_views,
            )
            for distance in _values(focus_m)
            for f_number in _values(f_numbers)
        ]  # fmt: skip
        if fast:
            for key, value in (("filter", filter), ("pixels", pixels)):
                if value is not None:
                    problem = "a fast stack has its own filter, and the views' pixels"
                    remedy = "Leave it out, or leave out fast"
                    raise OpticsError(problem, file=self.path, key=key, remedy=remedy)
            return focal_stack(self, planes, device=device, progress=progress)
        return self.refocus_many(
            planes, filter=filter, pixels=pixels, device=device, progress=progress
        )

    def views_at(
        self,
        points_m: np.ndarray,
        pixels: Pixels | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make views from any points of the lens, between the stored ones, of a file with depth.

        Parameters
        ----------
        points_m : array_like
            (K, 2) metres: s to the right and t down.
        pixels : int or (int, int), optional
            The longer side, or width and height.  Default: as the file was traced for.
        device, progress : optional
            As in :meth:`refocus_many`; progress counts views.

        Returns
        -------
        ndarray
            (K, height, width, 3) float32, linear light, all in focus.

        Raises
        ------
        OpticsError
            Points outside the lens, a file without depth, or too many rays to hold.
        StorageError
            The file is damaged.
        """
        return views_at(self, points_m, pixels, device=device, progress=progress)

    def depth(
        self,
        scene: Scene | None = None,
        samples: np.ndarray | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Give the depth of views: that of the file, of few bits, or traced again and exact.

        Parameters
        ----------
        scene : Scene, optional
            The scene that was recorded, to trace it; it is not compared.
        samples : array_like, optional
            (K, 2) integer lens samples (i, j).  Default: all, row by row.
        device, progress : optional
            As in :meth:`refocus_many`; progress counts views.

        Returns
        -------
        ndarray
            (K, height, width) float32, metres along the axis, infinity for a miss; see
            :func:`lfcore.rendering.depth.disparity` for pixels.

        Raises
        ------
        OpticsError
            Samples outside the lens, or neither a scene nor depth in the file.
        """
        from lfcore.rendering.depth import check_samples, depth_of_views
        from lfcore.rendering.prepared import open_dark_tracer

        slab = self.made_views
        if scene is None:
            return self._stored_depth(check_samples(slab, samples), progress)
        return depth_of_views(open_dark_tracer(scene, device), slab, samples, progress=progress)

    def _stored_depth(self, samples: np.ndarray, progress: Progress | None) -> np.ndarray:
        if self.metadata.depth is None:
            raise self._needs_scene()
        views, lens = FreeViews(self), self.made_views.lens_positions()
        depth = np.empty((len(samples), *self.made_views.size[::-1]), np.float32)
        for number, point in enumerate(lens[samples]):
            depth[number] = self.metres(views.inverse_depth(point))
            if progress:
                progress(number + 1, len(samples))
        return depth

    def _needs_scene(self) -> OpticsError:
        return OpticsError("holds no depth", file=self.path, key="scene", remedy="Give the scene")

    def all_in_focus(
        self,
        scene: Scene | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make a picture with every point in focus, averaged over all views that see it.

        A file with depth is enough: it gives the view from the middle of the lens.

        Parameters
        ----------
        scene : Scene, optional
            The scene that was recorded, for a file without depth; it is not compared.
        device, progress : optional
            As in :meth:`refocus_many`; progress counts views.

        Returns
        -------
        ndarray
            (height, width, 3) float32, linear light, as of
            :func:`lfcore.rendering.depth.all_in_focus`.
        """
        from lfcore.rendering.depth import all_in_focus, all_samples, depth_of_views
        from lfcore.rendering.prepared import open_dark_tracer

        if self.metadata.depth is not None:
            return self.views_at(np.zeros((1, 2)), device=device, progress=progress)[0]
        if scene is None:
            raise self._needs_scene()
        slab, tracer = self.require_grid(), open_dark_tracer(scene, device)
        alone = Extent((0, 0, 1, 1), slab.held.pixels)
        centre = depth_of_views(tracer, Slab(slab.camera, 1, slab.pixels, alone))[0]
        everything = all_samples(slab)
        # Macropixels are decoded whole for each group of views: few, large groups.
        step = max(1, (1 << 26) // math.prod(slab.size))

        def groups() -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
            for start in range(0, len(everything), step):
                samples = everything[start : start + step]
                light = read_views(self, samples, device=tracer.device)
                yield samples, light, depth_of_views(tracer, slab, samples)
                if progress:
                    progress(start + len(samples), len(everything))

        picture = all_in_focus(slab, centre, groups())
        return picture if self.white == 1.0 else picture * np.float32(self.white)

    def viewer(
        self,
        *,
        grid: int | None = None,
        pixels: int | None = None,
        format: str | None = None,
        jpeg_quality: int | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> ViewerPage:
        """Make a page for the browser, to look around, focus and stop down.

        Parameters
        ----------
        grid, pixels : int, optional
            Views per side, and pixels of a picture's longer side.
        format : str
            ``jpeg``, ``avif`` or ``webp``.  Default: ``webp`` of a file with depth, else ``jpeg``.
        jpeg_quality : int
            The quality of the pictures' encoder, 1 to 100.  Default: 90, and of a file with
            depth by the views' error.
        device, progress : optional
            As in :meth:`refocus_many`.

        Returns
        -------
        ViewerPage
            A notebook shows it in a frame; ``save(path)`` writes it.
        """
        from lfcore.viewer.page import viewer_page

        return viewer_page(self, grid, pixels, format, jpeg_quality, device, progress)


def _values(setting: Sequence | np.ndarray | None) -> list:
    """The values of a stack's setting; by default None, the recorded one."""
    if setting is None:
        return [None]
    return ([setting] if isinstance(setting, str) else list(setting)) or [None]

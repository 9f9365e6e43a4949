"""Light fields that can be refocused: one call from a file to a picture.

import lfcore
picture = lfcore.LightField.open("lightfield.mkv").refocus(focus_m=3.2, f_number=2.8)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.focus import (
    DepthRange,
    check_place,
    ends_of,
    exclude_twice,
    f_number_of_blur,
    focus_distance,
)
from lfcore.optics.planes import PlaneOptions, SensorPlane, check_keywords
from lfcore.optics.slab import Slab
from lfcore.refocus.focal_stack import focal_stack
from lfcore.refocus.free_views import inverse_depth, views_at
from lfcore.refocus.from_views import store_arrays
from lfcore.refocus.resampling import check_filter
from lfcore.refocus.shift_sum import shift_sum
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.stored_depth import slice_stored
from lfcore.refocus.views import read_views
from lfcore.rendering.depth import all_in_focus, all_samples, depth_of_views
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.storage.labelled import labelled_views
from lfcore.storage.lightfield import LightFieldFile
from lfcore.viewer.page import ViewerPage, viewer_page

if TYPE_CHECKING:
    import xarray

Progress = Callable[[int, int], None]

PLANE_KEYWORDS = ("focus_at", "blur", "disparity_px", "aperture_views")
"""The keywords of :meth:`LightField.plane` beside those of :class:`PlaneOptions`."""
FARTHEST = 0.9
"""The inverse depth that is a miss, at most: a share of that of the farthest surface."""
METHODS = ("slicing", "shift-sum")
MOST_PLANES = 100


class LightField(LightFieldFile):
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
        """All views as a lazy array with named dimensions.

        Parameters
        ----------
        codes : bool
            Give the stored sRGB codes.

        Returns
        -------
        xarray.DataArray
            Dimensions ``row``, ``column``, ``y``, ``x``, ``channel``: float32 linear light, or
            uint8 codes.  One dask chunk per segment of the file, which is decoded when computed.

        Raises
        ------
        LfcoreError
            xarray or dask is not installed.
        """
        return labelled_views(self, codes=codes)

    def plane(
        self,
        focus_m: float | str | None = None,
        f_number: float | None = None,
        aperture: str = "circle",
        *,
        focus_at: Sequence[float] | None = None,
        blur: float | str | None = None,
        disparity_px: float | None = None,
        aperture_views: float | None = None,
        **options: Unpack[PlaneOptions],
    ) -> SensorPlane:
        """The sensor plane of these settings.

        Parameters
        ----------
        focus_m : focus distance, metres; default the recorded one; ``math.inf`` allowed.
            ``"near"``, ``"middle"``, ``"far"`` or ``"40%"`` of the depth that the file holds.
        f_number : no wider than the lens; default the whole lens.
        aperture : ``circle``, ``square``, ``diamond`` or ``polygon`` (of ``blades`` corners, 6).
        focus_at : instead of a distance, a place (x, y) in the picture, from 0 to 1 from its upper
            left corner, of a file with depth: what the middle view shows there is in focus.
        blur : instead of an f-number, the diameter of the blur at the end of the file's depth that
            is more out of focus, a share of the picture's width: 0.03 or ``"3%"``.
        disparity_px : instead of a distance, pixels by which what is in focus moves from one view
            to the next; 0 as recorded, more is nearer.
        aperture_views : instead of an f-number, the aperture's diameter in views.
        rotation_deg : of a polygon, degrees.
        normalise : divide by the open aperture (default); else the picture dims as the lens stops
            down.
        keep_magnification : of the physical sensor, which moves when it is focused; default not.

        Raises :class:`OpticsError`, naming file and key, for what was not recorded.
        """
        slab = self.require_slab()
        check_keywords("LightField.plane", options)
        try:
            exclude_twice(focus_m=focus_m, focus_at=focus_at, disparity_px=disparity_px)
            exclude_twice(f_number=f_number, blur=blur, aperture_views=aperture_views)
            asked = {"focus_m": focus_m, "focus_at": focus_at, "f_number": f_number, "blur": blur}
            asked["keep_magnification"] = options.get("keep_magnification") or None
            for key, value in asked.items():
                if value is not None:
                    self.require_metric(key)
            distance = self._focus(focus_m, focus_at)
            if disparity_px is not None:
                distance = self.distance_of(disparity_px)
            if aperture_views is not None:
                f_number = self.f_number_of(aperture_views)
            elif blur is not None:
                f_number = f_number_of_blur(
                    blur, slab.camera.focal_length_m,
                    slab.camera.focus_m if distance is None else distance,
                    slab.camera.field_width, self._seen,
                )  # fmt: skip
            plane = SensorPlane.of(slab.camera, distance, f_number, aperture, **options)
            plane.check(slab)
            plane.lens_aperture(slab)
        except OpticsError as error:
            raise error.named(OpticsError, file=self.path) from None
        return plane

    def _focus(self, focus_m: float | str | None, place: Sequence[float] | None) -> float | None:
        """The focus distance in metres; None for the recorded one."""
        if place is not None:
            x, y = check_place(place)
            depth = self._middle_depth
            row, column = (min(int(share * len(depth)), len(depth) - 1) for share in (y, x))
            if math.isinf(depth[row, column]):
                raise OpticsError(
                    f"there is nothing at {x:g},{y:g} of the picture", key="focus_at",
                    remedy="Give a place where something is seen",
                )  # fmt: skip
            return float(depth[row, column])
        return None if focus_m is None else focus_distance(focus_m, self._seen)

    @cached_property
    def _middle_depth(self) -> np.ndarray:
        """(M, M) float64: the depth that the middle view shows, metres, infinity for a miss."""
        inverse = inverse_depth(self)
        # The codec leaves a little of the surfaces around in a miss.
        least = FARTHEST / self.depth_range[1] if self.depth_range else 0.0
        with np.errstate(divide="ignore"):
            return np.where(inverse > least, 1.0 / inverse, np.inf)

    @cached_property
    def _seen(self) -> DepthRange | None:
        """The ends of the depth that the middle view shows, as for a scene; of a file without
        depth the ends that it states."""
        if self.metadata.depth is not None:
            return ends_of(self._middle_depth[np.isfinite(self._middle_depth)])
        return DepthRange(*self.depth_range) if self.depth_range else None

    def refocus(
        self,
        focus_m: float | str | None = None,
        f_number: float | None = None,
        aperture: str = "circle",
        *,
        method: str | None = None,
        filter: str | None = None,
        pixels: int | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
        **more: Any,
    ) -> np.ndarray:
        """One picture, (M, M, 3) float32, linear light.

        Parameters
        ----------
        focus_m, f_number, aperture, more : what :meth:`plane` takes.
        method, filter, pixels, device, progress : what :meth:`refocus_many` takes.

        Raises
        ------
        OpticsError : the slab does not hold what is asked for.
        StorageError : the file is damaged.
        """
        check_keywords("LightField.refocus", more, PLANE_KEYWORDS)
        plane = self.plane(focus_m, f_number, aperture, **more)
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
        pixels: int | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """(P, M, M, 3) float32, linear light: up to 100 pictures from one pass over the file.

        Parameters
        ----------
        method : ``slicing`` (Algorithm 4), which has the nearest filter only, or ``shift-sum``
            (equation 6.1); default slicing where the filter is the nearest.
        filter : ``depth`` spreads each ray over what its part of the lens sweeps, as
            :func:`lfcore.render` does: the default where the file holds depth; ``nearest``, the
            default else, or ``bilinear``.
        pixels : M; default what the file was traced for by depth, and of its views else.  Slicing
            adds rays to pictures coarser than the views by their exact place.
        progress : called with (frames done, frames in all).
        """
        self.require_slab()
        if filter is None:
            filter = "depth" if self.metadata.depth and method is None else "nearest"
        method = check_method(method, filter)
        pictures = self._refocus(planes, method, filter, pixels, device, progress)
        return pictures if self.white == 1.0 else pictures * np.float32(self.white)

    def stack(
        self,
        focus_m: Sequence[float] | None = None,
        f_numbers: Sequence[float] | None = None,
        aperture: str = "circle",
        *,
        fast: bool = False,
        filter: str | None = None,
        pixels: int | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
        **more: Any,
    ) -> np.ndarray:
        """A focal stack, an aperture stack or both, from one pass over the file.

        Parameters
        ----------
        focus_m : focus distances, metres; default the recorded one.
        f_numbers : default the whole lens.
        aperture, more : what :meth:`plane` takes.
        fast : a focal stack of one aperture whose views are first added in blocks: many pictures
            for the price of a few, within half a pixel of blur at the rim of the lens.
        filter, pixels : what :meth:`refocus_many` takes.

        Returns
        -------
        (P, M, M, 3) float32, linear light: at each distance every f-number, in their order.

        Raises as :meth:`refocus`.  Source: thesis, figures 4.2 to 4.4; for ``fast`` see
        :mod:`lfcore.refocus.focal_stack`.
        """
        check_keywords("LightField.stack", more, PLANE_KEYWORDS)
        planes = [
            self.plane(distance, number, aperture, **more)
            for distance in _numbers(focus_m)
            for number in _numbers(f_numbers)
        ]
        if fast:
            for key, value in (("filter", filter), ("pixels", pixels)):
                if value is not None:
                    raise OpticsError(
                        "a fast stack has its own filter, and the views' pixels", file=self.path,
                        key=key, remedy="Leave it out, or leave out fast",
                    )  # fmt: skip
            return focal_stack(self, planes, device=device, progress=progress)
        return self.refocus_many(
            planes, filter=filter, pixels=pixels, device=device, progress=progress
        )

    def views_at(
        self,
        points_m: np.ndarray,
        pixels: int | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Views from any points of the lens, between those that are stored, of a file with depth.

        Parameters, result and errors as of :func:`lfcore.refocus.free_views.views_at`.
        """
        return views_at(self, points_m, pixels, device=device, progress=progress)

    def depth(
        self,
        scene: Scene,
        samples: np.ndarray | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Exact depth of views, traced anew: a file holds colours alone, or depths of few bits.

        Parameters
        ----------
        scene : what was recorded; nothing here can tell whether it is another.
        samples : (K, 2) integer, lens samples (i, j); default all, row by row.
        progress : called with (views done, of all).

        Returns
        -------
        (K, M, M) float32, metres along the axis, infinity for a miss; see
        :func:`lfcore.rendering.depth.disparity` for pixels.

        Raises :class:`OpticsError` for samples outside the lens.
        """
        tracer = open_tracer(scene, device)
        return depth_of_views(tracer, self.require_grid(), samples, progress=progress)

    def all_in_focus(
        self,
        scene: Scene,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """(M, M, 3) float32, linear light: every point in focus, averaged over all views that
        see it.  Parameters as :meth:`depth`; see :func:`lfcore.rendering.depth.all_in_focus`."""
        slab, tracer = self.require_grid(), open_tracer(scene, device)
        centre = depth_of_views(tracer, Slab(slab.camera, 1, slab.pixels))[0]
        everything = all_samples(slab)
        # Macropixels are decoded whole for each group of views: few, large groups.
        step = max(1, (1 << 26) // slab.pixels**2)

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
        format: str = "avif",
        jpeg_quality: int = 90,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> ViewerPage:
        """A page for the browser in which one looks around, focuses and stops down.

        A notebook shows it in a frame; ``save(path)`` writes it.  Parameters and errors as of
        :func:`lfcore.viewer.page.viewer_page`.
        """
        return viewer_page(
            self, grid=grid, pixels=pixels, format=format, jpeg_quality=jpeg_quality,
            device=device, progress=progress,
        )  # fmt: skip

    def distance_of(self, disparity_px: float) -> float:
        """Metres at which points move by that many pixels from one view to the next.

        The metres of the file's own slab: see :attr:`metric`.  Raises :class:`OpticsError` for a
        disparity beyond that of infinity.
        """
        slab = self.require_slab()
        step = slab.pixel_pitch / slab.lens_pitch_m
        delta = slab.camera.delta + disparity_px * step
        if abs(delta) < 1e-12 * step:
            return math.inf
        if not delta > 0:
            raise OpticsError(
                f"nothing has a disparity of {disparity_px:g} pixels: infinity has "
                f"{-slab.camera.delta / step:.4g}",
                file=self.path,
                key="disparity",
            )
        return 1.0 / delta

    def disparity_of(self, distance_m: float) -> float:
        """Pixels by which a point at that distance moves; see :meth:`distance_of`."""
        slab = self.require_slab()
        return (1.0 / distance_m - slab.camera.delta) * slab.lens_pitch_m / slab.pixel_pitch

    def f_number_of(self, aperture_views: float) -> float:
        """The f-number of an aperture that is so many views across."""
        slab = self.require_slab()
        if not 0 < aperture_views <= slab.views:
            raise OpticsError(
                f"must be more than 0 and at most {slab.views}, not {aperture_views:g}",
                file=self.path,
                key="aperture_views",
            )
        return slab.camera.focal_length_m / (aperture_views * slab.lens_pitch_m)

    def require_metric(self, key: str) -> None:
        """Raise :class:`OpticsError` where distances and f-numbers are not known."""
        if not self.metric:
            raise OpticsError(
                "does not hold its geometry: there are neither distances nor f-numbers",
                file=self.path,
                key=key,
                remedy="Focus by disparity, stop down by views, or import it again with "
                "--baseline, --field-of-view and --focus",
            )

    def _refocus(
        self,
        planes: Sequence[SensorPlane],
        method: str,
        filter: str,
        pixels: int | None,
        device: Device | str | None,
        progress: Progress | None,
    ) -> np.ndarray:
        if not 1 <= len(planes) <= MOST_PLANES:
            raise OpticsError(
                f"{len(planes)} planes were asked for",
                file=self.path,
                remedy=f"Ask for 1 to {MOST_PLANES} at a time",
            )
        if filter == "depth":
            return slice_stored(self, planes, pixels, device=device, progress=progress)
        if pixels is not None:
            planes = [replace(plane, pixels=pixels) for plane in planes]
        if method == "slicing" and self.require_slab().extent:
            method = "shift-sum"  # the same sums, and it knows of grids in part
        if method == "shift-sum":
            return shift_sum(self, planes, filter=filter, device=device, progress=progress)
        return form_planes(self, planes, device=device, progress=progress).sums.pictures()


def _numbers(given: Sequence[float] | np.ndarray | None) -> list[float] | list[None]:
    """The numbers of a stack; None for the one that is recorded."""
    found = [] if given is None else np.ravel(given).tolist()
    return found or [None]


def check_method(method: str | None, filter: str) -> str:
    """The method to use; :class:`OpticsError` for one that is unknown or lacks the filter."""
    if filter != "depth":
        check_filter(filter)
    method = method or ("shift-sum" if filter == "bilinear" else "slicing")
    if method not in METHODS:
        raise OpticsError(
            f"unknown method {method!r}", key="method", remedy=f"Use one of {METHODS}"
        )
    other = {"slicing": "bilinear", "shift-sum": "depth"}
    if filter == other[method]:
        remedy = "shift-sum" if method == "slicing" else "slicing"
        raise OpticsError(
            f"{method} has no {filter} filter", key="filter", remedy=f"Use the method {remedy}"
        )
    return method

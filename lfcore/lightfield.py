"""Light fields that can be refocused: one call from a file to a picture.

import lfcore
picture = lfcore.LightField.open("lightfield.mkv").refocus(focus_m=3.2, f_number=2.8)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import OpticsError, suggest_keywords
from lfcore.opencl.device import Device
from lfcore.optics.focus import blur_share, exclude_twice, f_number_of_blur
from lfcore.optics.lens import Lens
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.progress import Progress
from lfcore.refocus.focal_stack import focal_stack
from lfcore.refocus.forming import form_pictures
from lfcore.refocus.free_views import views_at
from lfcore.refocus.labelled import labelled_views
from lfcore.refocus.pulling import pulled
from lfcore.refocus.visible_depth import VisibleDepth, doubts
from lfcore.storage.lightfield import LightFieldFile

if TYPE_CHECKING:  # methods import what few programs need
    import xarray

    from lfcore.scene.model import Scene
    from lfcore.viewer.page import ViewerPage


class LightField(LightFieldFile):
    """A light field file: its geometry, its rays, and pictures made of them.

    From :meth:`open`, :meth:`from_views`, :func:`lfcore.record` or
    :func:`lfcore.import_lightfield`.  It pickles by path.

    Examples
    --------
    >>> import lfcore, numpy as np
    >>> views = np.full((3, 3, 8, 8, 3), 0.5, np.float32)
    >>> field = lfcore.LightField.from_views(views, 0.01, "grey.mkv")
    >>> field.grid, field.picture_size
    ((3, 3), (8, 8))
    >>> field.refocus(disparity_px=1.0).shape
    (8, 8, 3)
    """

    @cached_property
    def _visible(self) -> VisibleDepth:
        return VisibleDepth(self)

    @suggest_keywords
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
        blades: int = 6,
        rotation_deg: float = 0.0,
        normalise: str = "aperture",
        keep_magnification: bool = False,
        half: str | None = None,
        lens: Lens | str | Path | None = None,
    ) -> SensorPlane:
        """Describe one picture: its focus and aperture.

        Parameters
        ----------
        focus_m, f_number, aperture, focus_at, blur : optional
            As in :meth:`Scene.plane`, of the depth that the file shows; ``focus_at`` needs a file
            with depth.  Default: as recorded, with the whole lens, which is the widest.
        disparity_px : float, optional
            Instead of a distance: the disparity of points in focus, pixels per view; 0 is the
            recorded focus, more is nearer.
        aperture_views : float, optional
            Instead of an f-number: the aperture's diameter in views.
        blades, rotation_deg, normalise, keep_magnification, half, lens : optional
            As in :class:`SensorPlane`; a lens may be its file.

        Raises
        ------
        OpticsError
            The file does not contain such a picture; names file and key.
        """
        slab = self.require_slab()
        try:
            exclude_twice(focus_m=focus_m, focus_at=focus_at, disparity_px=disparity_px)
            exclude_twice(f_number=f_number, blur=blur, aperture_views=aperture_views)
            metric = {
                "focus_m": focus_m, "focus_at": focus_at, "f_number": f_number, "blur": blur,
                "keep_magnification": keep_magnification or None, "lens": lens,
            }  # fmt: skip
            for key in (key for key, value in metric.items() if value is not None):
                self.require_metric(key)
            distance = self._visible.focus(focus_m, focus_at)
            if disparity_px is not None:
                distance = self.distance_of(disparity_px)
            if aperture_views is not None:
                f_number = self.f_number_of(aperture_views)
            elif blur is not None:
                f_number = f_number_of_blur(
                    blur, slab.camera.focal_length_m,
                    slab.camera.focus_m if distance is None else distance,
                    slab.camera.field_width * (slab.size.shorter / slab.pixels),
                    self._visible.range,
                )  # fmt: skip
                if f_number < (1 - 1e-9) * slab.camera.f_number:
                    widest = f"f/{slab.camera.f_number:g}"
                    most = 100 * blur_share(blur) * f_number / slab.camera.f_number
                    problem = f"needs a lens of f/{f_number:.3g}, wider than {widest}"
                    remedy = f"Give at most {0.999 * most:.3g}%, or record a wider lens"
                    raise OpticsError(problem, key="blur", remedy=remedy)
            plane = SensorPlane.of(
                slab.camera, distance, f_number, aperture, blades=blades,
                rotation_deg=rotation_deg, normalise=normalise,
                keep_magnification=keep_magnification, half=half, lens=lens,
            )  # fmt: skip
            plane.check(slab)
            plane.lens_aperture(slab)
        except OpticsError as error:
            raise error.named(OpticsError, file=self.path) from None
        return plane

    def doubts(self, plane: SensorPlane) -> list[str]:
        """Report the limits of the file that a picture exceeds.

        Parameters
        ----------
        plane : SensorPlane
            From :meth:`plane`.

        Returns
        -------
        list of str
            A line each: no surface is in focus, or the views do not resolve the f-number.
        """
        return doubts(self, plane)

    def distance_of(self, disparity_px: float) -> float:
        """Convert a disparity, pixels per view, to a distance in metres.

        Distances of a file without geometry are nominal: see :attr:`metric`.  Raises
        :class:`OpticsError` for a disparity beyond infinity's.
        """
        slab = self.require_slab()
        step = slab.pixel_pitch / slab.lens_pitch_m
        delta = slab.camera.delta + disparity_px * step
        if abs(delta) < 1e-12 * step:
            return math.inf
        if not delta > 0:
            farthest = -slab.camera.delta / step
            problem = f"{disparity_px:g} pixels is less than the {farthest:.4g} of infinity"
            raise OpticsError(problem, file=self.path, key="disparity_px")
        return 1.0 / delta

    def disparity_of(self, distance_m: float) -> float:
        """Convert a distance in metres to a disparity, pixels per view.

        Raises :class:`OpticsError` for a distance that is not positive.
        """
        slab = self.require_slab()
        if not distance_m > 0:
            raise OpticsError(f"must be above 0, not {distance_m!r}", key="distance_m")
        return (1.0 / distance_m - slab.camera.delta) * slab.lens_pitch_m / slab.pixel_pitch

    def f_number_of(self, aperture_views: float) -> float:
        """Convert an aperture's diameter in views to an f-number.

        Raises :class:`OpticsError` for a diameter that is not positive or exceeds the lens.
        """
        slab = self.require_slab()
        if not 0 < aperture_views <= slab.views:
            problem = f"must be more than 0 and at most {slab.views}, not {aperture_views:g}"
            raise OpticsError(problem, file=self.path, key="aperture_views")
        return slab.camera.focal_length_m / (aperture_views * slab.lens_pitch_m)

    @suggest_keywords
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
            The file does not contain such a picture.
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

    @suggest_keywords
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
            One per picture, from :meth:`plane`.
        method : str, optional
            ``slicing`` (Algorithm 4), which lacks the bilinear filter, or ``shift-sum`` (equation
            6.1), which lacks depth.  Default: slicing, unless the filter is bilinear.
        filter : str, optional
            ``depth`` spreads each ray over the area of the picture that its share of the lens
            covers, as :func:`lfcore.render` does; the default for files with depth.  ``nearest``
            (the default for others), or ``bilinear``.
        pixels : int or (int, int), optional
            The longer side, or width and height.  Default: by depth the size that the file was
            recorded for, else the views' size.  Pictures coarser than the views need slicing.
        device : Device or str, optional
            An open device, or part of its name.
        progress : callable, optional
            Called with (frames done, total).

        Returns
        -------
        ndarray
            (P, height, width, 3) float32, linear light.

        Raises
        ------
        OpticsError
            The file does not contain such a picture, or the method lacks the filter.
        StorageError
            The file is damaged.
        """
        return form_pictures(
            self, planes, method=method, filter=filter, pixels=pixels, device=device,
            progress=progress,
        )  # fmt: skip

    @suggest_keywords
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
            As in :meth:`plane`, the same for all pictures.
        fast : bool
            Add the views in blocks first.  Many pictures of one aperture then cost as much as a
            few, with at most half a pixel more blur at the rim of the lens.  Takes neither filter
            nor pixels.
        filter, pixels, device, progress : optional
            As in :meth:`refocus_many`.

        Returns
        -------
        ndarray
            (P, height, width, 3) float32, linear light: for each distance every f-number, in the
            given order.

        Raises
        ------
        OpticsError
            The file does not contain such a picture.
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
            for distance in _values("focus_m", focus_m)
            for f_number in _values("f_numbers", f_numbers)
        ]  # fmt: skip
        if fast:
            if self.displaced:
                problem = "the views are displaced, so they cannot be added in blocks"
                remedy = "Leave it out, or record with depth='plain'"
                raise OpticsError(problem, file=self.path, key="fast", remedy=remedy)
            for key, value in (("filter", filter), ("pixels", pixels)):
                if value is not None:
                    problem = "a fast stack has its own filter, and the views' pixels"
                    remedy = "Leave it out, or leave out fast"
                    raise OpticsError(problem, file=self.path, key=key, remedy=remedy)
            return focal_stack(self, planes, device=device, progress=progress)
        return self.refocus_many(
            planes, filter=filter, pixels=pixels, device=device, progress=progress
        )

    @suggest_keywords
    def pull(
        self,
        keys: Sequence[tuple[float, SensorPlane | Sequence[float]]],
        *,
        filter: str | None = None,
        pixels: Pixels | None = None,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> Iterator[np.ndarray]:
        """Make a picture of each instant of a film, with a focus that is pulled over time.

        Parameters
        ----------
        keys : sequence of (float, SensorPlane or (float, float))
            Seconds, with the focus and aperture then, from :meth:`plane`; or with the point (s, t)
            of the lens, metres, from which everything is in focus.  Between keys dioptres, the
            aperture's diameter and the point change evenly; before the first and after the last
            they rest.
        filter, pixels, device : optional
            As in :meth:`refocus_many`.
        progress : callable, optional
            Called with (instants done, total).

        Yields
        ------
        ndarray
            (height, width, 3) float32, linear light.

        Raises
        ------
        OpticsError
            Times do not ascend, keys differ in more than focus and f-number, or the file does not
            contain a picture.
        StorageError
            The file is damaged.

        Examples
        --------
        >>> keys = [(0.0, field.plane("near")), (1.0, field.plane("far"))]
        >>> len(list(field.pull(keys)))
        1
        """
        return pulled(self, keys, filter=filter, pixels=pixels, device=device, progress=progress)

    @suggest_keywords
    def views_at(
        self,
        points_m: np.ndarray,
        pixels: Pixels | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make views from any points of the lens, between the stored ones; needs depth.

        Parameters
        ----------
        points_m : array_like
            (K, 2) metres: s to the right and t down.
        pixels : int or (int, int), optional
            The longer side, or width and height.  Default: as the file was recorded for.
        device, progress : optional
            As in :meth:`refocus_many`; progress counts views.

        Returns
        -------
        ndarray
            (K, height, width, 3) float32, linear light, with everything in focus.

        Raises
        ------
        OpticsError
            A point is outside the lens, or the file has no depth or too many rays for memory.
        StorageError
            The file is damaged.
        """
        return views_at(self, points_m, pixels, device=device, progress=progress)

    @suggest_keywords
    def depth(
        self,
        scene: Scene | None = None,
        samples: np.ndarray | None = None,
        *,
        virtual: bool = False,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Give the depth of views: the file's own, in 8 or 10 bits, or traced, which is exact.

        Parameters
        ----------
        scene : Scene, optional
            The recorded scene, which is traced; it is not compared with the file.
        samples : array_like, optional
            (K, 2) integer lens samples (i, j).  Default: all, row by row.
        virtual : bool
            Of mirrors, glass and coats the depth at which their images appear, not of the surface.
        device, progress : optional
            As in :meth:`refocus_many`; progress counts views.

        Returns
        -------
        ndarray
            (K, height, width) float32, metres along the axis, infinity for a miss;
            :func:`lfcore.disparity` converts it to pixels.  Pictures of :meth:`views_at` have the
            same pixels; :meth:`views` gives the recorded ones, by default twice as many per side.
            A file's own depth is of the nearest surface in a pixel's middle half.  Its video blurs
            a few pixels beside edges into depths between the two surfaces; ``ffv1`` does not.

        Raises
        ------
        OpticsError
            A sample is outside the lens, or there is neither a scene nor depth in the file.
        """
        from lfcore.rendering.field_depth import field_depth

        return field_depth(self, scene, samples, device, progress, virtual=virtual)

    @suggest_keywords
    def all_in_focus(
        self,
        scene: Scene | None = None,
        *,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Make a picture with every point in focus, averaged over all views that show it.

        A file with depth needs no scene: it gives the view from the middle of the lens.

        Parameters
        ----------
        scene : Scene, optional
            The recorded scene, for a file without depth; it is not compared with the file.
        device, progress : optional
            As in :meth:`refocus_many`; progress counts views.

        Returns
        -------
        ndarray
            (height, width, 3) float32, linear light.

        Raises
        ------
        OpticsError
            There is neither a scene nor depth in the file.
        """
        from lfcore.rendering.field_depth import field_in_focus

        return field_in_focus(self, scene, device, progress)

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
            uint8 codes.  One dask chunk per segment of the file; it is decoded when computed.
            Displaced views are replaced by the views that the file was recorded for, made by
            depth, one chunk per row.

        Raises
        ------
        LfcoreError
            Package xarray or dask is not installed.
        """
        return labelled_views(self, codes=codes)

    @suggest_keywords
    def viewer(
        self,
        *,
        grid: int | None = None,
        pixels: int | None = None,
        format: str | None = None,
        jpeg_quality: int | None = None,
        film: bool = True,
        device: Device | str | None = None,
        progress: Progress | None = None,
    ) -> ViewerPage:
        """Make a page for the browser, to look around, focus and stop down.

        Parameters
        ----------
        grid, pixels : int, optional
            Views per side, and pixels of a picture's longer side.
        format : str
            ``jpeg`` or ``webp``.  Default: ``webp`` for a file with depth, else
            ``jpeg``.
        jpeg_quality : int
            The quality of the pictures' encoder, JPEG or WebP, 1 to 100.  Default: 90; with
            depth, chosen by the views' error.
        film : bool
            Show all instants of a film, which plays; else this one.
        device, progress : optional
            As in :meth:`refocus_many`.

        Returns
        -------
        ViewerPage
            A notebook shows it in a frame; ``save(path)`` writes it.
        """
        from lfcore.viewer.page import viewer_page

        return viewer_page(self, grid, pixels, format, jpeg_quality, device, progress, film=film)


def _values(key: str, setting: Sequence | np.ndarray | float | None) -> list:
    """The values of a stack's setting; by default None, the recorded one."""
    if setting is None:
        return [None]
    values = [setting] if isinstance(setting, str) else list(np.atleast_1d(np.asarray(setting)))
    if not values:
        raise OpticsError("is empty", key=key, remedy="Give at least one, or leave it out")
    return values

"""Planes of a light field file: distances, f-numbers, disparities and diameters in views."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.focus import (
    DepthRange,
    check_place,
    check_words,
    ends_of,
    exclude_twice,
    f_number_of_blur,
    focus_distance,
)
from lfcore.optics.grid_geometry import GIVE_GEOMETRY
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.free_views import inverse_depth
from lfcore.storage.lightfield import LightFieldFile

FARTHEST = 0.9
"""The inverse depth that is a miss, at most: a share of that of the farthest surface."""
CLOSE = 1.1
"""The ratio of f-numbers that views should tell apart, and of a focus to the nearest surface."""


class FieldPlanes(LightFieldFile):
    """A light field file that describes the pictures that it can give."""

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
    ) -> SensorPlane:
        """Describe one picture: its focus and aperture.

        Parameters
        ----------
        focus_m : float or str, optional
            Focus distance in metres, ``math.inf`` allowed; ``"near"``, ``"middle"``, ``"far"`` or
            ``"40%"`` of the depth that the file holds.  Default: as recorded.
        f_number : float, optional
            No wider than the lens.  Default: the whole lens.
        aperture : str
            ``circle``, ``square``, ``diamond`` or ``polygon``.
        focus_at : (float, float), optional
            Instead of a distance, of a file with depth: focus on what the middle view shows at this
            place, x and y from 0 to 1 from the picture's upper left corner.
        blur : float or str, optional
            Instead of an f-number: the diameter of the blur at the end of the file's depth that is
            more out of focus, a share of the picture's shorter side, 0.03 or ``"3%"``.
        disparity_px : float, optional
            Instead of a distance: pixels by which points in focus move from one view to the next;
            0 as recorded, more is nearer.
        aperture_views : float, optional
            Instead of an f-number: the aperture's diameter in views.
        blades, rotation_deg, normalise, keep_magnification : optional
            As in :class:`SensorPlane`.

        Returns
        -------
        SensorPlane
            For :meth:`LightField.refocus_many`.

        Raises
        ------
        OpticsError
            The light field does not hold such a picture; names file and key.
        """
        slab = self.require_slab()
        try:
            exclude_twice(focus_m=focus_m, focus_at=focus_at, disparity_px=disparity_px)
            exclude_twice(f_number=f_number, blur=blur, aperture_views=aperture_views)
            asked = {"focus_m": focus_m, "focus_at": focus_at, "f_number": f_number, "blur": blur}
            asked["keep_magnification"] = keep_magnification or None
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
                    slab.camera.field_width * (slab.size.shorter / slab.pixels), self._seen,
                )  # fmt: skip
            plane = SensorPlane.of(
                slab.camera, distance, f_number, aperture, blades=blades,
                rotation_deg=rotation_deg, normalise=normalise,
                keep_magnification=keep_magnification,
            )  # fmt: skip
            plane.check(slab)
            plane.lens_aperture(slab)
        except OpticsError as error:
            raise error.named(OpticsError, file=self.path) from None
        return plane

    def doubts(self, plane: SensorPlane) -> list[str]:
        """Say what of a picture is beyond what the file holds.

        Parameters
        ----------
        plane : SensorPlane
            What :meth:`plane` returns.

        Returns
        -------
        list of str
            A line each: no surface is in focus, or the views cannot tell the f-number from others.
        """
        found, slab, aperture = [], self.require_slab(), plane.lens_aperture(self.require_slab())
        if self.metric and self.depth_range:
            near, far = self.depth_range
            if not near / CLOSE <= plane.focus_m <= far * CLOSE:
                found.append(
                    f"nothing is in focus at {plane.focus_m:.4g} m: what is seen is from "
                    f"{near:.4g} to {far:.4g} m"
                )
        if self.metadata.depth is None:
            lens = slab.lens_positions()
            wider, same, narrower = (
                replace(aperture, radius_m=aperture.radius_m * by).contains(lens, lens[:, None])
                for by in (CLOSE, 1.0, 1 / CLOSE)
            )
            if (wider == narrower).all():
                first, last = plane.f_number / CLOSE, plane.f_number * CLOSE
                found.append(
                    f"f/{first:.3g} to f/{last:.3g} give the same picture: {same.sum()} of "
                    f"{slab.views**2} views are open; depth, or more views, would tell them apart"
                )
        return found

    def _focus(self, focus_m: float | str | None, place: Sequence[float] | None) -> float | None:
        """The focus distance in metres; None for the recorded one."""
        if place is not None:
            x, y = check_place(place)
            depth = self._middle_depth
            row, column = (
                min(int(share * count), count - 1)
                for share, count in zip((y, x), depth.shape, strict=True)
            )
            if math.isinf(depth[row, column]):
                raise OpticsError(
                    f"there is nothing at {x:g},{y:g} of the picture", key="focus_at",
                    remedy="Give a place where something is seen",
                )  # fmt: skip
            return float(depth[row, column])
        if focus_m is None:
            return None
        is_word = isinstance(check_words(focus_m), str)
        return focus_distance(focus_m, self._seen if is_word else None)  # it may be decoded

    @cached_property
    def _middle_depth(self) -> np.ndarray:
        """(H, W) float64: the depth that the middle view shows, metres, infinity for a miss."""
        return self.metres(inverse_depth(self))

    def metres(self, inverse: np.ndarray) -> np.ndarray:
        """Depths of the file's inverse depths, 1/m; infinity for a miss."""
        # The codec leaves a little of the surfaces around in a miss.
        least = FARTHEST / self.depth_range[1] if self.depth_range else 0.0
        with np.errstate(divide="ignore"):
            return np.where(inverse > least, 1.0 / inverse, np.inf)

    @property
    def made_views(self) -> Slab:
        """The slab of the views that depth makes of displaced ones; else the file's own."""
        slab, depth = self.require_slab(), self.metadata.depth
        return slab.resized(depth.pixels) if depth and self.displaced else slab

    @property
    def views_to_serve(self) -> int:
        """Views per side that the file is for: those it was asked to give by depth, or its own."""
        return int(self.content.get("views") or max(self.grid))

    @cached_property
    def _seen(self) -> DepthRange | None:
        """The ends of the depth that the picture shows: those that the file states, as of a scene;
        else of its middle view, which is decoded; without depth, of all that is seen."""
        stated = self.content.get("ends_m") or self.content.get("seen_m")
        if stated is None and self.metadata.depth is not None:
            return ends_of(self._middle_depth[np.isfinite(self._middle_depth)])
        stated = stated or self.depth_range
        return DepthRange(*stated) if stated else None

    def distance_of(self, disparity_px: float) -> float:
        """Convert a disparity to a distance.

        Parameters
        ----------
        disparity_px : float
            Pixels by which points move from one view to the next.

        Returns
        -------
        float
            Metres, of the file's own slab: see :attr:`metric`.

        Raises
        ------
        OpticsError
            The disparity is beyond infinity's.
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
        """Convert a distance to a disparity.

        Parameters
        ----------
        distance_m : float
            Metres along the axis.

        Returns
        -------
        float
            Pixels by which points at that distance move from one view to the next.

        Raises
        ------
        OpticsError
            The distance is not above 0.
        """
        slab = self.require_slab()
        if not distance_m > 0:
            raise OpticsError(f"must be above 0, not {distance_m!r}", key="distance_m")
        return (1.0 / distance_m - slab.camera.delta) * slab.lens_pitch_m / slab.pixel_pitch

    def f_number_of(self, aperture_views: float) -> float:
        """Convert an aperture's diameter to an f-number.

        Parameters
        ----------
        aperture_views : float
            The diameter in views, above 0.

        Returns
        -------
        float
            The f-number.

        Raises
        ------
        OpticsError
            The aperture is wider than the lens.
        """
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
                remedy=f"Focus by disparity and stop down by views. {GIVE_GEOMETRY}",
            )

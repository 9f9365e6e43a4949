"""The input of an export: selected and cropped views of a light field file, and their geometry."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lfcore.colour import exposed, srgb_codes
from lfcore.exchange.reading import ExchangeError
from lfcore.lightfield import LightField
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.grid_geometry import GIVE_GEOMETRY, KnownGeometry
from lfcore.optics.size import Pixels
from lfcore.progress import Progress
from lfcore.refocus.free_views import FreeViews, served_positions
from lfcore.rendering.prepared import open_dark_tracer
from lfcore.scene.files import scene_digest
from lfcore.scene.model import Scene
from lfcore.tracing.tracer import Tracer

BAND_BYTES = 1 << 28
"""The most bytes of views that are decoded at a time."""
_ON_STEP = 1e-6
"""The tolerance of a distance that should be a multiple of the views' distance."""
View = tuple[int, int, np.ndarray]
"""Column, row and picture."""


@dataclass(frozen=True)
class Selection:
    """A choice of views and pixels.

    Parameters
    ----------
    views : (int, int), optional
        Columns and rows.  Default: all; with depth the number that the file was recorded for.
    baseline_m : float, optional
        Distance between neighbouring views, metres.  Default: the largest between the outermost
        recorded views.
    crop : (int, int, int, int), optional
        Left, top, width and height, pixels.
    pixels : int or (int, int), optional
        Longer side, or width and height, before the crop; needs depth.  Default: as the file was
        recorded for.
    exposure_ev, roll_off : float, bool
        As in :func:`lfcore.exposed`, before light is encoded.
    """

    views: tuple[int, int] | None = None
    baseline_m: float | None = None
    crop: tuple[int, int, int, int] | None = None
    pixels: Pixels | None = None
    exposure_ev: float = 0.0
    roll_off: bool = False

    def codes(self, light: np.ndarray) -> np.ndarray:
        """Encode linear light as uint8 sRGB."""
        return srgb_codes(exposed(light, self.exposure_ev, self.roll_off))


class Source:
    """The selected views of a light field file.

    Attributes
    ----------
    columns_m, rows_m : ndarray
        The cameras' positions, metres, y down.
    axis_px : (float, float)
        The optical axis in the picture of a camera at the origin, from the top left corner.
    geometry : KnownGeometry or None
        None if it is unknown.
    free : FreeViews or None
        Makes views by depth; None if stored views are selected.
    depth_given : bool
        Whether :meth:`depth` was called.
    """

    def __init__(
        self,
        field: LightField,
        selection: Selection,
        device: Device | None = None,
        scene: Scene | None = None,
    ):
        slab = field.slab
        if slab is None:
            problem = "holds a camera array that is no slab"
            remedy = "Write its pictures with lfcore imgtool tiles"
            raise ExchangeError(problem, file=field.path, remedy=remedy)
        self.field, self.selection, self.device = field, selection, device
        self.stride, self.depth_given = 1, False
        recorded = _chosen(selection, field)
        self.free: FreeViews | None = None
        if recorded is None:
            self.free = FreeViews(field, selection.pixels, device=device)
            slab = self.free.made
            self.columns_m, self.rows_m, self.pitch_m = _spread(selection, field)
        else:
            self._i, self._j, self.stride = recorded
            place, (column, row, _, _) = slab.lens_positions(), slab.held.views
            self.columns_m, self.rows_m = place[self._i + column], place[self._j + row]
            self.pitch_m = self.stride * slab.lens_pitch_m
        self.slab = slab
        self.columns, self.rows = len(self.columns_m), len(self.rows_m)
        width, height = slab.size
        left, top, across, down = selection.crop or (0, 0, width, height)
        if not (0 <= left < left + across <= width and 0 <= top < top + down <= height):
            problem = f"{across}x{down}+{left}+{top} is not within {width} x {height}"
            raise ExchangeError(problem, file=field.path, key="crop")
        self.left, self.top, self.width, self.height = left, top, across, down
        self._window = np.s_[top : top + down, left : left + across]
        first_column, first_row = slab.held.pixels[:2]
        half = slab.pixels / 2
        self.axis_px = (half - first_column - left, half - first_row - top)
        share = max(self.width, self.height) / slab.pixels
        self.geometry: KnownGeometry | None = None
        if field.metric:
            whole = KnownGeometry.of_slab(slab)
            self.geometry = replace(whole, pitch_m=self.pitch_m, sensor_m=whole.sensor_m * share)
        self.name = _word(str(field.metadata.scene.get("name") or field.path.stem))
        self._tracer: Tracer | None = None
        if scene is not None:
            self.require_geometry("its scene's depth")
            # The file of a pinhole camera has a fitted lens.
            digests = {scene_digest(each) for each in (scene, scene.with_lens())}
            if field.metadata.scene["digest"] not in digests:
                problem = f"is not the scene of {field.path}, {field.metadata.scene['name']!r}"
                remedy = "Give the scene as it was, or record it again"
                raise ExchangeError(problem, file=scene.name, key="scene", remedy=remedy)
            self._tracer, self._materials = open_dark_tracer(scene, device), scene.material_ids

    def require_geometry(self, user: str) -> KnownGeometry:
        """The geometry; raises :class:`ExchangeError` if it is unknown."""
        if self.geometry is None:
            problem = f"does not hold its geometry, which {user} needs"
            remedy = f"{GIVE_GEOMETRY}, or use another format"
            raise ExchangeError(problem, file=self.field.path, remedy=remedy)
        return self.geometry

    def views(self, progress: Progress | None = None) -> Iterator[View]:
        """Yield column, row and (height, width, 3) uint8 sRGB, row after row."""
        total = self.columns * self.rows
        bands = self._made() if self.free else self._bands()
        for done, (column, row, picture) in enumerate(bands, 1):
            yield column, row, np.ascontiguousarray(picture[self._window])
            if progress:
                progress(done, total)

    def _bands(self) -> Iterator[View]:
        """Stored views, by bands of rows; each band decodes all macropixels."""
        first, last = int(self._i[0]), int(self._i[-1])
        width, height = self.field.picture_size
        across = (last - first + 1) * width * height * 3
        step = max(1, BAND_BYTES // (across * self.stride))
        for start in range(0, self.rows, step):
            rows = self._j[start : start + step]
            place = first, int(rows[0]), last + 1, int(rows[-1]) + 1
            light = bool(self.selection.exposure_ev or self.selection.roll_off)
            part = self.field.views(*place, codes=not light)
            for k, line in enumerate(part[rows - rows[0]]):
                for column, picture in enumerate(line[self._i - first]):
                    yield column, start + k, self.selection.codes(picture) if light else picture

    def _made(self) -> Iterator[View]:
        """Views made by depth."""
        assert self.free is not None
        for row, column in np.ndindex(self.rows, self.columns):
            light = self.free.picture(self._point(column, row))
            yield column, row, self.selection.codes(light)

    def _point(self, column: int, row: int) -> np.ndarray:
        return np.array([self.columns_m[column], self.rows_m[row]])

    def array(self, progress: Progress | None = None) -> np.ndarray:
        """All views, (rows, columns, height, width, 3) uint8."""
        out = np.empty((self.rows, self.columns, self.height, self.width, 3), np.uint8)
        for column, row, picture in self.views(progress):
            out[row, column] = picture
        return out

    @property
    def has_depth(self) -> bool:
        """Whether every view has depth, the scene's or the file's."""
        return self._tracer is not None or self.field.metadata.depth is not None

    def depth(self, column: int, row: int) -> tuple[np.ndarray, np.ndarray | None]:
        """A view's depth and materials.

        Returns (height, width) float32 metres, infinity for a miss; and with the scene (height,
        width) uint16, the material's number plus one, 0 for a miss, else None.
        """
        self.depth_given, point = True, self._point(column, row)
        if self._tracer is not None:
            place = point[None] / self.slab.lens_pitch_m + (self.slab.views - 1) / 2
            triangle, depth = self._tracer.bundle_hits(bundles.views(self.slab, place))
            ids = np.where(triangle[0] < 0, 0, self._materials[triangle[0]] + 1)
            return depth[0][self._window], ids[self._window].astype(np.uint16)
        depth = self.field.metres(self._free_depths.inverse_depth(point))
        return depth[self._window].astype(np.float32), None

    @cached_property
    def _free_depths(self) -> FreeViews:
        return self.free or FreeViews(self.field, self.slab.pixels, device=self.device)

    def disparity(self, depth: np.ndarray) -> np.ndarray:
        """The disparity of depths, pixels per view of the selection."""
        scale = self.pitch_m / self.slab.pixel_pitch
        with np.errstate(divide="ignore"):
            apart = 1.0 / np.asarray(depth, np.float64) - self.slab.camera.delta
        return (apart * scale).astype(np.float32)

    def pose(self, column: int, row: int) -> np.ndarray:
        """A view's (4, 4) camera to world matrix with OpenGL's axes: x right, y up, z backwards."""
        matrix = np.eye(4)
        matrix[:2, 3] = self.columns_m[column], -self.rows_m[row]
        return matrix

    def centre(self, column: int, row: int) -> tuple[float, float]:
        """A view's principal point (cx, cy), from the top left corner."""
        slab = self.slab
        per_metre = slab.camera.delta / slab.pixel_pitch
        x = self.axis_px[0] + self.columns_m[column] * per_metre
        return x, self.axis_px[1] + self.rows_m[row] * per_metre

    @property
    def focal_px(self) -> float:
        """The focal length in pixels."""
        return 1.0 / self.slab.pixel_pitch


def _chosen(selection: Selection, field: LightField) -> tuple[np.ndarray, np.ndarray, int] | None:
    """The columns and rows of selected stored views, and their step; None for views by depth."""
    has_depth, slab = field.metadata.depth is not None, field.require_slab()
    recorded = None, slab.pixels, slab.size
    if field.displaced or (has_depth and selection.pixels not in recorded):
        return None
    if selection.pixels is not None and not has_depth:
        raise ExchangeError("needs a file with depth", file=field.path, key="pixels")
    try:
        i, j = (_stored(selection, axis, field) for axis in range(2))
    except ExchangeError:
        if has_depth:
            return None
        raise
    several = i if len(i) > 1 else j
    return i, j, int(several[1] - several[0]) if len(several) > 1 else 1


def _stored(selection: Selection, axis: int, field: LightField) -> np.ndarray:
    """The numbers of the selected stored views along one axis."""
    number = selection.views[axis] if selection.views else None
    count, slab = field.grid[axis], field.require_slab()
    step, remedy = 1, "record with depth, which gives any views"
    if selection.baseline_m is not None:
        field.require_metric("baseline_m")
        ratio = selection.baseline_m / slab.lens_pitch_m
        step = round(ratio)
        if step < 1 or abs(ratio - step) > _ON_STEP * max(1, ratio):
            raise ExchangeError(
                f"{1e3 * selection.baseline_m:g} mm is not a multiple of the "
                f"{1e3 * slab.lens_pitch_m:.6g} mm between its views",
                file=field.path, key="baseline_m", remedy=f"Give a multiple, or {remedy}",
            )  # fmt: skip
        number = number or (count - 1) // step + 1
    elif number and number > 1 and selection.views:
        steps = [(n - 1) // (w - 1) for n, w in zip(field.grid, selection.views, strict=True)
                if w > 1]  # fmt: skip
        step = max(1, min(steps))
    number = number or count
    reach = (number - 1) * step + 1
    if reach > count:
        problem = f"{number} views with a step of {step} need {reach}; the file has {count}"
        remedy = f"Give fewer, or {remedy}"
        raise ExchangeError(problem, file=field.path, key="views", remedy=remedy)
    return (count - reach + 1) // 2 + np.arange(number) * step


def _spread(selection: Selection, field: LightField) -> tuple[np.ndarray, np.ndarray, float]:
    """The positions of columns and rows, and the distance between neighbours, metres.

    By default the views are between the outermost recorded ones.
    """
    slab, baseline = field.require_slab(), selection.baseline_m
    width = (slab.views - 1) * slab.lens_pitch_m
    default = int(width / baseline + 1 + _ON_STEP) if baseline else field.views_to_serve
    columns, rows = selection.views or (default, default)
    lens, most = 2 * slab.camera.lens_radius_m, max(columns, rows)
    pitch = baseline or float(np.diff(served_positions(field, max(2, most)))[0])
    if (most - 1) * pitch > lens * (1 + _ON_STEP):
        raise ExchangeError(
            f"{most} views {1e3 * pitch:g} mm apart do not fit on the lens of {1e3 * lens:.4g} mm",
            file=field.path, key="baseline_m" if baseline else "views",
            remedy="Choose fewer views, or a smaller distance between them",
        )  # fmt: skip
    across, down = (pitch * (np.arange(n) - (n - 1) / 2) for n in (columns, rows))
    return across, down, pitch


def _word(name: str) -> str:
    """The name with separators of file names and formats replaced by hyphens."""
    return re.sub(r"[^A-Za-z0-9-]+", "-", name).strip("-") or "lightfield"

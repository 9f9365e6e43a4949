"""Views from any point of the lens, made from a stored light field with depth.

It is slicing by depth with a point as aperture.  A ray of lens point s that hits depth z appears,
from c, at the tangent ``x_f + (s - c) (1 / z - delta)``, one ray wide.  Views near c provide most
of the picture; farther views fill what nearer ones do not see.  Layers of inverse depth are
composed from front to back.
"""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, cl, open_device
from lfcore.opencl.interface import FLOAT, INT, SHARED, Interface, given, read, record, write
from lfcore.opencl.kernel import Kernel
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import LensCells, ViewSet
from lfcore.optics.size import Pixels
from lfcore.refocus.depth_slicing import DepthSlicer, HeldRays, held_rays
from lfcore.refocus.placed_views import PlacedViews
from lfcore.refocus.stored_depth import picture_side, read_depths, read_parts
from lfcore.refocus.two_parts import Part, placed_parts, virtual_depth
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.lightfield import LightFieldFile

LAYERS = 6
"""Layers of inverse depth; differences within a layer count as one surface.  More layers are not
better.  This and the next three are measured in docs/decisions.md."""
NEAR = 2
"""The distance, in views, within which a view contributes to a picture."""
FAR = 4
"""The distance, in views, within which a view contributes to holes."""
FAR_SHARE = 1e-3
"""The weight of views that fill holes: small enough to be invisible elsewhere."""
HELD_BACK = 3
"""The number of traced views that are compared with views made from all others."""
HELD_BACK_DB = 4.5
"""The dB by which views between recorded ones are better than views that were held back: these are
twice as far from their neighbours.  Measured on five scenes: 4.7 to 7.2 dB."""
SEEN_VIEW = np.dtype([
    ("number", INT),  # of the view in `depth`
    ("x", FLOAT),  # of pixel (0, 0)'s ray at depth infinity, pixels of the picture
    ("y", FLOAT),
    ("move_x", FLOAT),  # pixels per dioptre
    ("move_y", FLOAT),
])  # fmt: skip
NEAREST_ARGUMENTS = np.dtype([
    ("columns", INT),  # of a view
    ("rows", INT),
    ("width", INT),  # of the picture
    ("height", INT),
    ("step", FLOAT),  # pixels of the picture from ray to ray
])  # fmt: skip
INTERFACE = SHARED | Interface(
    records={"SeenView": SEEN_VIEW, "NearestArguments": NEAREST_ARGUMENTS},
    kernels={
        "nearest": read(depth="float", views="SeenView")
        | given(numbers="NearestArguments")
        | write(found="uint")
    },
)
"""What the kernel shares with the host; `depth` is (views, rows, columns), metres."""


class FreeViews:
    """Views and their depths from points of the lens; the file's rays are decoded once.

    Parameters
    ----------
    field : LightFieldFile
        The file.
    pixels : int or (int, int), optional
        The pictures' longer side, or width and height.  Default: as the file was recorded for.
    device : Device or str, optional
        An open device, or part of its name.
    virtual : bool
        Whether inverse depths are those of images in mirrors, glass and coats.

    Raises
    ------
    OpticsError
        The file has no depth or too many rays, or the pixels have another shape than its views.
    """

    def __init__(
        self,
        field: LightFieldFile,
        pixels: Pixels | None = None,
        *,
        device: Device | str | None = None,
        virtual: bool = False,
    ):
        self.virtual = virtual
        self.field, self.stored, self.slab = field, field.require_depth(), field.require_slab()
        side = self.stored.pixels if pixels is None else picture_side(field, pixels)
        self.made = self.slab.resized(side)
        """The slab with the same views and the pictures' pixels."""
        self.views, self._device = self.stored.views(self.slab), device
        self.without: list[int] = []
        """The numbers i + N j of unused views."""

    @cached_property
    def _parts(self) -> list[Part]:
        return read_parts(self.field, device=self.device)

    @cached_property
    def _rays(self) -> list[HeldRays]:
        """The rays on the device; of two parts also the specular ones, at surfaces' depth and at
        virtual depth."""
        (own, depth), *rest = placed_parts(
            [(own.copy(), depth.copy()) for own, depth in self._parts]
        )
        rays = [(own, depth)]
        for light, virtual in rest:
            rays += [(light, np.where(virtual > 0, depth, np.float32(0))), (light, virtual)]
        return [held_rays(self.device, *each) for each in rays]

    @cached_property
    def device(self) -> Device:
        return self._device if isinstance(self._device, Device) else open_device(self._device)

    def picture(self, point: np.ndarray) -> np.ndarray:
        """The view from a point (2,), metres: (height, width, 3) float32, linear light."""
        picture = self._slice(point, self._shares(point))
        if (dark := ~picture.any(axis=-1)).any():
            depth = self._nearest(point)
            picture = _filled(picture, depth, dark & np.isnan(depth), self._surface)
        return picture

    def inverse_depth(self, point: np.ndarray) -> np.ndarray:
        """The inverse depth in the middle of each pixel, (height, width) float64, 1/m; 0 is a miss.

        Pixels that no view sees get the depth of the farthest surface around them.
        """
        inverse = self._nearest(point)
        return _filled(inverse, inverse, np.isnan(inverse), self._surface)

    def only(self, number: int) -> np.ndarray:
        """The picture of stored view ``number`` from its own point, made from this view alone."""
        share = np.zeros(self.slab.views**2)
        share[number] = 1.0
        return self._slice(self.views.positions[number], share)

    @property
    def _surface(self) -> float:
        """The difference in inverse depth, 1/m, within one surface."""
        codes = self.stored.codes
        return (codes.near - codes.far) / LAYERS

    def _shares(self, point: np.ndarray) -> np.ndarray:
        """The weight of each view for a point, (N N,) float64."""
        away = self._away(point)
        near, far = (np.clip(1 - away / reach, 0, 1).prod(axis=1) for reach in (NEAR, FAR))
        share = near + FAR_SHARE * far
        share[self.without] = 0.0
        return share

    def _away(self, point: np.ndarray) -> np.ndarray:
        """The distances of all views along s and t, in views: (N N, 2) float64."""
        return np.abs(self.views.positions - point) / self.slab.lens_pitch_m

    def _slice(self, point: np.ndarray, share: np.ndarray) -> np.ndarray:
        slicers = []
        for number, rays in enumerate(self._rays):
            slicer = _PointSlicer(
                self.views, np.asarray(point, float), share, self.made.pixels, self.stored.codes,
                self.field.layout.stops, self.device, images=number == 2,
            )  # fmt: skip
            slicer.add_held(slice(None), *rays)
            slicers.append(slicer)
        body, *specular = slicers
        if not specular:
            return body.pictures()[0]
        shown, images = specular
        return body.pictures(shown, images.pictures())[0]

    def _nearest(self, point: np.ndarray) -> np.ndarray:
        """The inverse depth of the nearest surface per pixel; NaN where no view sees one.

        Surfaces in the middle half of a pixel come first, then others in the pixel; the views
        around the point come before farther views.
        """
        away = self._away(point).max(axis=1)
        away[self.without] = np.inf
        width, height = self.made.size
        code = np.zeros((height, width), np.uint32)
        for low, high in ((-1.0, 0.99), (0.99, FAR)):
            numbers = np.flatnonzero((low <= away) & (away < high))
            if len(numbers):
                for level in self._nearest_of(point, numbers):
                    code = np.where(code, code, level)
            if code.all():
                break
        inverse = (code - np.uint32(1)).view(np.float32).astype(float)
        return np.where(code, inverse, np.nan)

    def _nearest_of(self, point: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """The kernel's codes for some views, (2, height, width) uint32: middle, whole pixel."""
        slab, device, (width, height) = self.slab, self.device, self.made.size
        columns, rows = slab.size
        if "_parts" in self.__dict__:
            places, depths = numbers, [depth for _, depth in self._parts]
        else:
            files = (self.field, self.field.specular) if self.virtual else (self.field,)
            places = np.arange(len(numbers))
            depths = [read_depths(file, numbers) for file in files if file]
        depth = device.shared(virtual_depth(depths) if self.virtual else depths[0])
        step = self.made.pixels / slab.pixels
        move = (self.views.positions[numbers] - point) * (step / slab.pixel_pitch)
        first = (self.views.displacement[numbers] + slab.held.pixels[:2] + 0.5) * step
        first -= move * slab.camera.delta + self.made.held.pixels[:2]
        seen = np.zeros(len(numbers), SEEN_VIEW)
        seen["number"] = places
        seen["x"], seen["y"] = first.T
        seen["move_x"], seen["move_y"] = move.T
        codes = device.zeros(8 * width * height)
        kernel = Kernel(device, ["refocus/kernels/nearest.cl"], "nearest", {}, INTERFACE)
        kernel(
            rows, len(numbers), grouped=True, depth=depth, views=device.buffer(seen), found=codes,
            numbers=record(
                NEAREST_ARGUMENTS, columns=columns, rows=rows, width=width, height=height, step=step
            ),
        )  # fmt: skip
        levels = np.empty((2, height, width), np.uint32)
        cl.enqueue_copy(device.queue, levels, codes)
        return levels


def views_at(
    field: LightFieldFile,
    points_m: np.ndarray,
    pixels: Pixels | None = None,
    *,
    device: Device | str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """As :meth:`lfcore.LightField.views_at`."""
    free = FreeViews(field, pixels, device=device)
    points, lens = np.asarray(points_m, float).reshape(-1, 2), free.slab.camera.lens_radius_m
    if points.size and not np.abs(points).max() <= lens:
        raise OpticsError(
            f"is outside the lens, which reaches {1e3 * lens:.4g} mm from its middle",
            file=field.path, key="points_m",
        )  # fmt: skip
    out = np.empty((len(points), *free.made.size[::-1], 3), np.float32)
    for number, point in enumerate(points):
        out[number] = free.picture(point)
        if progress:
            progress(number + 1, len(points))
    return out


def served_positions(field: LightFieldFile, count: int) -> np.ndarray:
    """The positions of ``count`` columns or rows of views, (count,) metres.

    They are evenly spaced from the first recorded view to the last.
    """
    slab = field.require_slab()
    reach = (slab.views - 1) * slab.lens_pitch_m or slab.lens_pitch_m * (1 - 1 / count)
    return reach * (np.arange(count) - (count - 1) / 2) / max(1, count - 1)


def expected_db(free: FreeViews) -> float | None:
    """Estimate the PSNR, dB in sRGB, of views between the outermost recorded ones.

    Traced views inside the lens are made from the others, and the worst counts.  None for fewer
    than 3 x 3 views.
    """
    slab = free.slab
    if slab.views < 3 or not slab.views_held().all():
        return None
    inner = np.arange(1, slab.views - 1)
    numbers = (inner[:, None] * slab.views + inner).ravel()
    held = numbers[np.linspace(0, len(numbers) - 1, min(HELD_BACK, len(numbers))).astype(int)]
    worst = np.inf
    for number in held:
        traced, free.without = free.only(number), [number]
        made = free.picture(free.views.positions[number])
        error = np.square(srgb_encode(made) - srgb_encode(traced)).mean()
        worst = min(worst, -10 * np.log10(max(float(error), 1e-10)))
    free.without = []
    return worst + HELD_BACK_DB


def inverse_depth(field: LightFieldFile, pixels: int | None = None) -> np.ndarray:
    """The inverse depth from the middle of the lens, (height, width) float64, 1/m; 0 is a miss.

    ``pixels`` and errors are as for :class:`FreeViews`.
    """
    return FreeViews(field, pixels).inverse_depth(np.zeros(2))


def _filled(
    values: np.ndarray, inverse: np.ndarray, holes: np.ndarray, surface: float
) -> np.ndarray:
    """Fill holes with the nearest pixel of the farthest surface around them.

    ``inverse`` is each pixel's inverse depth, NaN if unknown; ``surface`` the difference of inverse
    depth within one surface.
    """
    from scipy.ndimage import distance_transform_edt, minimum_filter  # slow to import

    known = ~np.isnan(inverse)
    if not (holes.any() and known.any()):
        return values
    deepest = distance_transform_edt(~known).max()
    around = 2 * int(np.ceil(deepest)) + 3
    farthest = minimum_filter(np.where(known, inverse, np.inf), around, mode="nearest")
    behind = known & (inverse <= farthest + surface)
    _, (row, column) = distance_transform_edt(~behind, return_indices=True)
    return np.where(holes[(..., *[None] * (values.ndim - 2))], values[row, column], values)


class _PointSlicer(DepthSlicer):
    """Forms the picture from one point (2,) of the lens, metres; ``share`` weights the views.
    Pictures of ``images`` have one layer."""

    def __init__(
        self, views: ViewSet, point: np.ndarray, share: np.ndarray, pixels: int, codes: DepthCodes,
        stops: int, device: Device, *, images: bool = False,
    ):  # fmt: skip
        slab = views.slab
        self.point, self.share = point, share
        plane = SensorPlane(1 / codes.far if codes.far else np.inf, slab.camera.f_number, "square")
        # All surfaces are before the plane: sweeps are from 0 to the nearest surface's.
        widest = (codes.near - codes.far) * slab.lens_pitch_m * pixels / slab.camera.field_width
        bounds = np.arange(1, LAYERS) * widest / LAYERS
        self._layer_px = widest / LAYERS
        super().__init__(
            views, [plane], pixels, device, bounds_px=() if images else bounds.tolist(),
            stops=stops, empty=np.nan if images else 0.0,
        )  # fmt: skip

    def _place(
        self, plane: SensorPlane, pixels: int, bounds_px: Sequence[float] | None, *, long_sums: bool
    ) -> PlacedViews:
        return _ViewsFromPoint(
            self.views, plane, pixels, bounds_px, long_sums=long_sums,
            point=self.point, share=self.share, layer_px=self._layer_px,
        )  # fmt: skip


class _ViewsFromPoint(PlacedViews):
    """Views seen from a ``point`` of the lens, weighted by ``share``; layers sweep ``layer_px``."""

    def __init__(
        self, views: ViewSet, plane: SensorPlane, pixels: int, bounds_px: Sequence[float] | None,
        *, long_sums: bool, point: np.ndarray, share: np.ndarray, layer_px: float,
    ):  # fmt: skip
        super().__init__(views, plane, pixels, bounds_px, long_sums=long_sums)
        self.point, self.share, self.layer_px = point, share, layer_px

    @cached_property
    def cells(self) -> LensCells:
        count = len(self.share)
        return LensCells(np.tile(self.point, (count, 1)), np.zeros((count, 2)), self.share)

    @property
    def rays_a_pixel(self) -> float:
        """The most rays in a pixel.  If a layer is seen edge-on from the point, all its rays along
        the line from a view to the point fall into one pixel."""
        views = self.views
        piled = self.layer_px * np.abs(views.positions - self.point) / views.slab.lens_pitch_m
        return float(self.share @ (1 + piled.sum(axis=1))) / self.step**2

    @cached_property
    def first(self) -> np.ndarray:
        moved = self.point * (self.plane.delta - self.views.slab.camera.delta) * self.scale
        return super().first - moved

"""A camera array's picture on an OpenCL device, for many syntheses."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pyopencl as cl

from lfcore.errors import DeviceError
from lfcore.opencl.device import Device
from lfcore.opencl.interface import (
    FLOAT,
    INT,
    SHARED,
    UINT,
    Interface,
    given,
    read,
    record,
    write,
)
from lfcore.opencl.kernel import Kernel
from lfcore.optics.array import CameraArray
from lfcore.refocus.array import focal_surface as surfaces
from lfcore.refocus.array.focal_surface import FocalSurface
from lfcore.refocus.array.sampling import HALTON, QUADRATURE, STRATIFIED
from lfcore.refocus.array.virtual_camera import VirtualCamera

ARRAY = np.dtype([
    ("columns", INT),  # data cameras along x
    ("rows", INT),
    ("width", INT),  # of a tile, pixels
    ("height", INT),
    ("inv_pitch", FLOAT),  # pixels per unit tangent
    ("delta", FLOAT),  # inverse distance at which the tiles coincide
    ("low_x", FLOAT),  # bounds within which rays belong to the array
    ("high_x", FLOAT),
    ("low_y", FLOAT),
    ("high_y", FLOAT),
])  # fmt: skip
VIEW = np.dtype([
    ("position", FLOAT, 3),
    ("rotation", FLOAT, 9),  # rows of the matrix: array space = rotation * camera space
    ("width", INT),
    ("height", INT),
    ("pitch", FLOAT),  # tangent between pixels
    ("lens_radius", FLOAT),
])  # fmt: skip
SURFACE = np.dtype([
    ("kind", INT),  # PLANE, SPHERE or DEPTH_MAP
    ("map_width", INT),
    ("map_height", INT),
    ("point", FLOAT, 3),  # of the plane, or the centre
    ("normal", FLOAT, 3),  # of the plane
    ("radius", FLOAT),
])  # fmt: skip
SAMPLING = np.dtype([
    ("sampler", INT),  # QUADRATURE, HALTON, STRATIFIED or INDEPENDENT
    ("count", INT),  # samples per pixel
    ("columns", INT),  # strata
    ("rows", INT),
    ("film_bits", INT),  # of count - 1, at least 1
    ("seed", UINT),
])  # fmt: skip
GIVEN_RAY = np.dtype([
    ("origin", FLOAT, 3),  # array space
    ("direction", FLOAT, 3),
    ("weight", FLOAT),  # 0: stopped inside the lens, black, but a sample
    ("film", FLOAT, 2),  # pixels
])  # fmt: skip
# image; positions of the cameras' columns and rows; map: inverse depths of a DEPTH_MAP.
FIELD = read(image="NUMBER", columns="float", rows="float", map="float") | given(
    array="Array", view="View", surface="Surface"
)
"""The parameters of all kernels of a light field; :meth:`DeviceField.arguments` has the values."""
_OUTPUT = given(first_row="int") | write(out="float4")
INTERFACE = SHARED | Interface(
    constants={
        "PLANE": surfaces.PLANE, "SPHERE": surfaces.SPHERE, "DEPTH_MAP": surfaces.DEPTH_MAP,
        "QUADRATURE": QUADRATURE, "HALTON": HALTON, "STRATIFIED": STRATIFIED,
    },
    records={
        "Array": ARRAY, "View": VIEW, "Surface": SURFACE, "Sampling": SAMPLING,
        "GivenRay": GIVEN_RAY,
    },
    kernels={
        "isaksen": FIELD | given(filter_width="float") | _OUTPUT,
        "thin_lens": FIELD | read(table="float4") | given(sampling="Sampling") | _OUTPUT,
        "given_rays": FIELD
        | read(rays="GivenRay")
        | given(count="int", pixels="int")
        | write(out="float4"),
    },
)  # fmt: skip
"""What the kernels share with the host."""
_FOLDER = "refocus/array/kernels"


@dataclass(frozen=True, eq=False)
class Synthesis:
    """A synthetic picture.

    Attributes
    ----------
    image : ndarray
        (h, w, 3) float32, linear light.
    coverage : ndarray
        (h, w) float32: the share of a pixel's samples inside the array; 0 or 1 for Isaksen's
        filter.  Pixels of coverage 0 are black.
    """

    image: np.ndarray
    coverage: np.ndarray

    @classmethod
    def of(cls, pixels: np.ndarray, size: tuple[int, int]) -> Self:
        """Make a picture of (width, height) from colours and coverage of its pixels, (P, 4)."""
        picture = pixels.reshape(*size[::-1], 4).astype(np.float32)
        return cls(np.ascontiguousarray(picture[..., :3]), picture[..., 3].copy())

    @property
    def skipped_share(self) -> float:
        """The share of samples outside the array, 0 to 1."""
        return float(1.0 - self.coverage.mean(dtype=np.float64))


class DeviceField:
    """A camera array's tiles on a device.

    ``image`` is (Ny h, Nx w, 3) float32 or float16, linear radiance.  Raises :class:`DeviceError`
    if it does not fit.
    """

    def __init__(self, device: Device, image: np.ndarray, array: CameraArray):
        array.tiles(image)
        if image.dtype != np.float16:
            image = np.asarray(image, np.float32)
        self.image = np.ascontiguousarray(image)
        self.device, self.array = device, array
        limit = device.device.max_mem_alloc_size
        if self.image.nbytes > limit:
            raise DeviceError(
                f"the light field of {self.image.nbytes / 1e9:.1f} GB exceeds the "
                f"{limit / 1e9:.1f} GB that {device.name} allocates at once",
                remedy="Store it in 16-bit floats, or choose another device",
            )
        if self.image.size > np.iinfo(np.int32).max:
            raise DeviceError(
                f"a light field of {self.image.size} numbers exceeds the kernels' 32-bit index",
                remedy="Use fewer cameras or pixels",
            )
        # A CPU reads the host's memory without a copy.
        self.buffer = (device.shared if device.is_cpu else device.buffer)(self.image)
        self.columns, self.rows = (
            device.buffer(np.asarray(axis, np.float32)) for axis in (array.columns_m, array.rows_m)
        )
        (columns, rows), (width, height) = array.cameras, array.tile
        low_x, high_x, low_y, high_y = array.bounds()
        self.record = record(
            ARRAY, columns=columns, rows=rows, width=width, height=height,
            inv_pitch=1.0 / array.pixel_pitch, delta=array.delta,
            low_x=low_x, high_x=high_x, low_y=low_y, high_y=high_y,
        )  # fmt: skip

    def kernel(self, name: str, **defines: int) -> Kernel:
        """A kernel for this field's number format."""
        values = {"HALF": int(self.image.dtype == np.float16), **defines}
        return Kernel(self.device, [f"{_FOLDER}/{name}.cl"], name, values, INTERFACE)

    def arguments(self, camera: VirtualCamera, surface: FocalSurface) -> dict[str, Any]:
        """The arguments FIELD."""
        width, height = camera.size
        view = record(
            VIEW, position=camera.position_m, rotation=camera.rotation.ravel(), width=width,
            height=height, pitch=camera.pixel_pitch, lens_radius=camera.lens_radius_m,
        )  # fmt: skip
        shape, inverse = np.zeros((), SURFACE), np.zeros(0, np.float32)
        if isinstance(surface, surfaces.DepthMapSurface):
            shape["kind"] = surfaces.DEPTH_MAP
            shape["map_height"], shape["map_width"] = surface.depth.shape
            inverse = np.ascontiguousarray(1.0 / surface.depth, np.float32)
        elif isinstance(surface, surfaces.SphereSurface):
            shape["kind"], shape["radius"] = surfaces.SPHERE, surface.radius
            shape["point"] = surface.centre
        else:
            shape["kind"] = surfaces.PLANE
            shape["point"], shape["normal"] = surface.point, surface.normal
        return {
            "image": self.buffer, "array": self.record, "columns": self.columns, "rows": self.rows,
            "view": view, "surface": shape, "map": self.device.buffer(inverse),
        }  # fmt: skip

    def run_rows(self, kernel: Kernel, camera: VirtualCamera, **arguments: Any) -> Synthesis:
        """Run a per-pixel kernel by bands of rows, with all arguments but first_row and out."""
        width, height = camera.size
        out = np.empty((height, width, 4), np.float32)
        target = self.device.empty(out.nbytes)
        band = max(1, min(height, 65536 // width))
        for first in range(0, height, band):
            count = min(band, height - first)
            kernel(width, count, grouped=True, first_row=first, out=target, **arguments)
        cl.enqueue_copy(self.device.queue, out, target)
        return Synthesis.of(out, camera.size)

"""A camera array's picture on an OpenCL device, for many syntheses."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pyopencl as cl

from lfcore.errors import DeviceError
from lfcore.opencl.device import Device, build_program
from lfcore.opencl.interface import FLOAT, INT, SHARED, Interface
from lfcore.optics.array import CameraArray
from lfcore.refocus.array import focal_surface as surfaces
from lfcore.refocus.array.focal_surface import FocalSurface
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
INTERFACE = SHARED | Interface(records={"Array": ARRAY, "View": VIEW, "Surface": SURFACE})
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
        self.buffer = (device.shown if device.is_cpu else device.buffer)(self.image)
        self.columns, self.rows = (
            device.buffer(np.asarray(axis, np.float32)) for axis in (array.columns_m, array.rows_m)
        )
        sizes, pitch = (*array.cameras, *array.tile), array.pixel_pitch
        self.record = np.array((*sizes, 1.0 / pitch, array.delta, *array.bounds()), ARRAY)

    def kernel(self, file: str, name: str, **defines: int) -> cl.Kernel:
        """A kernel for this field's number format."""
        values = {"HALF": int(self.image.dtype == np.float16), **defines}
        source = [f"{_FOLDER}/{file}"]
        return cl.Kernel(build_program(self.device, source, values, INTERFACE), name)

    def arguments(self, camera: VirtualCamera, surface: FocalSurface) -> tuple:
        """The first arguments of all kernels."""
        lens = camera.pixel_pitch, camera.lens_radius_m
        view = np.array((camera.position_m, camera.rotation.ravel(), *camera.size, *lens), VIEW)
        record, inverse = np.zeros((), SURFACE), np.zeros(0, np.float32)
        if isinstance(surface, surfaces.DepthMapSurface):
            record["kind"] = surfaces.DEPTH_MAP
            record["map_height"], record["map_width"] = surface.depth.shape
            inverse = np.ascontiguousarray(1.0 / surface.depth, np.float32)
        elif isinstance(surface, surfaces.SphereSurface):
            record["kind"], record["radius"] = surfaces.SPHERE, surface.radius
            record["point"] = surface.centre
        else:
            record["kind"] = surfaces.PLANE
            record["point"], record["normal"] = surface.point, surface.normal
        depths = self.device.buffer(inverse)
        return self.buffer, self.record, self.columns, self.rows, view, record, depths

    def run_rows(
        self, kernel: cl.Kernel, camera: VirtualCamera, arguments: Sequence[Any]
    ) -> Synthesis:
        """Run a per-pixel kernel by bands of rows; its last arguments are first_row and out."""
        width, height = camera.size
        out = np.empty((height, width, 4), np.float32)
        target = self.device.empty(out.nbytes)
        band = max(1, min(height, 65536 // width))
        for first in range(0, height, band):
            count = min(band, height - first)
            kernel(self.device.queue, (width, count), None, *arguments, np.int32(first), target)
        cl.enqueue_copy(self.device.queue, out, target)
        return Synthesis.of(out, camera.size)

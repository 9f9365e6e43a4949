"""Many views out of a light field file at once, in either layout."""

from collections.abc import Callable

import numpy as np

from lfcore.errors import OpticsError
from lfcore.opencl.device import Device, cl, open_device
from lfcore.optics.array import CameraArray
from lfcore.refocus.shift_sum import GROUP_BYTES
from lfcore.refocus.stored_views import add_frames
from lfcore.storage.lightfield import LightFieldFile


def read_views(
    field: LightFieldFile,
    samples: np.ndarray,
    *,
    device: Device | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> np.ndarray:
    """(K, height, width, 3) float32, linear light, of lens samples (K, 2) (i, j), which count from
    the file's first view.

    From macropixels every frame is decoded, once, however many views are asked for.  Raises
    :class:`OpticsError` for samples outside the lens or asked for twice.
    """
    collector = _Collector(field, np.asarray(samples, np.int32).reshape(-1, 2), device)
    add_frames(collector, field, progress)
    return collector.views


def read_stored(
    field: LightFieldFile, *, progress: Callable[[int, int], None] | None = None
) -> tuple[np.ndarray, CameraArray]:
    """All pictures of a file, slab or array, side by side as a camera array's picture.

    That is (N M, N M, 3) float32, linear radiance, for ``DeviceField`` and ``write_array``; the
    array is sheared when the slab is focused.
    """
    if not field.metric:
        raise OpticsError(
            "does not hold its geometry, which a camera array needs", file=field.path,
            remedy="Import it again with --baseline, --field-of-view and --focus",
        )  # fmt: skip
    slab, (columns, rows) = field.metadata.slab, field.grid
    array = field.array if slab is None else CameraArray.from_slab(slab)
    assert array is not None  # a file holds one or the other
    samples = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), -1).reshape(-1, 2)
    views = read_views(field, samples, progress=progress)
    image = array.mosaic(views.reshape(rows, columns, *views.shape[1:]))
    if field.white != 1.0:
        image *= np.float32(field.white)
    return image, array


class _Collector:
    """Takes unpacked views as a :class:`ViewSummer` does, and keeps them."""

    def __init__(self, field: LightFieldFile, samples: np.ndarray, device: Device | None):
        column, row, columns, rows = field.extent.views
        *self._corner, width, height = field.extent.pixels
        if len(samples) and not (0 <= samples.min() and (samples < [columns, rows]).all()):
            raise OpticsError(
                f"lens samples are from (0, 0) to ({columns - 1}, {rows - 1})", file=field.path
            )
        samples = samples + np.array([column, row], np.int32)
        self.device, self.open_samples = device or open_device(), samples
        self._one = np.float32(field.layout.one)
        self.views = np.zeros((len(samples), height, width, 3), np.float32)
        self._place = {tuple(sample): k for k, sample in enumerate(samples.tolist())}
        if len(self._place) < len(samples):
            raise OpticsError("a view is asked for twice", file=field.path)

    def group_size(self, width: int, height: int) -> int:
        return max(1, GROUP_BYTES // (12 * width * height))

    def add_fixed(self, views: cl.Buffer, samples: np.ndarray, region: tuple) -> None:
        column, row, width, height = region
        column, row = column - self._corner[0], row - self._corner[1]
        light = np.empty((len(samples), 3, height, width), np.uint32)
        cl.enqueue_copy(self.device.queue, light, views)
        for picture, sample in zip(light, samples.tolist(), strict=True):
            out = self.views[
                self._place[tuple(sample)], row : row + height, column : column + width
            ]
            out[:] = np.moveaxis(picture, 0, -1) / self._one

"""A bounded sample of a light field, stored and read back: sizes, errors and seconds.

The sample is whole in the angles: all N x N lens samples of a square window of pixels in the
middle of the M x M picture.  It is stored as any light field is (one segment, joined into a file),
and read from that file.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import StorageError
from lfcore.evaluation.metrics import PEAK, picture_quality, ssim
from lfcore.evaluation.tables import sizes
from lfcore.evaluation.timing import Stopwatch
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.refocus.slicing import PlaneFormer
from lfcore.scene.model import Scene
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames
from lfcore.tracing.tracer import Tracer

CHUNK_PX = 1 << 20
SSIM_PX = 1 << 18
"""Pixels of frames whose SSIM is taken: frames spread evenly over the segment."""
WINDOW_STEP = 8
"""Windows are multiples of this, so that whole frames of 8 x 8 macropixels fill them."""
LEAST_WINDOW = 16


@dataclass(frozen=True)
class Sample:
    """Rays of a window and the pictures that they give.

    ``rgb`` is (w, w, N, N, 3) float32, sRGB-encoded in [0, 1], indexed [v, u, j, i]; not rounded.
    ``pictures`` (P, w, w, 3) float32, linear light, are the sensor planes that they form, each
    clipped to [0, 1] as frames clip them.
    """

    scene: str
    slab: Slab
    rgb: np.ndarray
    planes: list[SensorPlane]
    pictures: np.ndarray

    @property
    def window(self) -> int:
        """Pixels along a side."""
        return self.slab.pixels


def window_camera(camera: Camera, pixels: int, window: int) -> Camera:
    """The camera that sees only the middle ``window`` of ``pixels``, at the same pixel pitch."""
    return replace(camera, sensor_width_m=camera.sensor_width_m * window / pixels)


def own_planes(scene: Scene) -> list[SensorPlane]:
    """A plane for each of the scene's own focus distances, through the whole lens."""
    return [SensorPlane(focus, scene.camera.f_number) for focus in scene.focus_distances_m]


def window_side(views: int, pixels: int, most_rays: int) -> int:
    """Pixels a side of the largest window of at most ``most_rays`` rays: a multiple of 8, 16 at
    least."""
    fit = int(np.sqrt(most_rays)) // views // WINDOW_STEP * WINDOW_STEP
    return max(LEAST_WINDOW, min(fit, pixels // WINDOW_STEP * WINDOW_STEP))


def trace_sample(
    tracer: Tracer,
    planes: Sequence[SensorPlane],
    *,
    views: int,
    pixels: int,
    most_rays: int,
) -> Sample:
    """Trace the window of the scene's picture of M = ``pixels`` that :func:`window_side` says.

    Raises :class:`OpticsError` for a plane that the camera does not record.
    """
    window = window_side(views, pixels, most_rays)
    slab = Slab(window_camera(tracer.scene.camera, pixels, window), views, window)
    elements = np.stack(np.divmod(np.arange(window**2, dtype=np.int64), window)[::-1], 1)
    light = tracer.bundle_radiance(bundles.macropixels(slab, elements), elements)
    light = light.reshape(window, window, views, views, 3)
    rgb = srgb_encode(light)
    # As slicing, to the last bit, by a program that serves every scene and N.
    each = light.transpose(2, 3, 0, 1, 4)
    pictures = shift_sum_views(slab, each, planes, device=tracer.device)
    return Sample(tracer.scene.name, slab, rgb, list(planes), pictures)


class Frames:
    """A sample in the frames of one layout: what encoders are fed, and compared with."""

    def __init__(self, sample: Sample, layout: FrameLayout):
        """Raises :class:`StorageError` for a layout of another light field."""
        if (layout.views, layout.pixels) != (sample.slab.views, sample.slab.pixels):
            raise StorageError(f"{layout} is not of {sample.slab}", key="layout")
        self.sample, self.layout = sample, layout
        (self.tile,) = layout.tiles(layout.rays, least=1)

    @cached_property
    def rgb(self) -> np.ndarray:
        """(F, height, width, 3) float32, sRGB-encoded; empty slots and padding are black."""
        layout, light = self.layout, self.sample.rgb
        if layout.kind == "views":
            light = light.transpose(2, 3, 0, 1, 4)
        shape = (self.tile.frame_count, layout.frame_height, layout.frame_width, 3)
        out = np.zeros(shape, np.float32)
        for (column, row), place in zip(self.tile.elements(), self._places(), strict=True):
            out[place] = light[row, column]
        return out

    def _places(self) -> Iterator[tuple[int, slice, slice]]:
        """Frame, rows and columns of each element."""
        size = self.layout.inner
        for frame, x, y in self.tile.placement(self.tile.elements()).tolist():
            yield frame, slice(y, y + size), slice(x, x + size)

    @cached_property
    def codes(self) -> np.ndarray:
        """(F, frame_bytes) uint8 in the layout's pixel format."""
        layout, step = self.layout, self.step
        out = np.empty((self.tile.frame_count, layout.frame_bytes), np.uint8)
        for at in range(0, len(out), step):
            out[at : at + step] = frames_from_rgb(self.rgb[at : at + step], layout.pixel_format)
        return out

    @property
    def step(self) -> int:
        """Frames that are converted at a time."""
        return max(1, CHUNK_PX // (self.layout.frame_width * self.layout.frame_height))

    @cached_property
    def used(self) -> np.ndarray:
        """(height, width) bool: pixels of the first frame that are rays, as they are of all."""
        out = np.zeros((self.layout.frame_height, self.layout.frame_width), bool)
        for frame, rows, columns in self._places():
            out[rows, columns] |= frame == 0
        return out


@dataclass(frozen=True)
class Stored:
    """What storing cost and what came back.

    ``bytes`` are those of the file without its metadata, which are about as long in a large file
    and would weigh too much in a sample.  Seconds are CPU seconds of this process, one thread
    asked for.  PSNR (dB, peak 255, sRGB codes that are not rounded) and SSIM of the frames, and
    means over the refocused pictures.
    """

    bytes: int
    encode_seconds: float
    decode_seconds: float
    psnr_frames_db: float
    ssim_frames: float
    psnr_pictures_db: float
    ssim_pictures: float

    def columns(self, rays: int) -> dict[str, float]:
        """All of it by the names of the tables' columns, and sizes beside ``rays`` rays."""
        measured = {key: value for key, value in vars(self).items() if key != "bytes"}
        bits = {"bits_per_ray": 8 * self.bytes / rays}
        return sizes(rays=rays, video_bytes=self.bytes) | bits | measured


def store(frames: Frames, spec: CodecSpec, device: Device) -> Stored:
    """Encode, join, open and decode a sample, and compare.

    Raises :class:`StorageError` when the encoder refuses its settings or frames.
    """
    sample, tile = frames.sample, frames.tile
    codes, watch = frames.codes, Stopwatch(clock=time.process_time)
    with tempfile.TemporaryDirectory(prefix="lfcore-") as folder:
        segment, file = Path(folder) / "0000.mp4", Path(folder) / "lightfield.mkv"
        shape = frames.layout.frame_width, frames.layout.frame_height
        with watch.part("encode"), SegmentWriter(segment, spec, *shape) as writer:
            writer.write(codes)
        scene = {"name": sample.scene, "digest": "sample"}
        metadata = join_segments(
            file, [segment], [tile], frames.layout, geometry=sample.slab, scene=scene, spec=spec
        )
        errors = _Errors(frames, device)
        field, first = LightFieldFile.open(file), 0
        for some in watch.each("decode", field.frames(0, chunk=frames.step)):
            errors.add(some, first)
            first += len(some)
        size = file.stat().st_size - len(metadata.to_text())
        return Stored(size, watch.seconds["encode"], watch.seconds["decode"], *errors.all())


class _Errors:
    """Compares decoded frames, and the pictures formed from them, with the sample's own."""

    def __init__(self, frames: Frames, device: Device):
        self.frames, self.used = frames, frames.used
        self.whole = self.used.all()
        sample = frames.sample
        self.former = PlaneFormer(sample.slab, frames.tile, sample.planes, device)
        self.square, self.count = 0.0, 0
        self.ssims: list[float] = []
        pixels = frames.layout.frame_width * frames.layout.frame_height
        self.every = max(1, frames.tile.frame_count * pixels // SSIM_PX)

    def add(self, some: np.ndarray, first: int) -> None:
        layout, truth = self.frames.layout, self.frames.rgb[first : first + len(some)]
        found = rgb_from_frames(some, layout.pixel_format, layout.frame_width, layout.frame_height)
        error = found - truth
        if not self.whole:
            error = error[:, self.used]
        self.square += float(np.square(error, dtype=np.float64).sum())
        self.count += error.size
        for k in range(-first % self.every, len(some), self.every):
            self.ssims.append(ssim(PEAK * found[k], PEAK * truth[k], peak=PEAK))
        self.former.add(some, first)

    def all(self) -> tuple[float, float, float, float]:
        """PSNR and SSIM of frames, then of pictures."""
        mean = self.square / self.count
        frames_db = float(-10 * np.log10(mean)) if mean else float("inf")
        sample = self.frames.sample
        sums = total(sample.slab, sample.planes, [self.former.plane_sums()])
        found = picture_quality(sums.pictures(), sample.pictures)
        return frames_db, float(np.mean(self.ssims)), found["psnr_db"], found["ssim"]

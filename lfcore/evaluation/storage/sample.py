"""A bounded sample of a light field, stored and read back: sizes, errors and seconds.

The sample has all N x N lens samples of a square window in the middle of the picture.  It is
stored and read like any light field, as one segment.
"""

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.errors import StorageError
from lfcore.evaluation.metrics import PEAK, decibels, mse, picture_quality, ssim
from lfcore.evaluation.tables import sizes
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.refocus.slicing import PlaneFormer
from lfcore.rendering.record_depth import encode
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

SSIM_PX = 1 << 18
"""The pixels for which SSIM is computed, in frames spread evenly over the segment."""
CACHED_PX = 1 << 16
"""The pixels compared at a time; their float64 colours fit a core's cache."""
WINDOW_STEP = 8
"""The step of window sides, so that whole frames of 8 x 8 macropixels fill them."""
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


def window_camera(camera: Camera, pixels: int, window: int) -> Camera:
    """The camera that sees only the middle ``window`` of ``pixels``, at the same pixel pitch."""
    return replace(camera, sensor_width_m=camera.sensor_width_m * window / pixels)


def own_planes(scene: Scene) -> list[SensorPlane]:
    """A plane for each of the scene's own focus distances, through the whole lens."""
    return [SensorPlane(focus, scene.camera.f_number) for focus in scene.focus_distances_m]


def window_side(views: int, pixels: int, most_rays: int) -> int:
    """The side in pixels of the largest window of at most ``most_rays`` rays: a multiple of 8, at
    least 16."""
    fit = int(np.sqrt(most_rays)) // views // WINDOW_STEP * WINDOW_STEP
    return max(LEAST_WINDOW, min(fit, pixels // WINDOW_STEP * WINDOW_STEP))


def trace_sample(
    tracer: Tracer, planes: Sequence[SensorPlane], *, views: int, pixels: int, most_rays: int
) -> Sample:
    """Trace the window of :func:`window_side` of the scene's picture with M = ``pixels`` on its
    shorter side.

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
    """A sample in the frames of one layout, for encoders and for comparison.

    ``rgb`` (F, height, width, 3) float32 is sRGB-encoded, and black beside the rays; of every
    frame the pixels ``used`` (height, width), bool, are rays.  ``codes`` (F, frame_bytes) uint8 are
    the same in the layout's pixel format.
    """

    def __init__(self, sample: Sample, layout: FrameLayout):
        """Raises :class:`StorageError` for a layout of another light field."""
        if (layout.views, layout.pixels) != (sample.slab.views, sample.slab.pixels):
            raise StorageError(f"{layout} is not of {sample.slab}", key="layout")
        self.sample, self.layout = sample, layout
        (self.tile,) = layout.tiles(layout.rays, least=1)
        elements, (across, down) = self.tile.elements(), map(np.arange, layout.inner)
        frame, x, y = self.tile.placement(elements).T[..., None, None]
        rows, columns = y + down[:, None], x + across
        shape = layout.frame_height, layout.frame_width
        light = sample.rgb if layout.kind == "macropixels" else sample.rgb.transpose(2, 3, 0, 1, 4)
        self.rgb = np.zeros((self.tile.frame_count, *shape, 3), np.float32)
        self.rgb[frame, rows, columns] = light[elements[:, 1], elements[:, 0]]
        self.codes = frames_from_rgb(self.rgb, layout.pixel_format)
        first = frame.ravel() == 0
        self.used = np.zeros(shape, bool)
        self.used[rows[first], columns[first]] = True


def store(frames: Frames, spec: Encoding, device: Device) -> dict:
    """Encode, join, open and decode a sample, and compare: columns of the tables.

    Sizes are those of the file without its metadata, which are as long in a large file.  Seconds
    are CPU seconds of this process with one encoder thread.  PSNR (dB, peak 255, sRGB codes that
    are not rounded) and SSIM are of the frames, and means over the refocused pictures.

    Raises :class:`StorageError` when the encoder refuses its settings or frames.
    """
    sample, layout, watch = frames.sample, frames.layout, Stopwatch(clock=time.process_time)
    with tempfile.TemporaryDirectory(prefix="lfcore-") as folder:
        segment, file = Path(folder) / "0000.mp4", Path(folder) / "lightfield.mkv"
        with watch.part("encode"):
            encode([[frames.codes]], layout, [(segment, spec)])
        metadata = join_segments(
            file, [segment], [frames.tile], layout, geometry=sample.slab,
            scene={"name": sample.scene, "digest": "sample"}, spec=spec,
        )  # fmt: skip
        size = file.stat().st_size - len(metadata.to_text())
        field = LightFieldFile.open(file)
        decoded = np.concatenate([*watch.each("decode", field.frames(0))])
    return {
        **sizes(rays=layout.rays, video_bytes=size),
        "bits_per_ray": 8 * size / layout.rays,
        "encode_seconds": watch.seconds["encode"],
        "decode_seconds": watch.seconds["decode"],
        **_quality(frames, decoded, device),
    }


def _quality(frames: Frames, decoded: np.ndarray, device: Device) -> dict[str, float]:
    """The quality of decoded frames (F, frame_bytes), and of the pictures formed from them."""
    sample = frames.sample
    former = PlaneFormer(sample.slab, frames.tile, sample.planes, device)
    former.add(decoded, 0)
    sums = total(sample.slab, sample.planes, [former.plane_sums()])
    pictures = picture_quality(sums.pictures(), sample.pictures)
    return {
        **frame_quality(frames, decoded),
        "psnr_pictures_db": pictures["psnr_db"],
        "ssim_pictures": pictures["ssim"],
    }


def frame_quality(frames: Frames, decoded: np.ndarray) -> dict[str, float]:
    """The quality of decoded frames (F, frame_bytes), compared a few at a time, to stay in the
    cache."""
    layout, square, similar = frames.layout, 0.0, []
    size = layout.frame_width, layout.frame_height
    every = max(1, len(decoded) * math.prod(size) // SSIM_PX)
    rays = slice(None) if frames.used.all() else frames.used  # without a copy, where all are
    step = max(1, CACHED_PX // math.prod(size))
    for start in range(0, len(decoded), step):
        own = frames.rgb[start : start + step]
        found = rgb_from_frames(decoded[start : start + step], layout.pixel_format, *size)
        square += mse(found[:, rays], own[:, rays]) * len(found)
        for at in range(-start % every, len(found), every):
            similar.append(ssim(PEAK * found[at], PEAK * own[at], peak=PEAK))
    return {
        "psnr_frames_db": decibels(square / len(decoded), peak=1),
        "ssim_frames": float(np.mean(similar)),
    }

"""A bounded sample of a light field, stored and read back: sizes, errors and seconds.

The sample has all N x N lens samples of a square window in the middle of the picture.  It is
stored and read like any light field, as one segment.

The storage table compares macropixels and views, their orders, and macropixels per frame.

Rate and distortion: bits per ray against the error of frames and of refocused pictures.  A curve is
one encoder setting at several constant rate factors.  Curves are compared by the Bjontegaard delta
rate (G. Bjontegaard, VCEG-M33, 2001): the mean relative difference of bits at equal
PSNR to the anchor, over the PSNR that both reach.
"""

import math
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd

from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import PEAK, decibels, picture_quality, ssim
from lfcore.evaluation.tables import sizes
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Slab
from lfcore.refocus.plane_former import PlaneFormer
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.rendering.record_depth import encode
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.defaults import (
    CRF_SCALE,
    QUICK,
    chosen_encoding,
    default_kind,
    default_pack,
    macropixel_pack,
)
from lfcore.storage.layout import ORDERS, FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

SSIM_PX = 1 << 17
"""The pixels for which SSIM is computed, in frames spread evenly over the segment."""
WINDOW_STEP = 8
"""The step of window sides, so that whole frames of 8 x 8 macropixels fill them."""
LEAST_WINDOW = 16
"""The least side of a window, pixels."""


@dataclass(frozen=True)
class Sample:
    """Rays of a window, and the pictures formed from them.

    ``rgb`` is (w, w, N, N, 3) float32, sRGB-encoded in [0, 1], indexed [v, u, j, i]; not rounded.
    ``pictures`` (P, w, w, 3) float32, linear light, are the sensor planes formed from them,
    with light clipped to [0, 1] as in frames.
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
    """A plane per focus distance of the scene, through the whole lens."""
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
    # Equal to slicing to the last bit, by a program for all scenes and N.
    by_view = light.transpose(2, 3, 0, 1, 4)
    pictures = shift_sum_views(slab, by_view, planes, device=tracer.device)
    return Sample(tracer.scene.name, slab, rgb, list(planes), pictures)


class Frames:
    """A sample in the frames of one layout, for encoders and for comparison.

    ``rgb`` (F, height, width, 3) float32 is sRGB-encoded, and black outside the rays; the
    pixels ``used`` (height, width), bool, of every frame are rays.  ``codes`` (F, frame_bytes)
    uint8 are the same in the layout's pixel format.
    """

    def __init__(self, sample: Sample, layout: FrameLayout):
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

    Sizes exclude the file's metadata, which are as long in a large file.  Seconds are CPU
    seconds of this process with one encoder thread.  PSNR (dB, peak 255, sRGB codes that are not
    rounded) and SSIM are of the frames, and means over the refocused pictures.

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
        decoded = np.concatenate([*watch.each("decode", field.video.frames(0))])
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
    """The quality of decoded frames (F, frame_bytes)."""
    squares, similar, size = 0.0, [], (frames.layout.frame_width, frames.layout.frame_height)
    every = max(1, len(decoded) * math.prod(size) // SSIM_PX)
    batch = max(1, (1 << 16) // math.prod(size))  # frames compared at a time
    for first in range(0, len(decoded), batch):
        original, coded = (values[first : first + batch] for values in (frames.rgb, decoded))
        decoded_rgb = rgb_from_frames(coded, frames.layout.pixel_format, *size)
        apart = (decoded_rgb - original) * frames.used[..., None]
        squares += float(np.vdot(apart, apart))
        for number in range(-first % every, len(original), every):
            similar.append(ssim(PEAK * decoded_rgb[number], PEAK * original[number], peak=PEAK))
    error = squares / (3 * len(decoded) * frames.used.sum())
    return {"psnr_frames_db": decibels(error, peak=1), "ssim_frames": float(np.mean(similar))}


LAYOUT_COLUMNS = [
    "scene", "N", "M", "window", "layout", "order", "pack", "frame_px", "is_default",
    "raw_bytes_float32", "video_bytes", "ratio_float32", "bits_per_ray", "psnr_frames_db",
    "psnr_pictures_db", "encode_seconds", "decode_seconds",
]  # fmt: skip
ORDER = "serpentine"
LARGEST_FRAME_PX = 512
"""The largest side of a frame of several macropixels."""


def layouts(views: int, pixels: int, packs: Sequence[int]) -> Iterator[FrameLayout]:
    """All orders of views and of macropixels in their best pack, and macropixels in other packs.

    The sample has ``pixels`` per side.  Frames are no wider than 512 pixels, unless a single
    element is.
    """
    spec, best = chosen_encoding(views), min(macropixel_pack(views), pixels)
    for order in ORDERS:
        yield FrameLayout("views", views, pixels, order, 1, spec.stored_format)
    for order in ORDERS:
        yield FrameLayout("macropixels", views, pixels, order, best, spec.stored_format)
    for pack in packs:
        small = pack == 1 or pack * views <= LARGEST_FRAME_PX
        if pack != best and pack <= pixels and small:
            yield FrameLayout("macropixels", views, pixels, ORDER, pack, spec.stored_format)


def layout_rows(
    tracer: Tracer, pixels: Pixels, *, views: Sequence[int], rays: int, packs: Sequence[int]
) -> list[dict]:
    """Rows of one scene (columns :data:`LAYOUT_COLUMNS`), each N of ``views`` at its settings.

    Samples have at most ``rays``, a square window of a picture of so many ``pixels``; ``packs`` are
    macropixels per side of a frame, beside the default.
    """
    size = Size.of(pixels)
    planes, rows = own_planes(tracer.scene), []
    for n in views:
        sample = trace_sample(tracer, planes, views=n, pixels=size.shorter, most_rays=rays)
        for layout in layouts(n, sample.slab.pixels, packs):
            measured = store(Frames(sample, layout), chosen_encoding(n), tracer.device)
            measured |= {"scene": sample.scene, "N": n, "M": size.as_given}
            measured |= {"window": layout.pixels, "frame_px": layout.frame_width}
            measured |= {"layout": layout.kind, "order": layout.order, "pack": layout.pack}
            measured["is_default"] = is_default(layout, size.longer)
            rows.append({column: measured[column] for column in LAYOUT_COLUMNS})
    return rows


def is_default(layout: FrameLayout, pixels: int) -> bool:
    """Whether the layout is the default for a light field of M = ``pixels``."""
    best = default_kind(layout.views, pixels), ORDER, default_pack(layout.views, pixels)
    return (layout.kind, layout.order, layout.pack) == best


COLUMNS = [
    "scene", "N", "M", "window", "curve", "codec", "preset", "pixel_format", "crf", "video_bytes",
    "bits_per_ray", "ratio_float32", "psnr_frames_db", "ssim_frames", "psnr_pictures_db",
    "ssim_pictures", "encode_seconds", "decode_seconds",
]  # fmt: skip
ANCHOR = "x264 medium 4:2:0"
LEAST_OVERLAP = 0.5
"""The least share of the anchor's range of PSNR for which a delta rate is meaningful."""
PLAIN: dict = {"pixel_format": "yuv420p", "preset": "veryfast"}
FFV1 = {"codec": "ffv1", "preset": None, "tune": None}
SVT = {"codec": "libsvtav1", "pixel_format": "yuv420p"}

CURVES: Mapping[str, dict] = {
    "x264 ultrafast 4:2:0": {"preset": "ultrafast"},
    "x264 veryfast 4:2:0": {"preset": "veryfast"},
    ANCHOR: {"preset": "medium"},
    "x264 veryfast 4:4:4": {"preset": "veryfast", "pixel_format": "yuv444p"},
    "x264 ultrafast 4:4:4, CABAC, 8 x 8": QUICK | {"pixel_format": "yuv444p"},
    "x264 medium 4:4:4": {"preset": "medium", "pixel_format": "yuv444p"},
    "x264 medium 4:4:4 10 bit": {"preset": "medium", "pixel_format": "yuv444p10le"},
    "x265 ultrafast 4:2:0": {"codec": "libx265", "preset": "ultrafast"},
    "x265 fast 4:4:4": {"codec": "libx265", "preset": "fast", "pixel_format": "yuv444p"},
    "AV1 preset 12 4:2:0": SVT | {"preset": "12"},
    "AV1 preset 8 4:2:0 10 bit": SVT | {"preset": "8", "pixel_format": "yuv420p10le"},
    "FFV1 4:2:0, lossless": FFV1 | {"pixel_format": "yuv420p"},
    "FFV1 4:4:4, lossless": FFV1 | {"pixel_format": "yuv444p"},
    "FFV1 RGB, lossless": FFV1 | {"pixel_format": "gbrp"},
}
"""The curves' names, and their differences to :data:`PLAIN`."""


def specs(crfs: Sequence[float], curves: Mapping[str, dict]) -> list[tuple[str, Encoding]]:
    """(curve, settings) of every point; lossless codecs have one.

    Raises :class:`StorageError` for settings that no encoder takes.
    """
    settings = []
    for name, changes in curves.items():
        spec = Encoding(**(PLAIN | changes))
        scale = CRF_SCALE.get(spec.codec, 1.0)
        points = crfs[:1] if spec.lossless else crfs
        settings += [(name, replace(spec, crf=min(63.0, scale * crf))) for crf in points]
    return settings


def rate_rows(
    tracer: Tracer,
    pixels: Pixels,
    *,
    views: Sequence[int],
    rays: int,
    crfs: Sequence[float],
    curves: Mapping[str, dict] = CURVES,
) -> list[dict]:
    """Points of one scene (columns :data:`COLUMNS`), in the default layout of each N.

    The default settings of each N are the curve "default".  Samples are as in
    :func:`layout_rows`; ``crfs`` are on H.264's scale.
    """
    size = Size.of(pixels)
    planes, points, rows = own_planes(tracer.scene), specs(crfs, curves), []
    for n in views:
        sample = trace_sample(tracer, planes, views=n, pixels=size.shorter, most_rays=rays)
        window, kind = sample.slab.pixels, default_kind(n, size.longer)
        pack = min(default_pack(n, size.longer), window)
        fed: dict[str, Frames] = {}
        for name, spec in [("default", chosen_encoding(n)), *points]:
            form = spec.stored_format
            if form not in fed:
                layout = FrameLayout(kind, n, window, "serpentine", pack, form)
                fed = {form: Frames(sample, layout)}
            measured = store(fed[form], spec, tracer.device)
            measured |= {"scene": sample.scene, "N": n, "M": size.as_given, "window": window}
            measured |= {"curve": name, "crf": None if spec.lossless else spec.crf}
            measured |= {key: getattr(spec, key) for key in ("codec", "preset", "pixel_format")}
            rows.append({column: measured[column] for column in COLUMNS})
    return rows


def bd_rows(points: pd.DataFrame) -> list[dict]:
    """One row per curve of several points, against the anchor; ``points`` has the columns
    :data:`COLUMNS`.

    Delta rates are percent, negative for fewer bits; None if curves overlap in less than half of
    the anchor's range of PSNR.  Rates of encoding and decoding are means over the points, by CPU
    seconds.
    """
    rows = []
    for (scene, views), group in points.groupby(["scene", "N"], sort=False):
        anchor = group[group.curve == ANCHOR]
        for name, curve in group.groupby("curve", sort=False):
            if len(curve) < 2:
                continue
            row = {"scene": scene, "N": views, "curve": name}
            for quality in ("frames", "pictures"):
                percent, overlap = delta_rate(anchor, curve, f"psnr_{quality}_db")
                row |= {f"bd_rate_{quality}_percent": percent, f"overlap_{quality}": overlap}
            mrays = (curve.window * curve.N) ** 2 / 1e6
            row["encode_mrays_per_second"] = float((mrays / curve.encode_seconds).mean())
            row["decode_mrays_per_second"] = float((mrays / curve.decode_seconds).mean())
            rows.append(row)
    return rows


def delta_rate(
    anchor: pd.DataFrame, curve: pd.DataFrame, quality: str
) -> tuple[float | None, float]:
    """(Bjontegaard delta rate in percent, share of the anchor's range that both curves reach).

    Points that do not gain quality with bits are left out, since the interpolation (Akima's) is
    of bits over quality.  None where fewer than three points remain or the overlap is too small.
    """
    (rate_a, dist_a), (rate_b, dist_b) = (_rising(points, quality) for points in (anchor, curve))
    if min(len(dist_a), len(dist_b)) < 3:
        return None, 0.0
    low, high = max(dist_a[0], dist_b[0]), min(dist_a[-1], dist_b[-1])
    overlap = float(max(0.0, high - low) / (dist_a[-1] - dist_a[0]))
    if overlap < LEAST_OVERLAP:
        return None, overlap
    import bjontegaard  # slow to import

    percent = bjontegaard.bd_rate(
        rate_a, dist_a, rate_b, dist_b, method="akima", require_matching_points=False,
        min_overlap=0.0,
    )  # fmt: skip
    return float(percent), overlap


def _rising(points: pd.DataFrame, quality: str) -> tuple[np.ndarray, np.ndarray]:
    """Bits and quality, both strictly rising."""
    points = points.sort_values("bits_per_ray")
    rate, dist = points.bits_per_ray.to_numpy(), points[quality].to_numpy()
    best = np.maximum.accumulate(np.concatenate([[-np.inf], dist[:-1]]))
    keep = dist > best
    return rate[keep], dist[keep]

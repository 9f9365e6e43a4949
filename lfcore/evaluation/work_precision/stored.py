"""Error of a stored light field over the bits of a ray and over the seconds of encoding."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.evaluation.work_precision.point import point
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.slicing import form_planes
from lfcore.rendering.direct import trace_planes
from lfcore.storage import defaults
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.tracing.tracer import Tracer

MOST_RAYS = 1 << 26


def default_spec(views: int, crf: float | None = None) -> CodecSpec:
    """The encoder's default for N = ``views``, on one thread, at another CRF if one is given."""
    spec = replace(defaults.default_spec(views), threads=1)
    return spec if crf is None else replace(spec, crf=float(crf))


def layout_of(slab: Slab, spec: CodecSpec) -> FrameLayout:
    """The default layout."""
    return defaults.frame_layout(slab.views, slab.pixels, spec.pixel_format)


def frames_of(tracer: Tracer, slab: Slab, layout: FrameLayout) -> list[np.ndarray]:
    """All frames of a slab, a tile each (F, bytes)."""
    return [
        np.concatenate([chunk.frames.copy() for chunk in tracer.trace_tile(slab, tile)])
        for tile in layout.tiles(MOST_RAYS)
    ]


def encode(frames: list[np.ndarray], layout: FrameLayout, spec: CodecSpec, file: Path) -> list:
    """Segments of ``frames`` beside ``file``, in the order of tiles."""
    segments = []
    for number, part in enumerate(frames):
        segments.append(file.with_name(f"{number}.mp4"))
        size = layout.frame_width, layout.frame_height
        with SegmentWriter(segments[-1], spec, *size) as writer:
            writer.write(part)
    return segments


def join(tracer, slab: Slab, layout: FrameLayout, spec: CodecSpec, segments, file: Path) -> None:
    """The light field file of these segments."""
    about = {"name": tracer.scene.name, "digest": "0" * 64}
    tiles = layout.tiles(MOST_RAYS)
    join_segments(file, segments, tiles, layout, geometry=slab, scene=about, spec=spec)


def storage(tracer: Tracer, study) -> Iterator[dict]:
    """By codec, preset and CRF; seconds are of encoding.

    The reference is the same rays before they are encoded, so its own error is none: what is
    shown is the codec's alone, after the mean over the lens.
    """
    scene = tracer.scene
    slab = Slab(scene.camera, study.video_views, study.pixels)
    plane = SensorPlane(min(scene.focus_distances_m), scene.camera.f_number)
    reference = trace_planes(tracer, slab, [plane])[0].astype(float)
    made: dict[FrameLayout, list[np.ndarray]] = {}
    for codec in study.codecs:
        for crf in study.crfs:
            spec = _spec(codec, slab.views, crf)
            layout = layout_of(slab, spec)
            if layout not in made:
                made[layout] = frames_of(tracer, slab, layout)
            yield _stored(tracer, slab, plane, reference, made[layout], spec, codec["name"])


def _spec(codec: dict, views: int, crf: float) -> CodecSpec:
    """A codec of the configuration: what it does not say is the default's."""
    given = {key: value for key, value in codec.items() if key not in ("name", "crf_offset")}
    known = {key: given.pop(key) for key in ("codec", "pixel_format", "preset") if key in given}
    crf = float(crf + codec.get("crf_offset", 0))
    return replace(defaults.codec_spec(views, crf=crf, **known), **given)


def _stored(tracer, slab, plane, reference, frames, spec, name) -> dict:
    layout, device = layout_of(slab, spec), tracer.device.device.name
    context = {"panel": "storage", "f_number": plane.f_number, "method": name}
    context |= {"knob": f"CRF {spec.crf:g}", "rays_per_pixel": int(plane.mask(slab).sum())}
    with tempfile.TemporaryDirectory() as folder:
        file, bits = Path(folder) / "lightfield.mkv", []

        def work(_: int) -> Path:
            return encode(frames, layout, spec, file)

        def picture(segments) -> np.ndarray:
            join(tracer, slab, layout, spec, segments, file)
            bits.append(8 * file.stat().st_size / slab.rays)
            return form_planes(file, [plane], threads=1, device=device).sums.pictures()[0]

        row = point(work, reference, 0.0, picture_of=picture, **context)
        return row | {"bits_per_ray": bits[0] if bits else None}

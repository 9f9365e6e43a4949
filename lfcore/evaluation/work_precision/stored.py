"""Error of a picture from a stored light field over bytes, and seconds of encoding and reading."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.colour import display_values
from lfcore.evaluation.metrics import psnr
from lfcore.evaluation.true_picture.reference import Reference
from lfcore.evaluation.work_precision.refocused import refocused_picture, refocused_row
from lfcore.evaluation.work_precision.study import Study
from lfcore.opencl.device import programs_made
from lfcore.optics.lattice import Lattice
from lfcore.optics.ray_cells import crossed_views
from lfcore.optics.slab import Slab
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.stored_depth import slice_stored
from lfcore.rendering.by_depth import trace_by_depth
from lfcore.rendering.depth import dioptre_range
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.record_depth import RANGE_MARGIN, depth_store, encode, frames_by_depth
from lfcore.storage import defaults
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, join_segments
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.layout import Tile
from lfcore.storage.lightfield import LightFieldFile
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

DEFAULT = "default"


@dataclass(frozen=True)
class KeptRays:
    """Rays in memory that are to be stored, as one tile: ``frames`` as an encoder takes them and,
    where ``codes`` says how, ``depths``, (F, bytes) uint8 each.

    ``count`` are those of a pixel; ``picture`` (M, M, 3) is what they give before they are encoded.
    """

    slab: Slab
    count: Lattice
    tile: Tile
    frames: np.ndarray
    picture: np.ndarray
    depths: np.ndarray | None = None
    codes: DepthCodes | None = None


def storage(tracer: Tracer, study: Study) -> Iterator[dict]:
    """By codec, preset and CRF from few rays with depth, and by CRF from the thesis's grid.

    Errors are against the true picture; ``psnr_codec_db`` is against the same rays before they are
    encoded, the codec's loss alone.
    """
    truth = refocused_picture(tracer, study.stored_pixels, study.truth)
    views, subpixels = study.stored_lattice
    count = Lattice(int(views), subpixels)
    kept: dict[str, KeptRays] = {}
    for codec in study.codecs:
        for crf in study.crfs:
            spec = _spec(codec, count.views, crf)
            if spec.stored_format not in kept:
                kept[spec.stored_format] = _rays_by_depth(tracer, truth, count, spec)
            yield _stored(tracer, truth, kept[spec.stored_format], spec, codec["name"])
    rays = _rays_of_grid(tracer, truth, study.video_views)
    for crf in study.crfs:
        spec = replace(defaults.chosen_encoding(rays.slab.views), threads=1, crf=float(crf))
        yield _stored(tracer, truth, rays, spec, f"{DEFAULT}, N = {rays.slab.views}")


def _spec(codec: Mapping, views: int, crf: float) -> Encoding:
    """A codec of the configuration: what it does not say is the default's."""
    names = ("codec", "pixel_format", "preset")
    given: dict[str, Any] = {key: str(codec[key]) for key in names if codec.get(key) is not None}
    crf = float(crf + codec.get("crf_offset", 0))
    return defaults.chosen_encoding(views, Encoding(crf=crf, **given), by_depth=True)


def _rays_by_depth(tracer: Tracer, truth: Reference, count: Lattice, spec: Encoding) -> KeptRays:
    pixels = truth.pixels
    slab, store = depth_store(tracer.scene.camera, count, pixels, spec)
    codes = DepthCodes.of_range(slab, *dioptre_range(tracer, slab, RANGE_MARGIN))
    (tile,) = store.layout.tiles(slab.rays, least=1)
    made = zip(*frames_by_depth(tracer, slab, store, codes, tile), strict=True)
    frames, depths = map(np.concatenate, made)
    picture = trace_by_depth(tracer, crossed_views(slab), truth.planes, pixels)[0]
    return KeptRays(slab, count, tile, frames, picture, depths, codes)


def _rays_of_grid(tracer: Tracer, truth: Reference, views: int) -> KeptRays:
    slab = Slab(tracer.scene.camera, views, truth.pixels)
    layout = defaults.frame_layout(
        views, slab.pixels, defaults.chosen_encoding(views).stored_format
    )
    (tile,) = layout.tiles(slab.rays, least=1)
    frames = np.concatenate([chunk.frames.copy() for chunk in tracer.trace_tile(slab, tile)])
    picture = trace_planes(tracer, slab, truth.planes)[0]
    return KeptRays(slab, Lattice(views, 1), tile, frames, picture)


def _stored(tracer: Tracer, truth: Reference, rays: KeptRays, spec: Encoding, name: str) -> dict:
    pixels, layout = truth.pixels, rays.tile.layout
    found: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        file, colours, depths = (
            Path(folder) / each for each in ("lightfield.mkv", "colours.mp4", "depths.mp4")
        )
        streams = [(rays.frames, colours, spec)]
        depth: DepthSegments | None = None
        if rays.depths is not None and rays.codes is not None:
            own = rays.codes.spec(rays.slab)
            streams.append((rays.depths, depths, own))
            depth = DepthSegments([depths], rays.codes, True, pixels, own)

        def encode_in_turn(_: int) -> None:
            for frames, segment, own in streams:
                encode([[frames]], layout, [(segment, own)])

        def picture(_: None) -> np.ndarray:
            join_segments(
                file, [colours], [rays.tile], layout, geometry=rays.slab,
                scene={"name": tracer.scene.name, "digest": "0" * 64}, spec=spec, depth=depth,
            )  # fmt: skip
            read, seconds = clocked_warm(partial(_read, tracer, truth, file), programs_made)
            codes = [display_values(each) for each in (read, rays.picture)]
            found.update(
                bytes=file.stat().st_size,
                read_seconds=seconds,
                psnr_codec_db=psnr(*codes, peak=255),
            )
            return read

        slab = Slab(rays.slab.camera, rays.count.views, pixels)
        row = refocused_row(
            truth, "storage", name, f"CRF {spec.crf:g}", slab, encode_in_turn,
            subpixels=rays.count.subpixels, picture_of=picture,
        )  # fmt: skip
    return row | found


def _read(tracer: Tracer, truth: Reference, file: Path) -> np.ndarray:
    """The picture of ``truth`` from a file, on one thread."""
    with LightFieldFile.open(file) as field:
        if field.metadata.depth:
            return slice_stored(field, truth.planes, device=tracer.device)[0]
        made = form_planes(field, truth.planes, threads=1, device=tracer.device)
        return made.sums.pictures()[0]

"""One tracing, stored by several encoders: time, size, and the loss of the pictures."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lfcore.evaluation.metrics import picture_quality
from lfcore.evaluation.tables import sizes
from lfcore.files import draft_folder
from lfcore.optics.plane_sums import PlaneSums, total
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.slicing import form_planes
from lfcore.rendering.tiles import trace_tile
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import Tile
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.segment import SegmentWriter
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer


def sweep_rows(
    tracer: Tracer,
    slab: Slab,
    tiles: Sequence[Tile],
    planes: Sequence[SensorPlane],
    specs: Mapping[str, Encoding],
    folder: Path,
) -> list[dict]:
    """A row for each encoder of ``specs``: seconds, size, and quality of pictures from its file.

    Quality is against the same planes formed while tracing.  ``folder`` is for the files, which
    are removed.
    """
    watch, sums = Stopwatch(), []

    def trace(tile: Tile, files: Mapping[str, Path]) -> PlaneSums:
        """One tile into a segment of each encoder."""
        tracing = trace_tile(tracer, slab, tile, planes)
        size = tile.layout.frame_width, tile.layout.frame_height
        with ExitStack() as stack:
            ends = {case: stack.enter_context(ExitStack()) for case in specs}
            writers = {
                case: ends[case].enter_context(SegmentWriter(files[case], spec, *size))
                for case, spec in specs.items()
            }
            for chunk in watch.each("trace", iter(tracing)):
                for case, writer in writers.items():
                    with watch.part(case):
                        writer.write(chunk.frames)
            for case, end in ends.items():  # the last frames are encoded
                with watch.part(case):
                    end.close()
        assert tracing.plane_sums is not None  # the tracing has ended
        return tracing.plane_sums

    with draft_folder(folder / "sweep") as work:
        segments = {case: [work / f"{case}-{t.index}.mp4" for t in tiles] for case in specs}
        for tile in tiles:
            sums.append(trace(tile, {case: files[tile.index] for case, files in segments.items()}))
        pictures = total(slab, list(planes), sums).pictures()
        rows = []
        for case, spec in specs.items():
            file, scene = work / f"{case}.mkv", {"name": tracer.scene.name, "digest": ""}
            join_segments(
                file, segments[case], tiles, tiles[0].layout, geometry=slab, scene=scene, spec=spec
            )
            rows.append({
                "case": case, "scene": tracer.scene.name, "N": slab.views, "M": slab.size.as_given,
                "trace_seconds": round(watch.seconds["trace"], 3),
                "encode_seconds": round(watch.seconds[case], 3),
                **_retrieved(tracer, file, planes, pictures, slab.rays),
            })  # fmt: skip
        return rows


def _retrieved(
    tracer: Tracer, file: Path, planes: Sequence[SensorPlane], pictures: np.ndarray, rays: int
) -> dict[str, float]:
    """Columns of a light field file of so many rays, whose planes should be ``pictures``."""
    formed = form_planes(LightFieldFile.open(file), planes, threads=1, device=tracer.device.name)
    quality = picture_quality(formed.sums.pictures(), pictures)
    size = file.stat().st_size
    ratios = sizes(rays=rays, video_bytes=size)
    return {
        "retrieve_seconds": round(formed.seconds, 3),
        "video_bytes": size,
        "bits_per_ray": round(8 * size / rays, 5),
        "ratio_float32": round(ratios["ratio_float32"], 2),
        "psnr_db": round(quality["psnr_db"], 3),
        "ssim": round(quality["ssim"], 5),
    }


def sweep_figure(table: pd.DataFrame) -> Figure:
    """PSNR of pictures from the file over bits per ray and encoding time; a curve per case."""
    figure = Figure(figsize=(10, 4.2))
    axes = figure.subplots(1, 2)
    columns = (("bits_per_ray", "bits per ray"), ("encode_seconds", "seconds of encoding"))
    for axis, (column, label) in zip(axes, columns, strict=True):
        for number, ((scene, n, m), rows) in enumerate(table.groupby(["scene", "N", "M"])):
            rows = rows.sort_values(column)
            name = f"{scene}, N = {n}, M = {m}"
            axis.plot(rows[column], rows.psnr_db, "o-", color=f"C{number}", label=name)
            for row in rows.itertuples():
                place = getattr(row, column), row.psnr_db
                axis.annotate(row.case, place, textcoords="offset points", xytext=(4, 4), size=7)
        axis.set(xscale="log", xlabel=label, ylabel="PSNR through the lens, dB")
    axes[0].legend(fontsize=8)
    return figure

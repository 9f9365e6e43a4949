"""Several tiles of a light slab as one job: their sums of sensor planes, and their segments."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from lfcore.files import draft_folder
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import finished
from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import Tile
from lfcore.tracing.tracer import Tracer


def trace_batch(
    tracer: Tracer,
    slab: Slab,
    tiles: Sequence[Tile],
    planes: Sequence[SensorPlane],
    *,
    segments: str | Path | None,
    spec: Encoding,
    progress: Callable[[int, int], None],
) -> tuple[PlaneSums, dict]:
    """Trace tiles one after the other; without ``segments`` nothing is stored.

    One tile's segment is the file ``segments`` itself, several are a batch.  Returns the sums of
    the planes over all tiles, and the facts: rays, tiles, wall seconds.
    """
    facts = {"rays": 0, "trace": 0.0, "encode": 0.0}
    total: PlaneSums | None = None

    def trace(tile: Tile, segment: Path | None) -> None:
        nonlocal total
        if segment is None:
            tracing = finished(tracer.trace_tile(slab, tile, planes, frames=False))
        else:
            from lfcore.rendering.record import record_tile  # loads the codecs

            tracing, encode = record_tile(tracer, slab, tile, segment, spec, planes)
            facts["encode"] += encode
        facts["rays"] += tracing.rays
        facts["trace"] += tracing.seconds
        part = tracing.plane_sums
        total = total.with_part(part) if total and part else part
        progress(tile.index - tiles[0].index + 1, len(tiles))

    if segments is None:
        for tile in tiles:
            trace(tile, None)
    elif len(tiles) == 1:
        trace(tiles[0], Path(segments))
    else:
        from lfcore.storage.container import write_batch

        with draft_folder(segments) as folder:
            files = [folder / f"{tile.index}.mp4" for tile in tiles]
            for tile, file in zip(tiles, files, strict=True):
                trace(tile, file)
            write_batch(segments, files)
    assert total is not None
    seconds = {"trace": facts["trace"], "encode": facts["encode"]}
    return total, {"rays": facts["rays"], "tiles": len(tiles), "seconds": seconds}

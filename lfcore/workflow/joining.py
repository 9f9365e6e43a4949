"""All batches of a light slab together: their measurements, and the light field file."""

from collections.abc import Callable, Sequence
from pathlib import Path

from lfcore.optics.slab import Slab
from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import Tile
from lfcore.timing import clocked


def traced(batches: Sequence[dict]) -> dict:
    """The facts of all batches of a light field, summed."""
    return {
        "seconds": sum(one["seconds"]["trace"] for one in batches),
        "encode_seconds": sum(one["seconds"]["encode"] for one in batches),
        "rays": sum(one["rays"] for one in batches),
        "device": batches[0]["device"],
        "threads": batches[0]["threads"],
    }


def joined(
    path: str | Path,
    segments: Sequence[str | Path],
    batches: Sequence[dict],
    slab: Slab,
    tiles: Sequence[Tile],
    spec: Encoding,
    *,
    scene: dict,
    progress: Callable[[int, int], None],
) -> dict:
    """Join the batches' segments into the light field file ``path``; returns the cost of storage.

    ``batches`` are their facts; the first may have the range of visible depths.
    """
    from lfcore.storage.container import join_segments  # loads the codecs

    depth = batches[0].get("depth_m")
    metadata, seconds = clocked(
        lambda: join_segments(
            path, segments, tiles, tiles[0].layout, geometry=slab, scene=scene, spec=spec,
            content={"depth_m": depth} if depth else None, progress=progress,
        )
    )  # fmt: skip
    return {
        "device": batches[0]["processor"],
        "threads": spec.threads,
        "encode_seconds": sum(one["seconds"]["encode"] for one in batches),
        "join_seconds": seconds,
        "video_bytes": Path(path).stat().st_size,
        "segments": len(metadata.segments),
    }

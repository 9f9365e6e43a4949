"""One tile of a light slab as a job: traced, encoded as it comes, and timed."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path

from lfcore.evaluation.timing import Stopwatch
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.layout import Tile


def trace_and_encode(
    tracing: Iterable, tile: Tile, segment: str | Path | None, spec: CodecSpec | None
) -> dict[str, float]:
    """Run a tile's tracing; its frames go to the encoder as they come, and none to the disk.

    Without a ``segment`` nothing is stored, and no codec is loaded.  Returns wall seconds of
    ``trace`` and ``encode``.
    """
    watch, writing = Stopwatch(), nullcontext()
    if segment is not None:
        from lfcore.storage.segment import SegmentWriter

        size = tile.layout.frame_width, tile.layout.frame_height
        writing = SegmentWriter(segment, spec, *size)
    with watch.part("all"), writing as writer:
        for chunk in watch.each("trace", iter(tracing)):
            if writer is not None:
                writer.write(chunk.frames)
    trace = watch.seconds["trace"]
    encode = watch.seconds["all"] - trace if segment is not None else 0.0
    return {"trace": trace, "encode": encode}

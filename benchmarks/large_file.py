"""A light field file of a hundred thousand segments and more than 100 GB, written, opened, read.

    python -m benchmarks.large_file --publish

Of each segment the first frame is encoded, the others are zeros of the length that is asked for:
the file has the structure, the index and the length of a real one, and holes on the disk where the
zeros are.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import av
import numpy as np
import pandas as pd

from benchmarks.publish import RESULTS, Result, of_this_run
from lfcore.files import WholeFile
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.container import join_segments, write_batch
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.segment import SegmentWriter
from lfcore.timing import clocked, measure_in_turn

VIEWS, FRAMES, OF_BATCH = 512, 4, 512
SPEC = CodecSpec("libx264", "yuv444p", crf=24, preset="veryfast", bframes=0)
SIZES = ((640, 100), (192, 1100), (640, 1100))
"""M, and kilobytes of a segment."""
ZEROS = bytes(1 << 20)


class SparseFile(WholeFile):
    """A file whose zeros are holes."""

    def write(self, data) -> int:
        if data == ZEROS[: len(data)]:
            self.seek(len(data), 1)
            return len(data)
        half = len(data) // 2  # a piece that is short, or has no zeros, is written
        if half < 2048 or bytes(4096) not in bytes(data):
            return super().write(data)
        return self.write(data[:half]) + self.write(data[half:])


def peak_memory_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def simulated_segment(path: Path, layout: FrameLayout, kilobytes: int) -> None:
    """A segment of one encoded frame and :data:`FRAMES` - 1 of zeros."""
    side = np.linspace(0, 255, layout.frame_width, dtype=np.uint8)
    frame = np.tile(side, layout.frame_bytes // len(side))
    real = path.with_suffix(".real.mp4")
    with SegmentWriter(real, SPEC, layout.frame_width, layout.frame_height) as writer:
        writer.write(np.repeat(frame[None], FRAMES, 0))
    with av.open(str(real)) as old, av.open(str(path), "w", format="mp4") as new:
        stream = new.add_stream_from_template(old.streams.video[0], opaque=True)
        for number, packet in enumerate(p for p in old.demux(video=0) if p.size):
            made: av.Packet = packet
            if number:
                made = av.Packet(bytes(kilobytes * 1000 // (FRAMES - 1)))
                made.pts, made.dts, made.duration = packet.pts, packet.dts, packet.duration
                made.time_base = packet.time_base
            made.stream = stream
            new.mux_one(made)


def measured(pixels: int, kilobytes: int) -> dict:
    """One file: core seconds of its parts, and this process's peak of memory while it is joined."""
    import lfcore.files

    layout = FrameLayout("macropixels", VIEWS, pixels, pixel_format=SPEC.pixel_format)
    columns = pixels // FRAMES
    tiles = [
        Tile(layout, index, index % columns * FRAMES, index // columns, FRAMES, 1)
        for index in range(columns * pixels)
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        simulated_segment(folder / "0.mp4", layout, kilobytes)
        # The disk need not hold the zeros.
        lfcore.files.WholeFile = SparseFile  # type: ignore[misc]
        write_batch(folder / "batch", [folder / "0.mp4"] * OF_BATCH)
        before, path = peak_memory_mib(), folder / "lightfield.mkv"
        scene = {"name": "simulated", "digest": ""}
        _, join = clocked(
            lambda: join_segments(
                path, [folder / "batch"] * (len(tiles) // OF_BATCH), tiles, layout,
                geometry=Slab(Camera(0.05, 0.036, 2.0, 3.0), VIEWS, pixels), scene=scene, spec=SPEC,
            ),
            clock=time.process_time,
        )  # fmt: skip
        grown = peak_memory_mib() - before
        (opened,) = measure_in_turn(
            [lambda: LightFieldFile.open(path).close()], repeats=5, clock=time.process_time
        )
        with LightFieldFile.open(path) as field:
            _, first = clocked(
                lambda: field.macropixel(pixels // 2, pixels // 2), clock=time.process_time
            )
            places = iter(range(0, pixels, FRAMES))
            (later,) = measure_in_turn(
                [lambda: field.macropixel(next(places), pixels // 3)],
                repeats=15,
                clock=time.process_time,
            )
        size, held = path.stat().st_size, path.stat().st_blocks * 512
    return {
        "segments": len(tiles), "GB": round(size / 1e9, 1), "GB on disk": round(held / 1e9, 2),
        "join, core s": round(join, 1), "GB a core s": round(size / 1e9 / join, 2),
        "memory of joining, MiB": round(grown), "open, core ms": round(opened.median * 1e3),
        "first macropixel, core ms": round(first * 1e3),
        "next macropixels, core ms": round(later.median * 1e3),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--publish", action="store_true", help="keep the rows for the documents")
    parser.add_argument("--one", nargs=2, type=int, metavar=("M", "KB"), help="one file alone")
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(*options.one)))
        return
    rows = []
    for size in SIZES:  # each in a process of its own, for its peak of memory
        command = [sys.executable, "-m", "benchmarks.large_file", "--one", *map(str, size)]
        done = subprocess.run(command, check=True, capture_output=True, text=True)
        rows.append(json.loads(done.stdout))
        print(rows[-1], flush=True)
    if options.publish:
        provenance = of_this_run("python -m benchmarks.large_file --publish")
        Result(provenance, pd.DataFrame(rows)).write(RESULTS / "large_file.csv")


if __name__ == "__main__":
    main()

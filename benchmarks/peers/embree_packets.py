"""Embree's 16-wide coherent packets, through a driver that is compiled on first use."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.peers.method import Method, SkippedError
from lfcore.scene.model import Scene

SOURCE = Path(__file__).with_suffix(".cpp")
WAYS = {"lens": "4 x 4 lens samples", "pixels": "4 x 4 pixels"}
"""The rays of a packet: neighbouring lens samples of a pixel, or pixels through one lens sample."""


class EmbreePackets:
    """A process of the driver with one scene, which traces on request and reports its seconds."""

    def __init__(self, scene: Scene, threads: int):
        self._files, self._threads = 0, threads
        self._folder = tempfile.TemporaryDirectory(prefix="embree-packets-")
        folder = Path(self._folder.name)
        try:
            program = compile_driver(folder)
        except SkippedError:
            self._folder.cleanup()
            raise
        path = folder / "triangles.bin"
        np.ascontiguousarray(scene.triangles, np.float32).tofile(path)
        pipe = subprocess.PIPE
        self._process = subprocess.Popen([program, path], stdin=pipe, stdout=pipe, text=True)
        assert self._process.stdin and self._process.stdout
        self._requests, self._answers = self._process.stdin, self._process.stdout
        version, native, _seconds = self._answer()
        number = int(version)
        self.version = f"{number // 10000}.{number // 100 % 100}.{number % 100}"
        self.native16 = bool(int(native))

    def methods(self, sample) -> list[Method]:
        """Return the methods that trace ``sample``, by packets of either kind.

        Packets of pixels need squares of four pixels or more, which samples with large N lack.
        """
        path = self._write_rays(sample)
        ways = WAYS if sample.side % 4 == 0 else ["lens"]
        return [self._method(sample, path, way) for way in ways]

    def _method(self, sample, path: Path, way: str) -> Method:
        def trace() -> tuple[float, float, float]:
            print(f"rays {path} {self._threads} {way}\nrun", file=self._requests, flush=True)
            _, seconds, hits, depth = (float(word) for word in self._answer())
            return seconds, hits / sample.rays, depth / max(hits, 1)

        width = "native 16-wide" if self.native16 else "16-wide calls split by Embree"
        note = f"Embree {self.version}, {width}, {self._threads} threads"
        name = f"embree, {WAYS[way]}"
        run, check = (lambda: trace()[0]), (lambda: trace()[1:])
        return Method(name, sample.rays, run, note, check)

    def close(self) -> None:
        self._requests.close()
        self._process.wait(timeout=60)
        self._answers.close()
        self._folder.cleanup()

    def _write_rays(self, sample) -> Path:
        slab = sample.slab
        self._files += 1
        path = Path(self._folder.name) / f"rays-{self._files}.bin"
        tangents = slab.pixel_tangents()[sample.pixels]
        head = np.array([slab.views, len(tangents), sample.side], np.int32).tobytes()
        floats = np.concatenate([[slab.camera.delta], slab.lens_positions(), tangents.ravel()])
        path.write_bytes(head + floats.astype(np.float32).tobytes())
        return path

    def _answer(self) -> list[str]:
        line = self._answers.readline()
        if not line:
            raise SkippedError("the Embree driver ended early; its message is above")
        return line.split()


def compile_driver(folder: Path) -> Path:
    """Build the driver in ``folder``; raise SkippedError if compiler or headers are missing."""
    compiler = next(filter(None, map(shutil.which, ("g++", "clang++", "c++"))), None)
    if compiler is None:
        raise SkippedError("no C++ compiler is installed")
    program = folder / "embree_packets"
    command = [compiler, "-O3", "-march=native", "-std=c++17", str(SOURCE), "-o", str(program)]
    done = subprocess.run(
        [*command, "-lembree3", "-pthread"], capture_output=True, text=True, check=False
    )
    if done.returncode:
        first = (done.stderr.strip().splitlines() or ["no message"])[0]
        raise SkippedError(f"its driver does not compile (libembree-dev 3 needed): {first}")
    return program

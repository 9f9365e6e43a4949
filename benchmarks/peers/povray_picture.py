"""POV-Ray: a picture through a thin lens, by its focal blur.

The same: triangles, interpolated normals, textures, diffuse colour, highlights (its specular term
uses Blinn's half vector), lights and shadows, camera and focus.  Different: POV-Ray chooses its own
lens points; the picture is smaller and has fewer samples per pixel (POV-Ray is slow; its rate does
not depend on either); and seconds are POV-Ray's own report, which leaves out parsing.
"""

import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from benchmarks.peers.method import Method, Run, SkippedError
from lfcore.scene.model import Scene
from lfcore.scene.povray import write_povray

NAME = "povray"
SIDE = 96
SAMPLES = 64


class PovrayPicture:
    """One scene as a POV-Ray file in a temporary folder."""

    def __init__(self, scene: Scene, threads: int):
        program = shutil.which("povray")
        if not program:
            raise SkippedError("povray is not installed")
        self._program, self._scene, self._threads = program, scene, threads
        self._folder = tempfile.TemporaryDirectory(prefix="povray-")

    def methods(self, sample) -> list[Method]:
        folder = Path(self._folder.name)
        write_povray(folder, self._scene, sample.slab.camera, samples=SAMPLES)
        command = [
            self._program, "+Iscene.pov", f"+W{SIDE}", f"+H{SIDE}", f"+WT{self._threads}",
            "+Oout.png", "-D", "-A", "+L/usr/share/povray-3.7/include",
        ]  # fmt: skip

        def run() -> Run:
            done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
            found = re.search(
                r"Trace Time:.*?\(([\d.]+) seconds\)\s*using \d+ thread\(s\) with ([\d.]+)",
                done.stderr,
                re.S,
            )
            if done.returncode or not found:
                raise SkippedError(f"it failed: {done.stderr.strip()[-300:]}")
            return Run(float(found[1]), float(found[2]), SIDE * SIDE * SAMPLES)

        run()
        note = f"POV-Ray 3.7, {self._threads} threads, {SIDE} x {SIDE} pixels, {SAMPLES} samples"
        return [Method(NAME, "algorithm1", run, note)]

    def close(self) -> None:
        self._folder.cleanup()

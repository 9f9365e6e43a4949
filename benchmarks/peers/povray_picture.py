"""POV-Ray: the picture that a thin lens gives, by its focal blur.

What matches: triangles, interpolated normals, textures, diffuse colour, highlights (its specular is
Blinn's half vector), lights and shadows, camera and focus.  What does not: lens points are its own,
the picture is smaller and has fewer samples a pixel (POV-Ray is slow; its rate does not depend on
either), and its own report of seconds is used, which leaves out parsing.
"""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from lfcore.scene.model import POINT, Scene
from peers.method import Method, Run, SkippedError

NAME = "povray"
SIDE = 96
SAMPLES = 64


def _vector(values) -> str:
    return "<" + ",".join(f"{float(v):.7g}" for v in values) + ">"


class PovrayPicture:
    """One scene as a POV-Ray file in a temporary folder."""

    def __init__(self, scene: Scene, threads: int):
        self._program = shutil.which("povray")
        if not self._program:
            raise SkippedError("povray is not installed")
        self._scene, self._threads = scene, threads
        self._folder = tempfile.TemporaryDirectory(prefix="povray-")
        folder = Path(self._folder.name)
        for index, texture in enumerate(scene.textures):
            Image.fromarray(texture).save(folder / f"{index}.png")
        (folder / "mesh.inc").write_text("\n".join(self._lights() + list(self._mesh())))

    def method(self, slab) -> Method:
        folder = Path(self._folder.name)
        scene = f'#version 3.7;\n{self._camera(slab.camera)}\n#include "mesh.inc"\n'
        (folder / "scene.pov").write_text(scene)
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
        return Method(NAME, "algorithm1", run, note)

    def close(self) -> None:
        self._folder.cleanup()

    def _camera(self, camera) -> str:
        # Its aperture is twice the diameter: compared with Mitsuba's blur of the same scene.
        angle = 2 * math.degrees(math.atan(camera.field_width / 2))
        return (
            "global_settings { assumed_gamma 1 max_trace_level 2 }\n"
            f"camera {{ perspective location 0 direction z right x up y angle {angle:.6f}\n"
            f"  aperture {4 * camera.lens_radius_m:.6g}\n"
            f"  focal_point <0,0,{camera.focus_distance_m:.6g}>\n"
            f"  blur_samples {SAMPLES} variance 0 }}\n"
            f"background {{ rgb {_vector(self._scene.background)} }}"
        )

    def _lights(self) -> list[str]:
        out = []
        for light in self._scene.lights:
            x, y, z = light.vector
            if light.kind == POINT:
                where, how = (x, -y, z), ""
            else:
                where, how = (1e4 * x, -1e4 * y, 1e4 * z), " parallel point_at 0"
            how += "" if light.casts_shadows else " shadowless"
            out.append(f"light_source {{ {_vector(where)} rgb {_vector(light.colour)}{how} }}")
        return out

    def _texture(self, index: int) -> str:
        material, ambient = self._scene.materials[index], _vector(self._scene.ambient)
        pigment = f"rgb {_vector(material.diffuse)}"
        if material.texture >= 0 and len(self._scene.uvs):
            pigment = f'uv_mapping image_map {{ png "{material.texture}.png" interpolate 2 }}'
        shine = ""
        if any(material.specular):
            roughness = 1 / max(material.shininess, 1.0)
            shine = f" specular {max(material.specular):.4g} roughness {roughness:.4g}"
        finish = f"ambient rgb {ambient} diffuse 1{shine}"
        return f"texture {{ pigment {{ {pigment} }} finish {{ {finish} }} }}"

    def _mesh(self) -> Iterator[str]:
        scene = self._scene
        count = scene.triangle_count
        flip = np.array([1, -1, 1], np.float32)

        def block(name: str, array: np.ndarray) -> str:
            return f"{name} {{ {len(array)},\n" + "\n".join(map(_vector, array)) + "\n}"

        yield "mesh2 {"
        yield block("vertex_vectors", scene.triangles.reshape(-1, 3) * flip)
        if len(scene.normals):
            yield block("normal_vectors", scene.normals.reshape(-1, 3) * flip)
        if len(scene.uvs):
            yield block("uv_vectors", scene.uvs.reshape(-1, 2))
        textures = [self._texture(index) for index in range(len(scene.materials))]
        yield f"texture_list {{ {len(textures)}, " + "\n".join(textures) + " }"
        faces = [f"<{3 * k},{3 * k + 1},{3 * k + 2}>,{scene.material_ids[k]}" for k in range(count)]
        yield f"face_indices {{ {count},\n" + ",\n".join(faces) + " }"
        yield "}"

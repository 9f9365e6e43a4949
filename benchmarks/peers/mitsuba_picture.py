"""Mitsuba 3: the picture that a thin lens gives, by its direct integrator.

What matches: triangles, interpolated normals, texture coordinates and textures, diffuse colour,
camera, lens and focus, lights that cast shadows, one shadow ray a camera ray.
What does not: Mitsuba has no Blinn-Phong lobe (materials with a highlight are its rough plastic of
about that width), no ambient light (none is added, which saves it a second ray) and no lights
without shadows (left out); it filters no textures by their footprint and draws lens points of the
round lens at random.
"""

from __future__ import annotations

import math
import os
import time
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from lfcore.scene.model import POINT, Scene
from peers.method import Method, Run, SkippedError

NAME = "mitsuba llvm_ad_rgb"
SAMPLES = 32
LLVM = "DRJIT_LIBLLVM_PATH"

_here: dict = {}


def _newest_llvm() -> str | None:
    """The newest of the system's LLVM libraries: 15 cannot select some 16-wide instructions."""
    found = {}
    for path in Path("/usr/lib").glob("*/libLLVM*.so*"):
        digits = [part for part in path.name.replace("-", ".").split(".") if part.isdigit()]
        if digits:
            found[int(digits[0])] = str(path)
    return found[max(found)] if found else None


def _open(scene: Scene, threads: int, llvm: str | None) -> None:
    if llvm:
        os.environ[LLVM] = llvm
    import mitsuba

    mitsuba.set_variant("llvm_ad_rgb")
    import drjit

    drjit.set_thread_count(threads)
    _here["describe"] = Description(mitsuba, scene)


def _load(slab) -> str:
    describe = _here["describe"]
    _here["scene"] = describe.mitsuba.load_dict(describe.all(slab))
    return describe.mitsuba.__version__


def _render(samples: int, seed: int) -> tuple[float, float, np.ndarray]:
    wall, cpu = time.perf_counter(), time.process_time()
    picture = np.asarray(_here["describe"].mitsuba.render(_here["scene"], spp=samples, seed=seed))
    return time.perf_counter() - wall, time.process_time() - cpu, picture


class MitsubaPicture:
    """One scene in Mitsuba, in a process of its own: a compiler that fails ends only that."""

    def __init__(self, scene: Scene, threads: int):
        try:
            import mitsuba  # noqa: F401
        except ModuleNotFoundError:
            raise SkippedError(
                "the package mitsuba is not installed (pip install mitsuba)"
            ) from None
        self.llvm, self._threads = os.environ.get(LLVM) or _newest_llvm(), threads
        arguments = scene, threads, self.llvm
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), _open, arguments)

    def method(self, slab) -> Method:
        """The rate of one picture of ``slab.pixels`` a side, whole, SAMPLES rays a pixel a run.

        The rate hardly depends on how many samples a pixel are taken; N x N of them would take
        minutes at large N.
        """
        count, seeds = min(SAMPLES, slab.views**2), iter(range(1 << 30))
        try:
            version = self._pool.submit(_load, slab).result()
            self._pool.submit(_render, 1, 0).result()
        except (BrokenProcessPool, RuntimeError, ImportError) as error:
            self.close()
            why = f"{error}; LLVM: {self.llvm or 'none found'}"
            raise SkippedError(f"it does not run here, see above ({why})") from None

        def run() -> Run:
            wall, cpu, _ = self._pool.submit(_render, count, next(seeds)).result()
            return Run(wall, cpu, slab.pixels**2 * count)

        note = f"Mitsuba {version}, {self._threads} threads, {count} samples a pixel"
        return Method(NAME, "algorithm1", run, f"{note}, {Path(self.llvm or '').name}")

    def picture(self, slab, samples: int) -> np.ndarray:
        """(M, M, 3) float32 linear, to look at."""
        self._pool.submit(_load, slab).result()
        return self._pool.submit(_render, samples, 0).result()[2]

    def close(self) -> None:
        self._pool.shutdown()


class Description:
    """Turns a scene and a slab into Mitsuba's dictionary."""

    def __init__(self, mitsuba, scene: Scene):
        self.mitsuba, self._scene = mitsuba, scene

    def all(self, slab) -> dict:
        out = {
            "type": "scene",
            "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
            "sensor": self._sensor(slab),
        }
        for index, light in enumerate(self._scene.lights):
            if light.casts_shadows and any(light.colour):
                out[f"light_{index}"] = self._light(light)
        for material in range(len(self._scene.materials)):
            mesh = self._mesh(material)
            if mesh is not None:
                out[f"mesh_{material}"] = mesh
        return out

    def _sensor(self, slab) -> dict:
        camera, transform = slab.camera, self.mitsuba.ScalarTransform4f()
        return {
            "type": "thinlens",
            "to_world": transform.look_at([0, 0, 0], [0, 0, 1], [0, -1, 0]),
            "fov": 2 * math.degrees(math.atan(camera.field_width / 2)),
            "aperture_radius": camera.lens_radius_m,
            "focus_distance": camera.focus_distance_m,
            "near_clip": 0.001,
            "far_clip": 1.0e5,
            "sampler": {"type": "independent"},
            "film": {
                "type": "hdrfilm",
                "width": slab.pixels,
                "height": slab.pixels,
                "rfilter": {"type": "box"},
                "pixel_format": "rgb",
            },
        }

    def _light(self, light) -> dict:
        # A diffuse surface of ours returns its colour times the irradiance, without 1/pi.
        colour = [math.pi * c for c in light.colour]
        if light.kind == POINT:
            scale = (light.reference_distance_m or 1.0) ** 2
            value = {"type": "rgb", "value": [c * scale for c in colour]}
            return {"type": "point", "position": list(light.vector), "intensity": value}
        value = {"type": "rgb", "value": colour}
        direction = [-c for c in light.vector]
        return {"type": "directional", "direction": direction, "irradiance": value}

    def _mesh(self, material: int):
        scene, mitsuba = self._scene, self.mitsuba
        which = np.flatnonzero(scene.material_ids == material)
        if not len(which):
            return None
        props = mitsuba.Properties()
        props["bsdf"] = mitsuba.load_dict({"type": "twosided", "inner": self._bsdf(material)})
        mesh = mitsuba.Mesh(
            f"material {material}",
            3 * len(which),
            len(which),
            has_vertex_normals=len(scene.normals) > 0,
            has_vertex_texcoords=len(scene.uvs) > 0,
            props=props,
        )
        values = mitsuba.traverse(mesh)
        values["vertex_positions"] = scene.triangles[which].ravel()
        values["faces"] = np.arange(3 * len(which), dtype=np.uint32)
        if len(scene.normals):
            values["vertex_normals"] = scene.normals[which].ravel()
        if len(scene.uvs):
            uvs = scene.uvs[which].copy()
            uvs[..., 1] = 1 - uvs[..., 1]
            values["vertex_texcoords"] = uvs.ravel()
        values.update()
        return mesh

    def _bsdf(self, index: int) -> dict:
        material, mitsuba = self._scene.materials[index], self.mitsuba
        diffuse = {"type": "rgb", "value": list(material.diffuse)}
        if material.texture >= 0 and len(self._scene.uvs):
            bitmap = mitsuba.Bitmap(np.ascontiguousarray(self._scene.textures[material.texture]))
            diffuse = {"type": "bitmap", "bitmap": bitmap, "filter_type": "bilinear"}
        if not any(material.specular):
            return {"type": "diffuse", "reflectance": diffuse}
        # The Blinn-Phong exponent n is about Beckmann's 2 / alpha^2 - 2.
        return {
            "type": "roughplastic",
            "distribution": "beckmann",
            "alpha": math.sqrt(2 / (material.shininess + 2)),
            "diffuse_reflectance": diffuse,
        }

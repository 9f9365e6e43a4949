"""Mitsuba 3 through a thin lens, in a process of its own, and Intel's denoiser (OIDN).

The same: triangles, normals, textures, lights, lens, focus, box filter of a pixel.  Rays are random
samples of pixel and lens.  *Shading* has our shading (`mitsuba_shading.py`).  *Path* is Mitsuba's
integrator `path`, for matt scenes with a sky, emitters and bounces: suns are a part of the sky's
panorama, so that their shadows have the penumbra of their size; emitters emit on both sides, since
open meshes get a second sheet behind them.  *Even* is the same integrator for mirrors, glass, coats
and veils in even light: all other surfaces emit their colours in front.
"""

import os
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from benchmarks.peers.method import Renderer, Samples, SkippedError, check_installed
from benchmarks.peers.mitsuba_shading import shading_of
from lfcore.evaluation.renderers.mitsuba import Description, mesh_of, start, thin_lens
from lfcore.optics.camera import Camera
from lfcore.oracle.shading import COAT
from lfcore.scene.appearance import Material
from lfcore.scene.model import Scene
from lfcore.scene.sky import radiance

LLVM = "DRJIT_LIBLLVM_PATH"
NEEDS = "mitsuba-oidn and LLVM 16 or later"
PASS_RAYS = 1 << 24
"""The most rays of a pass, 64 per pixel of 512 x 512; each needs tens of bytes in Mitsuba."""
SKY_HEIGHT = 512
"""The rows of the panorama."""
BEHIND = 1e-5
"""The distance of a second sheet, relative to the scene's size."""
COAT_M = 0.001
"""The distance of a coat from its body, metres: Mitsuba's rays start half as far from surfaces."""
ROULETTE = 8
"""The depth at which Russian roulette begins."""
Balls = dict[str, tuple[tuple[float, float, float], float]]
_here: dict[str, Any] = {}
"""The module, the scene, and integrators by whether they have albedo and normals, too."""


def mitsuba_lens(scene: Scene, threads: int) -> Renderer:
    """Open Mitsuba with our shading.

    Raises :class:`SkippedError` for a missing package, or a scene that the integrator cannot shade.
    """
    check_installed("mitsuba", "mitsuba_oidn")
    check_plain(scene)
    return Renderer(_open_shading, (scene, threads, chosen_llvm()), _picture, NEEDS)


def mitsuba_path(scene: Scene, bounces: int | str, threads: int) -> Renderer:
    """Open Mitsuba's path tracer.  Raises :class:`SkippedError` for a missing package."""
    check_installed("mitsuba", "mitsuba_oidn")
    return Renderer(_open_path, (scene, bounces, threads, chosen_llvm()), _picture, NEEDS)


def mitsuba_even(scene: Scene, balls: Balls, events: int, threads: int) -> Renderer:
    """Open Mitsuba's path tracer for a scene in ambient light, with paths of so many mirrors.

    ``balls`` are the centre and radius of spheres, in place of the meshes of materials by name.
    """
    check_installed("mitsuba", "mitsuba_oidn")
    return Renderer(_open_even, (scene, balls, events, threads, chosen_llvm()), _picture, NEEDS)


def chosen_llvm() -> str | None:
    """Return the environment's library of LLVM, or the system's newest: LLVM 15 cannot select some
    16-wide instructions."""
    if LLVM in os.environ:
        return os.environ[LLVM]
    versions = {}
    for path in Path("/usr/lib").glob("*/libLLVM*.so*"):
        digits = [part for part in path.name.replace("-", ".").split(".") if part.isdigit()]
        if digits:
            versions[int(digits[0])] = str(path)
    return versions[max(versions)] if versions else None


def check_plain(scene: Scene, *, may_bounce: bool = False) -> None:
    """Raise :class:`SkippedError` for a scene that the integrator cannot shade as we do."""
    maps = ("metal_texture", "normal_texture", "emission_texture")
    left_out = {
        "colours at corners": len(scene.colours) > 0,
        "cut-outs": any(scene.has_alpha_test(m) for m in scene.every_material),
        "maps of metal, normals or emission": any(
            getattr(m, name) >= 0 for m in scene.every_material for name in maps
        ),
        "area lights and spots": any(x.is_of_emitter or x.is_spot for x in scene.lights),
        "a sky or bounces": not may_bounce and (len(scene.sky) > 0 or scene.bake is not None),
    }
    for feature, present in left_out.items():
        if present:
            raise SkippedError(f"{scene.name} has {feature}, which the integrator lacks")


def _open(threads: int, llvm: str | None) -> Any:
    if llvm:
        os.environ[LLVM] = llvm
    return start("llvm_ad_rgb", threads)


def _open_shading(scene: Scene, threads: int, llvm: str | None) -> None:
    mitsuba = _open(threads, llvm)
    mitsuba.register_integrator("shading", lambda properties: shading_of(scene)(properties))
    mesh = mesh_of(mitsuba, "triangles", scene.triangles, scene.normals, scene.uvs)
    integrators = {
        more: mitsuba.load_dict({"type": "shading", "auxiliary": more}) for more in (False, True)
    }
    loaded = mitsuba.load_dict({"type": "scene", "all": mesh})
    _here.update(mitsuba=mitsuba, scene=loaded, integrators=integrators)


def _open_path(scene: Scene, bounces: int | str, threads: int, llvm: str | None) -> None:
    mitsuba = _open(threads, llvm)
    describe = Lit(mitsuba, scene)
    described = describe.all()
    most = -1 if bounces == "all" else int(bounces) + 2
    described["integrator"] = {"type": "path", "max_depth": most, "rr_depth": ROULETTE}
    if len(scene.sky):
        described["sky"] = describe.sky()
    _here.update(mitsuba=mitsuba, scene=mitsuba.load_dict(described), integrators={})


def _open_even(scene: Scene, balls: Balls, events: int, threads: int, llvm: str | None) -> None:
    mitsuba = _open(threads, llvm)
    described = Even(mitsuba, scene, balls).all()
    described["integrator"] = {"type": "path", "max_depth": events + 1, "rr_depth": 2 * events}
    _here.update(mitsuba=mitsuba, scene=mitsuba.load_dict(described), integrators={})


def _picture(camera: Camera, pixels: int, samples: Samples, seed: int) -> tuple[np.ndarray, float]:
    """Render in passes; return ((pixels, pixels, 3) float32 linear light, core seconds).

    Channels after the first three are albedo and normals, for the denoiser.
    """
    mitsuba, has_more = _here["mitsuba"], samples.denoise == "auxiliary"
    sensor = mitsuba.load_dict(thin_lens(mitsuba, camera, pixels, samples.sampler))
    how = {"sensor": sensor, "integrator": _here["integrators"].get(has_more)}
    begun = time.process_time()
    passes = max(1, pixels**2 * samples.per_pixel // PASS_RAYS)
    spp = samples.per_pixel // passes
    picture = np.mean([
        np.array(mitsuba.render(_here["scene"], spp=spp, seed=passes * seed + number, **how))
        for number in range(passes)
    ], axis=0)  # fmt: skip
    parts = [np.ascontiguousarray(picture[..., k : k + 3], np.float32) for k in (0, 3, 6)]
    if samples.denoise:
        more = {"albedo": parts[1], "normal": parts[2]} if has_more else {}
        parts[0] = denoised(parts[0], **more)
    return np.asarray(parts[0], np.float32), time.process_time() - begun


def denoised(picture: np.ndarray, **more: np.ndarray) -> np.ndarray:
    """Denoise a picture of linear light, by Intel's denoiser."""
    import mitsuba_oidn

    return np.asarray(mitsuba_oidn.denoise(picture, **more, hdr=True))


class Lit(Description):
    """The description of a scene with its sky and emitters."""

    def __init__(self, mitsuba, scene: Scene):
        super().__init__(mitsuba, _with_backs(without_suns(scene)), leave_out_ambient=True)

    def radiance(self, material: int) -> dict | None:
        emission = self._scene.every_material[material].emission
        return {"type": "rgb", "value": list(emission)} if any(emission) else None

    def sky(self) -> dict:
        """Describe the sky; Mitsuba's panorama begins at -z and turns to +x."""
        light = panorama(self._scene.sky, np.array([[0, 0, -1], [1, 0, 0], [0, 1, 0]]))
        return {"type": "envmap", "bitmap": self.mitsuba.Bitmap(light)}


class Even(Description):
    """The description of a scene in ambient light, with mirrors, rough metal, glass, coats and
    veils.

    A coat is a sheet of glass on its body, which emits as much more as light loses on its way out
    of glass.
    """

    def __init__(self, mitsuba, scene: Scene, balls: Balls):
        super().__init__(mitsuba, scene)
        self._balls = balls

    def _mesh(self, material: int) -> Any:
        name = self._scene.every_material[material].name
        if name not in self._balls:
            return super()._mesh(material)
        centre, radius = self._balls[name]
        return {
            "type": "sphere", "center": list(centre), "radius": radius, "bsdf": self.bsdf(material),
        }  # fmt: skip

    def all(self) -> dict:
        described = super().all()
        for number, material in enumerate(self._scene.every_material):
            if material.clearcoat:
                described[f"coat_{number}"] = self._sheet(number)
        return described

    def radiance(self, material: int) -> dict | None:
        m = self._scene.every_material[material]
        if m.transmission or m.metallic == 1:
            return None
        share = m.opacity * (COAT**2 if m.clearcoat else 1)
        ambient, emission = (share * np.array(light) for light in (self._scene.ambient, m.emission))
        return self._colour(material, ambient, emission)

    def _reflection(self, material: Material, colour: dict) -> dict:
        if material.metallic < 1:
            return {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0] * 3}}
        return super()._reflection(material, colour)

    def _sheet(self, number: int) -> Any:
        members = self._scene.material_ids == number
        corners = self._scene.triangles[members]
        p, q, r = corners.swapaxes(0, 1).astype(np.float64)
        out = np.cross(q - p, r - p)
        out *= COAT_M / np.linalg.norm(out, axis=1, keepdims=True)
        props, none = self.mitsuba.Properties(), np.zeros((0, 3, 3), np.float32)
        alpha = self._scene.every_material[number].clearcoat_roughness ** 2
        rough = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha}
        smooth = {"type": "dielectric", "int_ior": COAT}
        props["bsdf"] = self.mitsuba.load_dict(smooth | rough if alpha else smooth)
        sheet = (corners + out[:, None]).astype(np.float32)
        return mesh_of(self.mitsuba, f"coat {number}", sheet, none, none, props)


def without_suns(scene: Scene) -> Scene:
    """Return the scene without lights that are also in its sky."""
    return replace(scene, lights=[x for x in scene.lights if not x.angular_radius])


def panorama(sky: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return (SKY_HEIGHT, 2 SKY_HEIGHT, 3) float32 radiance, from top to bottom.

    ``axes`` (3, 3) are the directions of its beginning, of a quarter turn, and of the top.
    """
    across, down = (np.arange(4 * n) + 0.5 for n in (2 * SKY_HEIGHT, SKY_HEIGHT))
    turn, polar = np.meshgrid(across / len(across) * 2 * np.pi, down / len(down) * np.pi)
    d = [np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)]
    light = radiance(sky, np.stack(d, -1).reshape(-1, 3) @ axes)
    return light.reshape(SKY_HEIGHT, 4, 2 * SKY_HEIGHT, 4, 3).mean((1, 3))


def _with_backs(scene: Scene) -> Scene:
    """With a second sheet, turned around, behind triangles that emit: Mitsuba's emit in front.

    Closed meshes have none: Mitsuba's shadow rays end before the emitter, and would pass walls that
    are thinner than that.
    """
    emits = np.zeros(len(scene.every_material), bool)
    for number, material in enumerate(scene.every_material):
        if any(material.emission):
            corners = scene.triangles[scene.material_ids == number]
            mesh = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners))
            emits[number] = not mesh.is_watertight
    which = np.flatnonzero(emits[scene.material_ids])
    p, q, r = scene.triangles[which].swapaxes(0, 1).astype(np.float64)
    out = np.cross(q - p, r - p)
    out *= BEHIND * np.ptp(scene.triangles) / np.linalg.norm(out, axis=1, keepdims=True)

    def doubled(values: np.ndarray, back: np.ndarray) -> np.ndarray:
        return np.concatenate([values, back[:, ::-1].astype(np.float32)]) if len(values) else values

    return replace(
        scene,
        triangles=doubled(scene.triangles, scene.triangles[which] - out[:, None]),
        normals=doubled(scene.normals, -scene.normals[which[: len(scene.normals)]]),
        uvs=doubled(scene.uvs, scene.uvs[which[: len(scene.uvs)]]),
        material_ids=np.concatenate([scene.material_ids, scene.material_ids[which]]),
    )

"""Mitsuba 3's `path` integrator: a matt scene with sky, suns, lamps and bounces.

The same: triangles, normals, textures, lights, lens, focus, box filter of a pixel.  Suns are a part
of the sky's panorama, not separate lights: their shadows have the penumbra of their size.  Emitters
emit on both sides: open meshes get a second sheet behind them.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import trimesh

from benchmarks.peers.method import Renderer, Samples, check_installed
from benchmarks.peers.mitsuba_picture import NEEDS, chosen_llvm, render, start
from lfcore.optics.camera import Camera
from lfcore.scene.mitsuba import Description, thin_lens
from lfcore.scene.model import Scene
from lfcore.scene.sky import radiance, suns

SKY_HEIGHT = 512
"""The rows of the panorama."""
BEHIND = 1e-5
"""The distance of a second sheet, relative to the scene's size."""
ROULETTE = 8
"""The depth at which Russian roulette begins."""
_here: dict[str, Any] = {}


def mitsuba_path(scene: Scene, bounces: int | str, threads: int) -> Renderer:
    """Open Mitsuba with a scene.  Raises :class:`SkippedError` for a missing package."""
    check_installed("mitsuba", "mitsuba_oidn")
    return Renderer(_open, (scene, bounces, threads, chosen_llvm()), _picture, NEEDS)


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


def without_suns(scene: Scene) -> Scene:
    """Return the scene without lights that are also in its sky."""
    towards = [sun.vector for sun in suns(scene.sky)[1]] if len(scene.sky) else []
    return replace(scene, lights=[x for x in scene.lights if x.vector not in towards])


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


def _open(scene: Scene, bounces: int | str, threads: int, llvm: str | None) -> None:
    mitsuba = start(threads, llvm)
    describe = Lit(mitsuba, scene)
    described = describe.all({})
    most = -1 if bounces == "all" else int(bounces) + 2
    described["integrator"] = {"type": "path", "max_depth": most, "rr_depth": ROULETTE}
    del described["sensor"]
    if len(scene.sky):
        described["sky"] = describe.sky()
    _here.update(mitsuba=mitsuba, scene=mitsuba.load_dict(described))


def _picture(camera: Camera, pixels: int, samples: Samples, seed: int):
    mitsuba = _here["mitsuba"]
    sensor = thin_lens(mitsuba, camera, pixels, samples.sampler)
    return render(mitsuba, _here["scene"], pixels, samples, seed, sensor=mitsuba.load_dict(sensor))

"""Scenes as the benchmarks want them: built once, with a tracer; and the same one at any size."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.measured.rows import say
from lfcore.opencl.device import Device
from lfcore.scene.build import build_scene
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.timing import clocked
from lfcore.tracing.bvh import Bvh, build_bvh
from lfcore.tracing.tracer import Tracer

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@dataclass
class Loaded:
    """A scene with its hierarchy and a tracer on the default device."""

    name: str
    scene: Scene
    bvh: Bvh
    bvh_seconds: float
    tracer: Tracer

    @classmethod
    def open(cls, name: str, device: Device | None = None) -> Loaded:
        """``name`` is a folder of ``scenes/`` or the path of a scene file."""
        path = Path(name) if Path(name).suffix else SCENES / name / "scene.yaml"
        say(f"building {name}")
        return cls.of(path.stem if Path(name).suffix else name, build_scene(path), device)

    @classmethod
    def of(cls, name: str, scene: Scene, device: Device | None = None) -> Loaded:
        bvh, seconds = clocked(lambda: build_bvh(scene.triangles))
        return cls(name, scene, bvh, seconds, Tracer(scene, bvh, device))

    def with_device(self, device: Device) -> Tracer:
        return Tracer(self.scene, self.bvh, device)

    def with_needs(self, **changes) -> Tracer:
        """A tracer of a program that leaves features out (or of a scene without them)."""
        needs = replace(Needs.of(self.scene), **changes)
        return Tracer(self.scene, self.bvh, self.tracer.device, needs)

    def with_lights(self, lights: list) -> Tracer:
        scene = replace(self.scene, lights=lights)
        return Tracer(scene, self.bvh, self.tracer.device)


def resampled(scene: Scene, triangles: int) -> Scene:
    """``scene`` with about ``triangles`` triangles: the largest are split in four, time and again.

    The surface stays the same, so that only the number of triangles changes; fewer than the scene
    has are a random part of them.
    """
    rng = np.random.default_rng(7)
    if triangles < scene.triangle_count:
        kept = np.sort(rng.permutation(scene.triangle_count)[:triangles])
        return _taken(scene, kept)
    while scene.triangle_count < triangles:
        count = scene.triangle_count
        corners = scene.triangles
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        order = np.argsort(-np.linalg.norm(sides, axis=1), kind="stable")
        split = order[: min(count, -(-(triangles - count) // 3))]
        scene = _split(scene, split)
    return scene


def _taken(scene: Scene, which: np.ndarray) -> Scene:
    return replace(
        scene,
        triangles=scene.triangles[which],
        normals=scene.normals[which] if len(scene.normals) else scene.normals,
        uvs=scene.uvs[which] if len(scene.uvs) else scene.uvs,
        colours=scene.colours[which] if len(scene.colours) else scene.colours,
        material_ids=scene.material_ids[which],
    )


def _split(scene: Scene, which: np.ndarray) -> Scene:
    rest = np.setdiff1d(np.arange(scene.triangle_count), which)
    kept, cut = _taken(scene, rest), _taken(scene, which)

    def four(a: np.ndarray) -> np.ndarray:
        if not len(a):
            return a
        p, q, r = a[:, 0], a[:, 1], a[:, 2]
        pq, qr, rp = (p + q) / 2, (q + r) / 2, (r + p) / 2
        parts = [(p, pq, rp), (pq, q, qr), (rp, qr, r), (qr, rp, pq)]
        return np.concatenate([np.stack(part, axis=1) for part in parts]).astype(a.dtype)

    return replace(
        kept,
        triangles=np.concatenate([kept.triangles, four(cut.triangles)]),
        normals=np.concatenate([kept.normals, four(cut.normals)]),
        uvs=np.concatenate([kept.uvs, four(cut.uvs)]),
        colours=np.concatenate([kept.colours, four(cut.colours)]),
        material_ids=np.concatenate([kept.material_ids, np.tile(cut.material_ids, 4)]),
    )

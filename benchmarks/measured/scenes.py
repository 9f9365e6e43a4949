"""The benchmarks' scenes: built once, with a tracer."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from benchmarks.measured.rows import say
from lfcore.scene.build import build_scene
from lfcore.scene.model import Scene
from lfcore.tracing.bvh import Bvh, build_bvh
from lfcore.tracing.tracer import Tracer

SCENES = Path(__file__).resolve().parents[2] / "scenes"


@dataclass
class Loaded:
    """A scene with its hierarchy and a tracer on the default device."""

    name: str
    scene: Scene
    bvh: Bvh
    tracer: Tracer

    @classmethod
    def open(cls, name: str) -> Loaded:
        say(f"building {name}")
        scene = build_scene(SCENES / name / "scene.yaml")
        bvh = build_bvh(scene.triangles)
        return cls(name, scene, bvh, Tracer(scene, bvh))

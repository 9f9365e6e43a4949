"""The benchmarks' scenes: built once, with a tracer."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.measured.rows import say
from lfcore.opencl.device import Device
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
    def open(cls, name: str, device: Device | None = None) -> Loaded:
        """``name`` is a folder of ``scenes/`` or the path of a scene file."""
        path = Path(name) if Path(name).suffix else SCENES / name / "scene.yaml"
        say(f"building {name}")
        return cls.of(path.stem if Path(name).suffix else name, build_scene(path), device)

    @classmethod
    def of(cls, name: str, scene: Scene, device: Device | None = None) -> Loaded:
        bvh = build_bvh(scene.triangles)
        return cls(name, scene, bvh, Tracer(scene, bvh, device))

    def with_device(self, device: Device) -> Tracer:
        return Tracer(self.scene, self.bvh, device)

    def with_lights(self, lights: list) -> Tracer:
        scene = replace(self.scene, lights=lights)
        return Tracer(scene, self.bvh, self.tracer.device)

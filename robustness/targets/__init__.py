"""What is fuzzed: each target has seeds, mutations, and a judge of what comes of an input."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from random import Random

from robustness.children import Limits
from robustness.mutate import Mutation
from robustness.outcome import Outcome

WARM = (
    "lfcore.rendering.direct", "lfcore.rendering.photograph", "lfcore.rendering.record",
    "lfcore.lightfield", "lfcore.refocus.array.sampling", "lfcore.scene.procedural.sphere",
    "lfcore.scene.pbrt", "trimesh.exchange.gltf", "scipy.spatial.transform", "scipy.stats", "cv2",
    "PIL.GifImagePlugin", "PIL.TiffImagePlugin", "PIL.WebPImagePlugin", "PIL.TgaImagePlugin",
)  # fmt: skip
"""What readers and commands import when they need it, imported once before the children."""
MODULES = (
    "scenes", "meshes", "pictures", "exchange", "stores", "settings", "commands", "tracing",
)  # fmt: skip


@dataclass(frozen=True)
class Target:
    """One way into the project.

    seeds : called once with a folder of its own; whole inputs.
    judge : (input, folder) to outcome; the folder holds the target's side files.
    sides : writes the side files that inputs may name, into each folder of a child.
    weight : share of the time.
    batch : inputs of one child.
    takes_seeds : each seed must be taken; else it may be refused (for want of a device).
    portable : inputs mean the same on every machine, so that they can be kept.
    """

    name: str
    seeds: Callable[[Path], Sequence[bytes]]
    mutate: Mutation
    judge: Callable[[bytes, Path], Outcome]
    sides: Callable[[Path], None] = lambda folder: None
    limits: Limits = field(default_factory=Limits)
    weight: float = 1.0
    batch: int = 100
    takes_seeds: bool = True
    portable: bool = True

    def input(self, seed: int, index: int, seeds: Sequence[bytes]) -> bytes:
        """Input ``index`` of the run ``seed``: always the same bytes."""
        draw = Random(f"{seed}/{self.name}/{index}")
        return self.mutate(draw, draw.choice(seeds), seeds)


def all_targets() -> dict[str, Target]:
    """By name.  Imports the library: the parent of all children should be one that has."""
    for name in WARM:
        import_module(name)
    modules = (import_module(f"robustness.targets.{name}") for name in MODULES)
    return {target.name: target for module in modules for target in module.targets()}

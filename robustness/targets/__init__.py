"""The targets of the fuzzer: each has seeds, mutations, and a judge of outcomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from random import Random

from robustness.children import Limits
from robustness.mutate import Mutation
from robustness.outcome import Outcome, outcome_of

WARM = (
    "lfcore.rendering.direct", "lfcore.rendering.photograph", "lfcore.rendering.record",
    "lfcore.lightfield", "lfcore.refocus.array.sampling", "lfcore.scene.procedural.sphere",
    "lfcore.readers.pbrt", "lfcore.readers.gltf.meshes", "scipy.spatial.transform", "scipy.stats",
    "cv2", "PIL.GifImagePlugin", "PIL.TiffImagePlugin", "PIL.WebPImagePlugin", "PIL.TgaImagePlugin",
)  # fmt: skip
"""Modules that readers and commands import late; the parent imports them before it forks."""
MODULES = ("scenes", "meshes", "pictures", "exchange", "stores", "settings", "commands", "objects")


@dataclass(frozen=True)
class Target:
    """One way to feed input to the project.

    ``seeds(folder)`` returns valid inputs, once; ``judge(input, folder)`` an outcome.  ``sides``
    writes side files, which inputs may name, to each child's folder.  ``weight`` is the share of
    the time, ``batch`` the inputs per child.  Without ``takes_seeds`` a seed may be refused, for
    lack of a device; ``portable`` inputs mean the same on every machine, and can be kept.
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
        """Input ``index`` of the run with this seed: always the same bytes."""
        draw = Random(f"{seed}/{self.name}/{index}")
        return self.mutate(draw, draw.choice(seeds), seeds)


def seeds_folder(folder: Path) -> Path:
    """Where the seeds were made whose inputs are judged in ``folder``."""
    return folder.with_name("seeds")


def of_file(
    name: str, check: Callable[[Path], object], *, named: bool = True
) -> Callable[[bytes, Path], Outcome]:
    """A judge: runs ``check`` on an input in a file, which refusals must name if ``named``."""

    def judge(data: bytes, folder: Path) -> Outcome:
        file = folder / name
        file.write_bytes(data)
        return outcome_of(lambda: check(file), names=str(file) if named else None)

    return judge


def all_targets() -> dict[str, Target]:
    """All targets by name.  This imports the library, before the parent forks."""
    for name in WARM:
        import_module(name)
    modules = (import_module(f"robustness.targets.{name}") for name in MODULES)
    return {target.name: target for module in modules for target in module.targets()}

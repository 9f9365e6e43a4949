"""The fuzzer's targets: each has seeds, a strategy of inputs, and a judge of outcomes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

from robustness.children import Limits
from robustness.inputs import Inputs
from robustness.outcome import Outcome, outcome_of

WARM = (
    "lfcore.rendering.direct", "lfcore.rendering.photograph", "lfcore.rendering.record",
    "lfcore.lightfield", "lfcore.refocus.array.sampling", "lfcore.scene.procedural.sphere",
    "lfcore.readers.pbrt", "lfcore.readers.gltf.meshes", "scipy.spatial.transform", "scipy.stats",
    "cv2", "PIL.GifImagePlugin", "PIL.TiffImagePlugin", "PIL.WebPImagePlugin", "PIL.TgaImagePlugin",
)  # fmt: skip
"""The modules that readers and commands import late; the parent imports them before it forks."""
MODULES = ("scenes", "meshes", "pictures", "exchange", "stores", "settings", "commands", "objects")
"""The modules of targets."""


@dataclass(frozen=True)
class Target:
    """A kind of input.

    Attributes
    ----------
    name, limits
        Its name and the limits of an input.
    seeds, inputs : callable
        ``seeds(folder)`` returns valid inputs; ``inputs(seeds)`` is hypothesis's strategy.
    judge : callable
        ``judge(input, folder)`` returns an outcome.
    sides : callable
        Writes side files, which inputs may name, to the children's folder.
    takes_seeds : bool
        Whether every seed must be accepted; False where judging lacks a device.
    portable : bool
        Whether inputs mean the same on every machine, and can be kept.
    """

    name: str
    seeds: Callable[[Path], Sequence[bytes]]
    inputs: Callable[[Sequence[bytes]], Inputs]
    judge: Callable[[bytes, Path], Outcome]
    sides: Callable[[Path], None] = lambda folder: None
    limits: Limits = field(default_factory=Limits)
    takes_seeds: bool = True
    portable: bool = True


def seeds_folder(folder: Path) -> Path:
    """Return the folder of the seeds of the inputs that are judged in ``folder``."""
    return folder.with_name("seeds")


def of_file(
    name: str, check: Callable[[Path], object], *, named: bool = True
) -> Callable[[bytes, Path], Outcome]:
    """Return a judge that runs ``check`` on a file; refusals must contain its name if ``named``."""

    def judge(data: bytes, folder: Path) -> Outcome:
        file = folder / name
        file.write_bytes(data)
        return outcome_of(lambda: check(file), names=str(file) if named else None)

    return judge


def all_targets() -> dict[str, Target]:
    """Return all targets by name.  This imports the library, before the parent forks."""
    for name in WARM:
        import_module(name)
    modules = (import_module(f"robustness.targets.{name}") for name in MODULES)
    return {target.name: target for module in modules for target in module.targets()}

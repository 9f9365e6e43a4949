"""A measured method and one run of it, and renderers in processes of their own."""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from importlib.util import find_spec
from multiprocessing import get_context

from lfcore import timing
from lfcore.optics.camera import Camera


class SkippedError(Exception):
    """This method cannot run here; the message says what is missing."""


def check_installed(*packages: str) -> None:
    """Raise :class:`SkippedError` for packages that are not installed."""
    missing = [name.replace("_", "-") for name in packages if find_spec(name) is None]
    if missing:
        raise SkippedError(f"not installed: pip install {' '.join(missing)}")


@dataclass(frozen=True)
class Run:
    """One run: wall seconds, CPU seconds of all threads, rays."""

    seconds: float
    cpu_seconds: float
    rays: int


@dataclass
class Method:
    """A named piece of work that can be run again and again.

    ``run`` does the work once.  ``note`` has what a reader needs to compare: threads, instruction
    set, differences.  ``check`` returns (share of rays that hit, their mean depth), or None if they
    are unknown.
    """

    name: str
    work: str
    run: Callable[[], Run]
    note: str = ""
    check: Callable[[], tuple[float, float] | None] = lambda: None
    ours: bool = False
    extra: dict = field(default_factory=dict)


def clocked(work: Callable[[], object], rays: int) -> Run:
    """Run ``work`` in this process under both clocks."""
    (_, cpu), wall = timing.clocked(lambda: timing.clocked(work, clock=time.process_time))
    return Run(wall, cpu, rays)


@dataclass(frozen=True)
class Samples:
    """A renderer's settings: samples per pixel, Mitsuba's sampler, and the denoiser's input if any.

    ``denoise`` is ``""``, ``"picture"``, or ``"auxiliary"`` with albedo and normals.
    """

    per_pixel: int
    sampler: str = "multijitter"
    denoise: str = ""


class Renderer:
    """A scene in another renderer, in a process of its own, that ``prepare(*arguments)`` loads.

    ``render(camera, pixels, samples, seed)`` makes a picture there.  Raises :class:`SkippedError`
    where the process does not begin, with what it ``needs``.
    """

    def __init__(self, prepare: Callable, arguments: tuple, render: Callable, needs: str):
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), prepare, arguments)
        self._render = render
        try:
            self._pool.submit(int).result()
        except BrokenProcessPool as error:
            self.close()
            raise SkippedError(f"does not run, see above ({error}); it needs {needs}") from None

    def picture(self, camera: Camera, pixels: int, samples: Samples, seed: int = 0):
        """((pixels, pixels, 3) float32 linear light, core seconds)."""
        return self._pool.submit(self._render, camera, pixels, samples, seed).result()

    def close(self) -> None:
        self._pool.shutdown()

"""Measured methods, and renderers in other processes."""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib.util import find_spec
from multiprocessing import get_context
from typing import Any

from lfcore.optics.camera import Camera
from lfcore.timing import clocked


class SkippedError(Exception):
    """This method cannot run here; the message names what is missing."""


def check_installed(*packages: str) -> None:
    """Raise :class:`SkippedError` for packages that are not installed."""
    missing = [name.replace("_", "-") for name in packages if find_spec(name) is None]
    if missing:
        raise SkippedError(f"not installed: pip install {' '.join(missing)}")


@dataclass
class Method:
    """A way to find the first hits of rays.

    Attributes
    ----------
    name, note : str
        Its name; its threads and instruction set.
    rays : int
        The number of rays.
    run : callable
        Traces them once, and returns core seconds.
    check : callable
        Returns (share of rays that hit, their mean depth).
    """

    name: str
    rays: int
    run: Callable[[], float]
    note: str
    check: Callable[[], tuple[float, float]]


def core_seconds(work: Callable[[], object]) -> float:
    """Return the core seconds of one run of ``work``, by all threads of this process."""
    return clocked(work, clock=time.process_time)[1]


@dataclass(frozen=True)
class Samples:
    """A renderer's settings: samples per pixel, Mitsuba's sampler, and the denoiser's input.

    ``denoise`` is ``""`` for none, ``"picture"``, or ``"auxiliary"`` with albedo and normals, too.
    """

    per_pixel: int
    sampler: str = "multijitter"
    denoise: str = ""


class Renderer:
    """Another renderer in its own process, into which ``prepare(*arguments)`` loads a scene.

    ``render(camera, pixels, samples, seed)`` renders a picture there.  If its compiler fails, the
    caller gets :class:`SkippedError` with what the renderer ``needs``.
    """

    def __init__(self, prepare: Callable, arguments: tuple, render: Callable, needs: str):
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), prepare, arguments)
        self._render, self._needs = render, needs
        self.ask(int)

    def ask(self, work: Callable, *arguments: object) -> Any:
        """Run ``work(*arguments)`` there, and return the result."""
        try:
            return self._pool.submit(work, *arguments).result()
        except (RuntimeError, ImportError) as error:
            self.close()
            problem = f"does not run, see above ({error}); it needs {self._needs}"
            raise SkippedError(problem) from None

    def picture(self, camera: Camera, pixels: int, samples: Samples, seed: int = 0):
        """Return ((pixels, pixels, 3) float32 linear light, core seconds)."""
        return self.ask(self._render, camera, pixels, samples, seed)

    def close(self) -> None:
        self._pool.shutdown()

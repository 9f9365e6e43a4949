"""A measured method, and renderers in processes of their own."""

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
    """This method cannot run here; the message says what is missing."""


def check_installed(*packages: str) -> None:
    """Raise :class:`SkippedError` for packages that are not installed."""
    missing = [name.replace("_", "-") for name in packages if find_spec(name) is None]
    if missing:
        raise SkippedError(f"not installed: pip install {' '.join(missing)}")


@dataclass
class Method:
    """A way to find the first hits of so many ``rays``, again and again.

    ``run`` does so once and returns its core seconds.  ``note`` has threads and instruction set.
    ``check`` returns (share of rays that hit, their mean depth).
    """

    name: str
    rays: int
    run: Callable[[], float]
    note: str
    check: Callable[[], tuple[float, float]]


def core_seconds(work: Callable[[], object]) -> float:
    """Of one run of ``work``, by all threads of this process."""
    return clocked(work, clock=time.process_time)[1]


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

    A compiler that fails ends only that: :class:`SkippedError`, with what the renderer ``needs``.
    ``render(camera, pixels, samples, seed)`` makes a picture there.
    """

    def __init__(self, prepare: Callable, arguments: tuple, render: Callable, needs: str):
        self._pool = ProcessPoolExecutor(1, get_context("spawn"), prepare, arguments)
        self._render, self._needs = render, needs
        self.ask(int)

    def ask(self, work: Callable, *arguments: object) -> Any:
        """What ``work(*arguments)`` returns there."""
        try:
            return self._pool.submit(work, *arguments).result()
        except (RuntimeError, ImportError) as error:
            self.close()
            why = f"does not run, see above ({error}); it needs {self._needs}"
            raise SkippedError(why) from None

    def picture(self, camera: Camera, pixels: int, samples: Samples, seed: int = 0):
        """((pixels, pixels, 3) float32 linear light, core seconds)."""
        return self.ask(self._render, camera, pixels, samples, seed)

    def close(self) -> None:
        self._pool.shutdown()

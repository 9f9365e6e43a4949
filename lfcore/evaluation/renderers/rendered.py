"""A picture by some renderer, or the reason why there is none."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lfcore.errors import LfcoreError, SceneError
from lfcore.opencl.device import programs_made
from lfcore.timing import clocked_warm


@dataclass(frozen=True)
class Rendered:
    """A picture (M, M, 3), linear light, its rays per pixel and the seconds of rendering; if
    ``picture`` is None, ``note`` has the reason."""

    method: str
    picture: np.ndarray | None
    rays: int = 0
    seconds: float = math.nan
    note: str = ""


class NotRenderedError(LfcoreError):
    """A renderer that is not installed, or does not run."""


def timed(work: Callable[[], np.ndarray], method: str, rays: int, note: str) -> Rendered:
    """Return the picture of ``work`` and its seconds, without those of building programs."""
    picture, seconds = clocked_warm(work, programs_made)
    return Rendered(method, picture, rays, seconds, note)


def or_left_out(name: str, render: Callable[..., Rendered], *arguments: object) -> Rendered:
    """Return the picture of a renderer, or a row with the reason why there is none."""
    try:
        return render(*arguments)
    except (NotRenderedError, SceneError) as error:
        return Rendered(name, None, note=f"left out: {error}")

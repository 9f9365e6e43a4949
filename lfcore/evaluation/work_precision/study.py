"""What is measured of a scene for its work-precision diagrams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Study:
    """The keys of ``analysis.work_precision``; ``config/README.md`` says what each means."""

    pixels: int
    views: Sequence[int]
    window_picture: int
    window_truth: Sequence[Sequence[int]]
    truth: Sequence[Sequence[float]]
    f_stops: Sequence[float]
    stored_pixels: int
    stored_lattice: Sequence[float]
    video_views: int
    crfs: Sequence[float]
    codecs: Sequence[Mapping]
    monte_carlo_samples: Sequence[int]
    oracle_pixels: int
    oracle_views: int

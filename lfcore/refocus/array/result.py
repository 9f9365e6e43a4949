"""What a synthesis returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Synthesis:
    """``image`` (h, w, 3) float32, linear; ``coverage`` (h, w) float32.

    ``coverage`` is the share of a pixel's samples (Isaksen: 0 or 1) that the array knows; a
    pixel of coverage 0 is black.
    """

    image: np.ndarray
    coverage: np.ndarray

    @property
    def skipped_share(self) -> float:
        """Share of all samples that met no data camera, from 0 to 1."""
        return float(1.0 - self.coverage.mean(dtype=np.float64))


def combine(values: np.ndarray, coverage: np.ndarray, size: tuple[int, int]) -> Synthesis:
    """From (P, 3) radiance and (P,) coverage of pixels in rows to pictures."""
    width, height = size
    image = np.where(coverage[:, None] > 0, values, 0.0).astype(np.float32)
    return Synthesis(
        image.reshape(height, width, 3), coverage.astype(np.float32).reshape(height, width)
    )

"""Orders of convergence, observed from errors over N, by kind of pixel."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
import pandas as pd

from lfcore.evaluation.work_precision.windows import KINDS

SMOOTH_ORDER = {"stratified": 1.0, "Halton": 2.0, "independent": 1.0}
"""Order in N of a smooth integrand over lens and pixel, N squared samples: independent ones err by
the square root of their number, and shuffled strata so where lens and pixel act together; low
discrepancy by a power more.  For grids none is known, and rays through the middle of a pixel do not
converge to its average."""
BROKEN = 0.3
"""How far below that an order lies that is called broken."""


def with_orders(rows: Iterable[dict]) -> Iterator[dict]:
    """Rows of one curve, in order of N, with the order of convergence observed between them.

    ``error ~ N^-order``, N the square root of the rays a pixel: 1 for independent samples, since
    their error falls with the square root of their number.
    """
    before = None
    for row in rows:
        if before and row["rmse"] and before["rmse"]:
            rays = math.sqrt(row["rays_per_pixel"] / before["rays_per_pixel"])
            row = row | {"order": math.log(before["rmse"] / row["rmse"]) / math.log(rays)}
        yield row
        before = row


def fitted_order(side: np.ndarray | pd.Series, error: np.ndarray | pd.Series) -> float:
    """Least-squares order of ``error ~ side^-order``; NaN for fewer than two points."""
    if len(side) < 2:
        return math.nan
    return float(-np.polyfit(np.log(side), np.log(error), 1)[0])


def error_column(kind: str) -> str:
    """Of a row: where the error stands of pixels of one of :data:`KINDS`, or of ``all``."""
    return "rmse" if kind == "all" else f"rmse_{kind}"


def convergence(points: pd.DataFrame) -> list[dict]:
    """Observed orders by scene, aperture, method and kind of pixel, and whether they break."""
    made = []
    for keys, curve in points.groupby(["scene", "f_number", "method"], sort=False):
        scene, f_number, method = keys
        smooth = SMOOTH_ORDER.get(method)
        for kind in ("all", *KINDS):
            column = error_column(kind)
            known = curve[curve[column] > 0] if column in curve else curve[:0]
            if len(known) < 2:
                continue
            order = fitted_order(np.sqrt(known.rays_per_pixel), known[column])
            made.append(
                {
                    "scene": scene,
                    "f_number": f_number,
                    "method": method,
                    "pixels": kind,
                    "points": len(known),
                    "rmse_at_last": known[column].iloc[-1],
                    "order": order,
                    "order_if_smooth": smooth,
                    "breaks": None if smooth is None else order < smooth - BROKEN,
                }
            )
    return made

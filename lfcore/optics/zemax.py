"""Lenses of Zemax text (.zmx), which package optiland reads: glasses by their catalogues."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.lens_system import LensSystem

FLAT_M = 1e4
"""The radius of a flat surface, metres: its sag is below a nanometre."""
MM = 1e-3
EVEN_TERMS = 8
"""The coefficients of an even asphere, up to r^16."""

_Row = tuple[float, float, list[float], float, float, np.ndarray]


def read_zemax(path: Path, wavelengths_um: Sequence[float]) -> list[LensSystem]:
    """Read the surfaces for each wavelength.

    Raises :class:`OpticsError` for a file that is no such text, for surfaces that are no spheres or
    even aspheres about the axis, and without package optiland.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the package's compiler
            from optiland.fileio.zemax.reader.parser import ZemaxDataParser
    except ImportError:
        problem, remedy = "Zemax text needs package optiland", "Run: pip install 'lfcore[lenses]'"
        raise OpticsError(problem, file=path, remedy=remedy) from None
    try:
        surfaces = list(ZemaxDataParser(str(path)).parse().surfaces.values())[1:-1]
    except Exception as error:  # whatever another package raises of a bad file
        problem = f"cannot be read as Zemax text: {str(error).rstrip('.')}"
        raise OpticsError(problem, file=path, remedy="Export it as sequential .zmx") from None
    rows: list[_Row] = []
    for number, surface in enumerate(surfaces, 1):
        row, key = _row(surface, path, number, wavelengths_um), f"SURF {number}"
        before = rows[-1][2] if rows else [1.0] * len(wavelengths_um)
        if surface.get("is_stop"):  # a plane of its own, at the vertex
            rows.append((0.0, 0.0, before, row[3], 0.0, np.zeros_like(row[5])))
        if row[2] != before:
            rows.append(row)
        elif rows:  # a dummy surface in one medium
            rows[-1] = (rows[-1][0], rows[-1][1] + row[1], *rows[-1][2:])
        if row[1] < 0:
            remedy = "Correct this line"
            raise OpticsError("the thickness is negative", file=path, key=key, remedy=remedy)
    if not rows:
        raise OpticsError("the lens file holds no surface", file=path)
    radius, thickness, index, aperture, conic, even = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    return [
        LensSystem(radius, thickness, each, aperture, conic=conic, even=even) for each in index.T
    ]


def _row(surface: dict[str, Any], path: Path, number: int, wavelengths_um: Sequence[float]) -> _Row:
    """Radius, thickness, indices, aperture radius, conic constant and coefficients of a surface,
    metres."""
    material: Any = surface.get("material")
    diameter: Any = surface.get("diameter")
    for wrong, problem, remedy in (
        (surface.get("type") not in ("standard", "even_asphere"),
         f"the surface is no sphere or even asphere: {surface.get('type')}",
         "Give a lens of such surfaces"),
        (material == "mirror", "the surface is a mirror", "Give a lens of glass alone"),
        (not diameter or not diameter > 0, "the surface has no DIAM", "Give its semi-diameter"),
    ):  # fmt: skip
        if wrong:
            raise OpticsError(problem, file=path, key=f"SURF {number}", remedy=remedy)
    glass = material is not None and material != "air"
    known = glass and not isinstance(material, str)
    index = [
        float(np.ravel(material.n(each))[0]) if known else math.nan if glass else 1.0
        for each in wavelengths_um
    ]
    if not np.isfinite(index).all():
        remedy = "Name a glass of a catalogue, or its index"
        key = f"SURF {number}"
        raise OpticsError("the glass is in no catalogue", file=path, key=key, remedy=remedy)
    radius, even = float(surface["radius"]), np.zeros(EVEN_TERMS)
    if surface.get("type") == "even_asphere":
        powers = np.arange(EVEN_TERMS)  # PARM 1 is that of r^2
        even = [surface.get(f"param_{power}", 0.0) for power in powers] / MM ** (2.0 * powers + 1)
    return (
        MM * radius if math.isfinite(radius) else FLAT_M,
        MM * float(surface["thickness"]), index, MM * float(diameter),
        float(surface.get("conic") or 0.0), even,
    )  # fmt: skip

"""Rays as bundles: outer elements times an inner grid, affine in both.

Ray (i, j) of element e, counted from the centre of the inner grid, is at depth z

    x(z) = (ox_e + i sx) + z (dx_e + i tx)        y(z) = (oy_e + j sy) + z (dy_e + j ty)

The lens samples of one pixel, the pixels of one lens sample or data camera, and orthographic
rays all have this form, so one kernel traces them all.
"""

from dataclasses import dataclass

import numpy as np

from lfcore.optics.slab import Slab

TEXTURE_PX = 0.7
"""The width that textures are filtered over with one ray per pixel, in pixels."""


def texture_width(rays_per_pixel: float) -> float:
    """The width that textures are filtered over, in pixels of a picture: it falls with the cube
    root of the rays per pixel (measured, docs/notebook/true-picture.md)."""
    return TEXTURE_PX * rays_per_pixel ** (-1 / 3)


@dataclass(frozen=True)
class ElementLattice:
    """A square grid of elements, ``count`` per side, centred on the axis: from one to the next the
    centre ray's origin and direction change by these; ``off_axis`` is the direction at its
    centre."""

    count: int
    origin: float
    direction: float
    off_axis: tuple[float, float] = (0.0, 0.0)

    def centre_rays(self, coordinates: np.ndarray) -> np.ndarray:
        """(E, 4) float32 ox, oy, dx, dy at ``coordinates`` (E, 2), or between elements."""
        offset = np.asarray(coordinates) - (self.count - 1) / 2
        direction = offset * self.direction + self.off_axis
        return np.concatenate([offset * self.origin + 0.0, direction], 1, dtype=np.float32)


@dataclass(frozen=True)
class Bundles:
    """What the tracer is given.

    ``elements`` (E, 4) float32 are ox, oy (metres), dx, dy (tangents) of each element's centre ray;
    ``step`` (4,) float32 is sx, sy, tx, ty, per column and row of the inner grid; textures are
    filtered over ``pixel_pitch``; a ``lattice`` lets one block span several elements; ``band`` is
    the first row and number of rows that are traced, default all.
    """

    elements: np.ndarray
    step: np.ndarray
    columns: int
    rows: int
    pixel_pitch: float
    lattice: ElementLattice | None = None
    band: tuple[int, int] | None = None

    @property
    def first_row(self) -> int:
        return self.band[0] if self.band else 0

    @property
    def traced_rows(self) -> int:
        return self.band[1] if self.band else self.rows

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Origins and directions, float64 (E, rows, columns, 3), evaluated from the float32
        coefficients; for references and tests."""
        e, s = self.elements.astype(float), self.step.astype(float)
        i = np.arange(self.columns) - (self.columns - 1) / 2
        j = np.arange(self.rows) - (self.rows - 1) / 2
        shape = (len(e), self.rows, self.columns, 3)
        origin, direction = np.zeros(shape), np.ones(shape)
        origin[..., 0] = e[:, 0, None, None] + i * s[0]
        origin[..., 1] = e[:, 1, None, None] + j[:, None] * s[1]
        direction[..., 0] = e[:, 2, None, None] + i * s[2]
        direction[..., 1] = e[:, 3, None, None] + j[:, None] * s[3]
        return origin, direction


def macropixels(slab: Slab, pixels: np.ndarray) -> Bundles:
    """One element per pixel, (E, 2) integer (u, v); the inner grid is the lens."""
    pitch = slab.lens_pitch_m
    lattice = ElementLattice(slab.pixels, 0.0, slab.pixel_pitch)
    shear = -slab.camera.delta * pitch
    step = np.array([pitch, pitch, shear, shear], np.float32)
    rays = lattice.centre_rays(pixels)
    return Bundles(rays, step, slab.views, slab.views, slab.pixel_pitch, lattice)


def views(slab: Slab, samples: np.ndarray) -> Bundles:
    """One element per lens sample, (E, 2) integer (i, j); the inner grid is the picture."""
    pitch = slab.lens_pitch_m
    x, y = slab.off_axis().tolist()
    lattice = ElementLattice(slab.views, pitch, -slab.camera.delta * pitch, (x, y))
    step = np.array([0.0, 0.0, slab.pixel_pitch, slab.pixel_pitch], np.float32)
    return Bundles(lattice.centre_rays(samples), step, *slab.size, slab.pixel_pitch, lattice)

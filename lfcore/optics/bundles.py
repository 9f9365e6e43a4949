"""Bundles of rays: outer elements times an inner grid, affine in both.

Ray (i, j) of element e, counted from the centre of the inner grid, has at depth z the position

    x(z) = (ox_e + i sx) + z (dx_e + i tx)        y(z) = (oy_e + j sy) + z (dy_e + j ty)

The lens samples of one pixel, the pixels of one lens sample or data camera, and orthographic
rays all have this form, so one kernel traces all of them.
"""

from dataclasses import dataclass, replace

import numpy as np

from lfcore.optics.slab import Slab

TEXTURE_PX = 0.7
"""The width of the texture filter with one ray per pixel, in pixels."""


def texture_width(rays_per_pixel: float) -> float:
    """The width of the texture filter, in pixels of a picture.

    It falls with the cube root of the rays per pixel (measured, docs/decisions.md).
    """
    return TEXTURE_PX * rays_per_pixel ** (-1 / 3)


@dataclass(frozen=True)
class ElementLattice:
    """A square grid of elements, ``count`` per side, centred on the axis.

    ``origin`` and ``direction`` are the change of the centre ray from element to element,
    ``off_axis`` is the direction at the grid's centre.
    """

    count: int
    origin: float
    direction: float
    off_axis: tuple[float, float] = (0.0, 0.0)

    def centre_rays(self, coordinates: np.ndarray) -> np.ndarray:
        """(E, 4) float32 ox, oy, dx, dy at ``coordinates`` (E, 2), which may be fractional."""
        offset = np.asarray(coordinates) - (self.count - 1) / 2
        direction = offset * self.direction + self.off_axis
        return np.concatenate([offset * self.origin + 0.0, direction], 1, dtype=np.float32)


@dataclass(frozen=True)
class Bundles:
    """The rays of a job.

    Parameters
    ----------
    elements : ndarray
        (E, 4) float32: ox, oy (metres), dx, dy (tangents) of each element's centre ray.
    step : ndarray
        (4,) float32: sx, sy, tx, ty per column and row of the inner grid.
    columns, rows : int
        The sides of the inner grid.
    pixel_pitch : float
        The tangent over which textures are filtered.
    lattice : ElementLattice, optional
        The grid of the elements, so that a block can span several of them.
    band : (int, int), optional
        The first row and the number of rows to trace.  Default: all.
    pitches : (float, float, int)
        The distance of lens samples, metres, the tangent between pixels, and the lens samples per
        axis of the slab whose rays these are; 0: unknown.  By them, rough mirrors scatter the rays
        of a pixel evenly.
    """

    elements: np.ndarray
    step: np.ndarray
    columns: int
    rows: int
    pixel_pitch: float
    lattice: ElementLattice | None = None
    band: tuple[int, int] | None = None
    pitches: tuple[float, float, int] = (0.0, 0.0, 1)

    @property
    def first_row(self) -> int:
        return self.band[0] if self.band else 0

    @property
    def traced_rows(self) -> int:
        return self.band[1] if self.band else self.rows

    def every_second(self, row: int, column: int) -> "Bundles":
        """Every second ray of every second row, from the first two of each on."""
        columns, rows = (self.columns - column + 1) // 2, (self.rows - row + 1) // 2
        along = column + columns - 1 - (self.columns - 1) / 2
        down = row + rows - 1 - (self.rows - 1) / 2
        moved = self.step.astype(np.float64) * (along, down, along, down)
        first, end = self.first_row, self.first_row + self.traced_rows
        first, end = (first - row + 1) // 2, (end - row + 1) // 2
        return replace(
            self, elements=(self.elements + moved).astype(np.float32), step=2 * self.step,
            columns=columns, rows=rows, lattice=None, band=(first, end - first),
        )  # fmt: skip

    def rays(self) -> tuple[np.ndarray, np.ndarray]:
        """Origins and directions, (E, rows, columns, 3) float64, for references and tests.

        They are evaluated from the float32 coefficients.
        """
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

    def some_rays(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Origins and directions, (R, 3) float32, of rays by their numbers (R,) among the traced
        rows of all elements."""
        shape = len(self.elements), self.traced_rows, self.columns
        element, row, column = np.unravel_index(chosen, shape)
        e, s = self.elements[element].astype(float), self.step.astype(float)
        i = column - (self.columns - 1) / 2
        j = row + self.first_row - (self.rows - 1) / 2
        origin, direction = np.zeros((len(e), 3)), np.ones((len(e), 3))
        for axis, steps in enumerate((i, j)):
            origin[:, axis] = e[:, axis] + steps * s[axis]
            direction[:, axis] = e[:, 2 + axis] + steps * s[2 + axis]
        return origin.astype(np.float32), direction.astype(np.float32)


def macropixels(slab: Slab, pixels: np.ndarray) -> Bundles:
    """Bundles with an element per pixel, (E, 2) integer (u, v); the inner grid is the lens."""
    pitch = slab.lens_pitch_m
    lattice = ElementLattice(slab.pixels, 0.0, slab.pixel_pitch)
    shear = -slab.camera.delta * pitch
    step = np.array([pitch, pitch, shear, shear], np.float32)
    rays = lattice.centre_rays(pixels)
    pitches = pitch, slab.pixel_pitch, slab.views
    return Bundles(rays, step, slab.views, slab.views, pitches[1], lattice, pitches=pitches)


def views(slab: Slab, samples: np.ndarray) -> Bundles:
    """Bundles with an element per lens sample, (E, 2) integer (i, j); the inner grid is a view."""
    pitch = slab.lens_pitch_m
    x, y = slab.off_axis().tolist()
    lattice = ElementLattice(slab.views, pitch, -slab.camera.delta * pitch, (x, y))
    step = np.array([0.0, 0.0, slab.pixel_pitch, slab.pixel_pitch], np.float32)
    rays, pitches = lattice.centre_rays(samples), (pitch, slab.pixel_pitch, slab.views)
    return Bundles(rays, step, *slab.size, pitches[1], lattice, pitches=pitches)

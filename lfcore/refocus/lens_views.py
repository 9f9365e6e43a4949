"""Views on a plane behind a lens from a file.

Each view has a grid of nodes over the picture, and the slicer interpolates between them.  A node
describes what becomes of the rays of the view's lens cell there: where they land beside the place
that a perfect lens takes them to, and how the cell's open part differs from that of the aperture
alone, because the lens's other surfaces cut the beam off the axis (vignetting).

Landings within a cell differ, so a box is wider than the cell's sweep: to second moments, the side
of rays with offsets s in the cell and displacements T is that of s (delta' - 1/z) + T.

Light is normalised as through a perfect lens, so that vignetting darkens the picture.
"""

import math
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates, maximum_filter

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.lens import PUPIL_REACH, Lens
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Size
from lfcore.refocus.depth_program import LENS_EXTENT, LENS_NODES, NODE
from lfcore.refocus.placed_views import PlacedViews

COARSE_NODES = (LENS_NODES + 1) // 2
"""The nodes per axis that are measured; those between are interpolated."""
PUPIL_POINTS = 16
"""The least pupil points per axis that measure the cells of all views."""
LEAST_POINTS = 2
"""The least pupil points per axis of a cell."""
MOST_VIEWS = 64
"""The most views per side behind a lens from a file: their nodes take 285 MB."""
INVERSIONS = 3
"""Fixed-point steps from a place in the picture to the same ray's place through a perfect lens."""
MOST_MARGIN = 4
"""The longer side of a picture over the widest margin that is traced around it."""
LEAST_DENSITY = 0.1
"""The least area, over a perfect lens's, on which a lens puts a part of the picture."""


def colours_of(planes: Sequence[SensorPlane]) -> int:
    """3 if a lens takes red, green and blue to different places, else 1."""
    return max((len(plane.lens.colours) for plane in planes if plane.lens), default=1)


def lens_margin(planes: Sequence[SensorPlane], camera: Camera, size: Size) -> int:
    """The pixels around pictures whose rays lenses take into them: barrel distortion, blur."""
    pitch, margin = camera.field_width / size.shorter, 0.0
    border = np.stack(np.meshgrid(*2 * [[-1.0, 0.0, 1.0]]), -1).reshape(-1, 1, 2)
    edge = border * np.array(size) * pitch / 2
    pupil = np.stack(np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 9)]), -1).reshape(-1, 2)
    for plane in planes:
        for lens in plane.lens.colours if plane.lens else []:
            points = pupil * camera.focal_length_m / plane.f_number
            place, points = np.broadcast_arrays(edge, points)
            for _ in range(INVERSIONS):
                landing = lens.landing(points, place, plane.focus_m, camera.focal_length_m)
                place = edge - landing.displacement
            beyond = np.where(border != 0, np.abs(place) - np.abs(edge), 0)[landing.clearance > 0]
            margin = max(margin, beyond.max(initial=0) / pitch)
    return min(math.ceil(margin), size.longer // MOST_MARGIN)


class LensViews(PlacedViews):
    """Views on a plane whose lens may be one of a file; parameters are as for
    :class:`PlacedViews`, and the number of ``colours`` that have nodes."""

    def __init__(self, *views: Any, colours: int = 1, **more: Any):
        super().__init__(*views, **more)
        self.colours = colours

    def places_px(self, count: int) -> np.ndarray:
        """The columns and rows of ``count`` nodes per axis about the optical axis, (count, 2)."""
        return self._middle + np.linspace(-0.5, 0.5, count)[:, None] * self._extent_px

    @property
    def _extent_px(self) -> float:
        return LENS_EXTENT * self.size.longer

    @cached_property
    def nodes(self) -> np.ndarray:
        """(K, C, LENS_NODES, LENS_NODES, 16) float32, by view, colour, row and column: parts of
        NODE."""
        slab, shape = self.views.slab, (LENS_NODES, LENS_NODES, 16)
        if self.plane.lens is None:
            nodes = np.zeros((slab.views**2, self.colours, *shape), np.float32)
            nodes[..., NODE["side"]] = nodes[..., NODE["share"]] = 1
            return nodes
        if slab.views > MOST_VIEWS:
            problem = f"a lens from a file takes at most {MOST_VIEWS} views per side"
            raise OpticsError(problem, file=self.plane.lens.path, key="views")
        measured = self._measured_nodes(self.plane.lens.colours)
        nodes, more = measured[..., :16], measured[..., 16:]
        nodes[..., NODE["reach"].start : NODE["reach_m"].stop] = self._reach(nodes)
        made = np.repeat(nodes[:, None], self.colours, 1)
        if more.size:
            moved, swept = more[..., :4], more[..., 4:]
            apart = np.abs(moved).max(-1, keepdims=True)[:, None]
            for colour, part in ((0, slice(0, 2)), (2, slice(2, 4))):
                made[:, colour, ..., NODE["displacement"]] += moved[..., part]
                made[:, colour, ..., NODE["sweep"]] += swept[..., part]
            made[..., NODE["apart"]] = apart
            made[..., NODE["reach"]] += 2 * apart.max()  # of places, and of sweeps
        return made

    def _measured_nodes(self, lenses: Sequence[Lens]) -> np.ndarray:
        """The nodes of green without ``reach``, (K, LENS_NODES, LENS_NODES, 16 or 24) float32.

        Of three lenses, behind these are the displacements of red and of blue less green's, (4);
        and their sweeps likewise, (4).
        """
        points, sides, inside = self._cell_points()
        green = len(lenses) // 2
        landing = self._landing(lenses[green], points)
        away = [
            self._landing(lens, points)[0] - landing[0]
            for colour, lens in enumerate(lenses) if colour != green
        ]  # fmt: skip
        rows = [
            self._measured(*(each[row] for each in (points, sides, inside, *landing, *away)))
            for row in range(self.views.slab.views)
        ]
        coarse = np.concatenate(rows)
        coarse = coarse.reshape(-1, COARSE_NODES, COARSE_NODES, coarse.shape[-1])
        nodes = _refined(_refined(coarse, 1), 2)
        lit = maximum_filter(nodes[..., NODE["share"]], (1, 3, 3, 1)) > 0
        return np.where(lit, nodes, 0).astype(np.float32, order="C")

    def _cell_points(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Pupil points of cells near the aperture, (N, N, P, P, 2) by the view's row and column and
        theirs, metres; the sides of a point's part, (N, N, 2); which points are inside, (N, N, P,
        P)."""
        slab = self.views.slab
        aperture = self.plane.lens_aperture(slab)
        count = max(LEAST_POINTS, -(-PUPIL_POINTS // slab.views))
        reach, half = PUPIL_REACH * aperture.radius_m, slab.lens_pitch_m / 2
        low, high = (np.clip(slab.lens_positions() + to, -reach, reach) for to in (-half, half))
        side = (high - low) / count
        axis = (low + high)[:, None] / 2 + side[:, None] * (np.arange(count) - (count - 1) / 2)
        points = np.empty((slab.views, slab.views, count, count, 2))
        points[..., 0], points[..., 1] = axis[:, None], axis[:, None, :, None]
        sides = np.stack(np.meshgrid(side, side), -1)
        return points, sides, aperture.contains(points[..., 0], points[..., 1])

    def _landing(self, lens: Lens, points: np.ndarray) -> list[np.ndarray]:
        """Displacement, place on the stop, and clearance at all nodes, (N, N, y, x, P, P, ...).

        A quarter of the nodes is measured, since lens, nodes and points are symmetric.
        """
        camera = self.views.slab.camera
        quarter = np.linspace(0, 0.5 * self._extent_px / self.scale, COARSE_NODES // 2 + 1)
        tangents = np.stack(np.meshgrid(quarter, quarter), -1)[:, :, None, None]
        at, to = np.broadcast_arrays(points[:, :, None, None], tangents)
        landing = lens.landing(at, to, self.plane.focus_m, camera.focal_length_m)
        return [_mirrored(_mirrored(each, 0), 1) for each in landing]

    def _measured(
        self, points: np.ndarray, sides: np.ndarray, inside: np.ndarray, moved: np.ndarray,
        iris: np.ndarray, clearance: np.ndarray, *away: np.ndarray,
    ) -> np.ndarray:  # fmt: skip
        """A row of views of :meth:`_measured_nodes`, (N, y, x, 16 or 24) float64."""
        points, inside = (each[:, None, None] for each in (points, inside))
        empty = ~inside.any((-1, -2), keepdims=True)  # a sliver of a cell, between its points
        opened = self.plane.lens_aperture(self.views.slab).contains(iris[..., 0], iris[..., 1])
        passed, inside = (opened | empty) & (clearance > 0), inside | empty
        nodes = np.zeros((*passed.shape[:3], 16))
        nodes[..., NODE["share"]] = (passed.sum((-1, -2)) / inside.sum((-1, -2)))[..., None]
        passed |= ~passed.any((-1, -2), keepdims=True)  # dark, but in its place
        middle, place, before = _mean(points, passed), _mean(moved, passed), _mean(points, inside)
        nodes[..., NODE["displacement"]] = place * self.scale
        nodes[..., NODE["middle"]] = middle - before
        off, beside = (a - b[..., None, None, :] for a, b in ((points, middle), (moved, place)))
        spread, own = _mean(off**2, passed), sides[:, None, None] ** 2 / 12
        whole = _mean((points - before[..., None, None, :]) ** 2, inside)
        same = np.ones_like(spread)  # of a cell beyond the aperture, which has no width
        wider = np.divide(spread + own, whole + own, out=same, where=own > 0)
        nodes[..., NODE["side"]] = np.sqrt(wider)
        together = _mean(off * beside, passed)
        slope = together / np.maximum(spread, 1e-300)
        nodes[..., NODE["sweep"]] = slope * self.scale
        rest = np.maximum(_mean(beside**2, passed) - slope * together, 0)
        nodes[..., NODE["blur"]] = 12 * rest * self.scale**2
        moved_away = [_mean(each, passed) for each in away]
        swept_away = [
            _mean(off * (each - mean[..., None, None, :]), passed) / np.maximum(spread, 1e-300)
            for each, mean in zip(away, moved_away, strict=True)
        ]
        more = [each * self.scale for each in (*moved_away, *swept_away)]
        return np.round(np.concatenate([nodes, *more], -1), 9)

    def _reach(self, nodes: np.ndarray) -> np.ndarray:
        """The parts of NODE that bound how far up or down light goes, (K, rows, 1, 2)."""
        cells = self.cells
        middle = (cells.middle - self.views.positions)[:, 1, None, None]
        side = cells.extent[:, 1, None, None]
        down = {name: nodes[..., part][..., -1] for name, part in NODE.items()}
        blurred = np.sqrt(down["blur"]) + np.abs(down["sweep"]) * side * down["side"]
        beyond = np.abs(middle + down["middle"]) + (down["side"] - 1) * side / 2 - np.abs(middle)
        most = np.stack([np.abs(down["displacement"]) + blurred / 2, np.maximum(beyond, 0)], -1)
        return maximum_filter(most.max(axis=2, keepdims=True), (1, 3, 1, 1), mode="nearest")

    @cached_property
    def _light(self) -> tuple[np.ndarray, np.ndarray]:
        """The light of each pixel over that on the axis, and its rays over those of a perfect lens,
        (height, width)."""
        nodes, share = self.nodes[:, self.colours // 2].astype(float), self.cells.share
        light = np.einsum("k,kyx->yx", share, nodes[..., NODE["share"]][..., 0])
        moved = np.einsum(
            "k,kyxi->iyx", share, nodes[..., NODE["displacement"]] * nodes[..., NODE["share"]]
        )
        step = self._extent_px / (LENS_NODES - 1)
        moved /= np.maximum(light, 1e-9) * step
        (yx, xx), (yy, xy) = (np.gradient(each) for each in moved)
        area = np.maximum((1 + xx) * (1 + yy) - xy * yx, LEAST_DENSITY)
        on_axis = light[LENS_NODES // 2, LENS_NODES // 2]
        there = np.stack(np.meshgrid(*2 * [np.arange(LENS_NODES)], indexing="ij")).astype(float)
        place = there.copy()
        for _ in range(INVERSIONS):
            at = [map_coordinates(each, place, order=1, mode="nearest") for each in moved[::-1]]
            place = there - np.stack(at)
        columns, rows = self.places_px(LENS_NODES).T
        made = []
        for each in (light / on_axis, light / share.sum() / area):
            here = map_coordinates(each, place, order=1, mode="nearest")
            x, y = (np.arange(count) + 0.5 for count in self.size)
            across = np.stack([np.interp(x, columns, row) for row in here])
            made.append(np.stack([np.interp(y, rows, column) for column in across.T], 1))
        return made[0], made[1]

    @property
    def illumination(self) -> np.ndarray | None:
        """The light of each pixel over that on the axis, (height, width, 1) float32."""
        if self.plane.lens is None:
            return None
        return self._light[0].astype(np.float32)[..., None]

    def rooms(self, layers: int) -> tuple[np.ndarray, np.ndarray]:
        rooms, row_of = super().rooms(layers)
        if self.plane.lens is None:
            return rooms, row_of
        density, used = self._light[1].astype(np.float32), np.unique(row_of, axis=0)
        by_row = np.concatenate([rooms[rows] * density for rows in used])
        first = [int((used == rows).all(1).argmax()) * len(density) for rows in row_of]
        rows_of = np.array(first)[:, None] + np.arange(len(density))
        return by_row, rows_of.astype(np.int32)


def _mean(values: np.ndarray, where: np.ndarray) -> np.ndarray:
    """The mean over points of (..., P, P, 2) where a mask (..., P, P) is set."""
    return (values * where[..., None]).sum((-2, -3)) / where.sum((-1, -2))[..., None]


def _mirrored(quarter: np.ndarray, axis: int) -> np.ndarray:
    """Add the nodes beyond the axis to a quarter of (N, N, y, x, P, P, ...): along x, or y."""
    views, nodes, points = 1 - axis, 3 - axis, 5 - axis
    other = np.flip(quarter, (views, nodes, points))
    other = np.delete(other, -1, nodes)
    if other.ndim > 6:
        other = other * np.where(np.arange(2) == axis, -1.0, 1.0)
    return np.concatenate([other, quarter], nodes)


def _refined(nodes: np.ndarray, axis: int) -> np.ndarray:
    """Put a node between each two: of four neighbours for displacements, of two for the rest."""
    nodes = np.moveaxis(nodes, axis, 0)
    made = np.empty((2 * len(nodes) - 1, *nodes.shape[1:]))
    made[::2], made[1::2] = nodes, (nodes[:-1] + nodes[1:]) / 2
    moved, smooth = nodes[..., NODE["displacement"]], made[1::2, ..., NODE["displacement"]]
    smooth[1:-1] = (9 * (moved[1:-2] + moved[2:-1]) - moved[:-3] - moved[3:]) / 16
    smooth[0] = (3 * moved[0] + 6 * moved[1] - moved[2]) / 8
    smooth[-1] = (3 * moved[-1] + 6 * moved[-2] - moved[-3]) / 8
    return np.moveaxis(made, 0, axis)

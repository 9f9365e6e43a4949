"""Views of known depth as differences from their neighbours; neighbours.js undoes it.

A surface is in the next view as many pixels away as its disparity.  So a view's depths are near its
neighbour's, moved, and its colours near the neighbour's at the moved places.  The view nearest to
the middle of the lens is stored as it is.  The differences are taken from what the page will have:
errors do not add up.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

import numpy as np

from lfcore.viewer.atlas import Atlas

STEP_PX = 0.5
"""The step of disparities, pixels of a view between neighbouring parts of the lens."""
TOLERANCE = 1.0
"""In steps: a depth that is predicted so well is taken as predicted."""
CODES = 256
PARTS = 32
"""Parts of a pixel between which colours are interpolated: OpenCV's."""

Level = list[tuple[int, int]]
"""Numbers of views, each with the neighbour that it is predicted from."""


@dataclass(frozen=True)
class Neighbours:
    """Views on a grid, row by row, whose columns, rows and pixels (K, 2) are displaced so far, and
    the codes of their disparities: the first, and the step, in pixels from view to view."""

    columns: np.ndarray
    rows: np.ndarray
    displaced: np.ndarray
    low: float
    step: float
    codes: int

    def levels(self) -> list[Level]:
        """Views in lists whose neighbours are in the lists before; the first view is its own."""
        wide, high = len(self.columns), len(self.rows)
        middle, centre = (wide - 1) // 2, (high - 1) // 2
        found: dict[int, Level] = {}
        for k in range(wide * high):
            j, i = divmod(k, wide)
            # Along its row towards the middle column, then along that.
            back = np.sign(middle - i) if i != middle else wide * np.sign(centre - j)
            found.setdefault(abs(i - middle) + abs(j - centre), []).append((k, k + int(back)))
        return [found[away] for away in sorted(found)]

    def _apart(self, one: int, other: int) -> np.ndarray:
        """(codes, 2): from a pixel of view ``one`` to its surface's place in the other."""
        wide = len(self.columns)
        across = self.columns[one % wide] - self.columns[other % wide]
        down = self.rows[one // wide] - self.rows[other // wide]
        disparities = self.low + self.step * np.arange(self.codes)
        own = self.displaced[one] - self.displaced[other]
        return np.array([across, down]) * disparities[:, None] + own

    def moved_depth(self, codes: np.ndarray, one: int, other: int) -> np.ndarray:
        """(h, w) depth codes of view ``other``, predicted from view ``one``; gaps take the left."""
        height, width = codes.shape
        move = np.floor(self._apart(one, other) + 0.5).astype(int)
        y, x = np.mgrid[:height, :width]
        x, y = x + move[codes, 0], y + move[codes, 1]
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        found = np.full((height, width), -1)
        np.maximum.at(found, (y[inside], x[inside]), codes[inside])
        left = np.maximum.accumulate(np.where(found < 0, 0, np.arange(width)), axis=1)
        return np.maximum(np.take_along_axis(found, left, 1), 0)

    def moved_colours(
        self, colours: np.ndarray, codes: np.ndarray, one: int, other: int
    ) -> np.ndarray:
        """(h, w, 3) uint8 of view ``one``, whose depths are ``codes``, by the other's colours."""
        import cv2

        move = np.floor(self._apart(one, other) * PARTS + 0.5) / PARTS
        y, x = np.mgrid[: codes.shape[0], : codes.shape[1]]
        across = (x + move[codes, 0]).astype(np.float32)
        down = (y + move[codes, 1]).astype(np.float32)
        # In float32, which holds these sums exactly.
        shown = np.asarray(
            cv2.remap(
                colours.astype(np.float32), across, down, cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
        )  # fmt: skip
        return np.floor(shown + np.float32(0.5)).astype(np.uint8)

    def coded_depth(self, disparities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Codes of (K, h, w) disparities as the page has them, and differences: uint8."""
        exact = (disparities - self.low) / self.step
        codes, differences = np.rint(exact).astype(np.uint8), np.empty(exact.shape, np.uint8)
        for view, other in chain.from_iterable(self.levels()):
            differences[view] = codes[view]
            if view != other:
                moved = self.moved_depth(codes[other], other, view)
                near = np.abs(exact[view] - moved) <= TOLERANCE
                codes[view] = np.where(near, moved, codes[view])
                differences[view] = (codes[view] - moved) % self.codes
        return codes, differences

    def coded_colours(
        self,
        pictures: np.ndarray,
        codes: np.ndarray,
        encode: Callable[[np.ndarray], Atlas],
        gain: int,
        levels: list[Level],
    ) -> tuple[list[Atlas], np.ndarray]:
        """Coded differences of (K, h, w, 3) uint8 pictures, level by level, and what they give.

        Differences are divided by ``gain``, about 128; with 1 they wrap around, and nothing is
        lost.
        """
        made, found = np.zeros_like(pictures), list[Atlas]()
        for level in levels:
            views = [view for view, _ in level]
            shown = pictures[views].astype(int)
            moved = np.zeros_like(shown)
            for k, (view, other) in enumerate(level):
                if view != other:
                    moved[k] = self.moved_colours(made[other], codes[view], view, other)
            first = views == [other for _, other in level]
            if not first:
                shown = 128 + np.rint((shown - moved) / gain).astype(int)
            found.append(encode(_bytes(shown, gain)))
            decoded = found[-1].decoded(shown.shape)
            made[views] = (
                decoded if first else _bytes(moved + gain * (decoded.astype(int) - 128), gain)
            )
        return found, made


def _bytes(values: np.ndarray, gain: int) -> np.ndarray:
    return (values % 256 if gain == 1 else values.clip(0, 255)).astype(np.uint8)

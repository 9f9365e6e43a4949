"""Views with depth, coded as differences from their neighbours; neighbours.js decodes them.

From view to view, a surface moves by its disparity.  A view's depths are therefore predicted by
moving its neighbour's, and its colours by the neighbour's colours at the moved positions.  The view
nearest to the middle of the lens is stored as it is.  Predictions use decoded views, so that errors
do not accumulate.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

import numpy as np

from lfcore.viewer.atlas import Atlas

STEP_PX = 0.5
"""The step of disparity codes, pixels of a view between neighbouring parts of the lens."""
TOLERANCE = 1.0
"""The largest error of a prediction, in steps, that replaces the depth itself."""
CODES = 256
"""The most codes of disparity: a byte."""
FIRST_CODE = 2
"""The first code of depth where some pixels have none, code 0: no prediction is as near to it."""
PARTS = 32
"""The parts of a pixel to which OpenCV rounds positions when it interpolates."""

Level = list[tuple[int, int]]
"""The numbers of views, each with the neighbour that predicts it."""


@dataclass(frozen=True)
class Neighbours:
    """A grid of views, row by row, and the codes of their disparities.

    Attributes
    ----------
    columns, rows : ndarray
        The positions of columns and rows, in views.
    displaced : ndarray
        (K, 2) displacements of the views' pixels.
    low, step : float
        The disparity of code 0, and the step between codes, pixels per view.
    codes : int
        The number of codes.
    """

    columns: np.ndarray
    rows: np.ndarray
    displaced: np.ndarray
    low: float
    step: float
    codes: int

    def levels(self) -> list[Level]:
        """The views by distance from the middle one: each level is predicted by the one before.

        The middle view has itself as neighbour.
        """
        wide, high = len(self.columns), len(self.rows)
        middle, centre = (wide - 1) // 2, (high - 1) // 2
        levels: dict[int, Level] = {}
        for k in range(wide * high):
            j, i = divmod(k, wide)
            # Along its row towards the middle column, then along that.
            back = np.sign(middle - i) if i != middle else wide * np.sign(centre - j)
            levels.setdefault(abs(i - middle) + abs(j - centre), []).append((k, k + int(back)))
        return [levels[distance] for distance in sorted(levels)]

    def _moves(self, source: int, target: int) -> np.ndarray:
        """The move of a surface from view ``source`` to view ``target``, per code: (codes, 2)."""
        wide = len(self.columns)
        across = self.columns[source % wide] - self.columns[target % wide]
        down = self.rows[source // wide] - self.rows[target // wide]
        disparities = self.low + self.step * np.arange(self.codes)
        displaced = self.displaced[source] - self.displaced[target]
        return np.array([across, down]) * disparities[:, None] + displaced

    def moved_depth(self, codes: np.ndarray, source: int, target: int) -> np.ndarray:
        """Predict the depth codes (h, w) of view ``target`` by those of ``source``.

        Gaps are filled from the left.
        """
        height, width = codes.shape
        move = np.floor(self._moves(source, target) + 0.5).astype(int)
        y, x = np.mgrid[:height, :width]
        x, y = x + move[codes, 0], y + move[codes, 1]
        inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        moved = np.full((height, width), -1)
        np.maximum.at(moved, (y[inside], x[inside]), codes[inside])
        left = np.maximum.accumulate(np.where(moved < 0, 0, np.arange(width)), axis=1)
        return np.maximum(np.take_along_axis(moved, left, 1), 0)

    def moved_colours(
        self, colours: np.ndarray, codes: np.ndarray, target: int, source: int
    ) -> np.ndarray:
        """Predict view ``target``, (h, w, 3) uint8, by the colours of view ``source``.

        ``codes`` are the depths of ``target``.
        """
        import cv2

        move = np.floor(self._moves(target, source) * PARTS + 0.5) / PARTS
        y, x = np.mgrid[: codes.shape[0], : codes.shape[1]]
        across = (x + move[codes, 0]).astype(np.float32)
        down = (y + move[codes, 1]).astype(np.float32)
        # In float32, which has these sums exactly.
        shown = np.asarray(
            cv2.remap(
                colours.astype(np.float32), across, down, cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )
        )  # fmt: skip
        return np.floor(shown + np.float32(0.5)).astype(np.uint8)

    def coded_depth(self, disparities: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Encode disparities (K, h, w): the codes that the page decodes, and differences, uint8."""
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
        """Encode pictures (K, h, w, 3) uint8 by levels: differences, and the decoded pictures.

        Differences are divided by ``gain`` and centred at 128.  With a gain of 1 they wrap around,
        which is lossless.
        """
        decoded, atlases = np.zeros_like(pictures), list[Atlas]()
        for level in levels:
            views = [view for view, _ in level]
            shown = pictures[views].astype(int)
            moved = np.zeros_like(shown)
            for k, (view, other) in enumerate(level):
                if view != other:
                    moved[k] = self.moved_colours(decoded[other], codes[view], view, other)
            first = views == [other for _, other in level]
            if not first:
                shown = 128 + np.rint((shown - moved) / gain).astype(int)
            atlases.append(encode(_bytes(shown, gain)))
            level_pictures = atlases[-1].decoded(shown.shape)
            if not first:
                differences = gain * (level_pictures.astype(int) - 128)
                level_pictures = _bytes(moved + differences, gain)
            decoded[views] = level_pictures
        return atlases, decoded


def _bytes(values: np.ndarray, gain: int) -> np.ndarray:
    return (values % 256 if gain == 1 else values.clip(0, 255)).astype(np.uint8)

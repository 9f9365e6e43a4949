"""Where the assignment's cameras stand: arrays of its scenes, and the book's pictures."""

from __future__ import annotations

import numpy as np

from lfcore.refocus.array.virtual_camera import VirtualCamera

# Scene: (bounds minX maxX minY maxY in metres, field of view in degrees), the assignment's own.
ARRAYS = {
    "book": ((-0.6, 0.6, -0.6, 0.6), 50.0),
    "sphere": ((-0.6, 0.6, -0.6, 0.6), 50.0),
    "ecosys": ((-2.5, 2.5, -1.5, 1.5), 60.0),
}
# The book: focus of the assignment's command line, and of the authors' line, metres.
BOOK_FOCUS_M = 6.8
AUTHORS_FOCUS_M = 6.2
# The book's cover in camera space (y down): a point on it and its normal.
BOOK_COVER = {"point": (0.160, -0.398, 7.181), "normal": (0.2669, -0.6641, -0.6984)}
# Where the ecosys scene's camera focuses, metres: the hillside and the two trees.
ECOSYS_FOCUS_M = {"hillside": 60.0, "first tree": 12.0, "second tree": 19.0}
# The book's lens in measurements; its rays and those of its filter all meet the camera grid.
BOOK_LENS_M = 0.2


def assignment_camera(size: int, lens_radius_m: float = 0.0) -> VirtualCamera:
    """The virtual camera of the assignment's command line, size x size pixels."""
    return VirtualCamera.from_pbrt(
        (-0.15, -0.2, -1.2), (0, 0, 0), 40.0, (size, size), lens_radius_m
    )


def measured_camera(size: int) -> VirtualCamera:
    """The book's camera where pictures are measured: between the data cameras, none of them."""
    return VirtualCamera(np.array([-0.06, 0.05, 0.0]), np.eye(3), 40.0, (size, size), BOOK_LENS_M)

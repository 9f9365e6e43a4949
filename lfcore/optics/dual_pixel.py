"""The disparity of dual-pixel pairs: two halves of an aperture see a point beside itself.

A point at depth z falls ``s (delta' - 1/z)`` off its place on the plane focused at ``1 / delta'``,
from lens point s.  A half sees it at the mean of its own lens points.

Source: Garg et al., "Learning Single Camera Depth Estimation Using Dual-Pixels", ICCV 2019.
"""

import numpy as np

from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import lens_cells
from lfcore.optics.slab import Slab


def pair_disparity(
    slab: Slab, plane: SensorPlane, depth: np.ndarray, pixels: int, first: str = "left"
) -> np.ndarray:
    """The pixels from a point's place in the first picture to that in the second.

    Parameters
    ----------
    slab : Slab
        The rays.
    plane : SensorPlane
        The whole picture, whose longer side is ``pixels``; the pair is its ``halves(first)``.
    depth : ndarray
        Metres, of any shape.

    Returns
    -------
    ndarray
        float64, along x of left and right, along y of top and bottom: affine in inverse depth, 0 in
        focus, positive behind the focus.
    """
    axis, centres = int(first == "top"), []
    for half in plane.halves(first):
        cells = lens_cells(slab, half.lens_aperture(slab))
        centres.append(np.average(cells.middle[:, axis], weights=cells.share))
    scale = plane.magnification(slab) * pixels / slab.camera.field_width
    return (centres[1] - centres[0]) * (plane.delta - 1.0 / np.asarray(depth, float)) * scale

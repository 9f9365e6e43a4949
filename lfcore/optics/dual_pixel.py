"""The disparity of dual-pixel pairs: two halves of an aperture see a point beside itself.

A point at depth z falls ``s (delta' - 1/z)`` off its place on the plane focused at ``1 / delta'``,
from lens point s.  A half sees it at the mean of its own lens points.

Source: Garg et al., "Learning Single Camera Depth Estimation Using Dual-Pixels", ICCV 2019.
"""

from dataclasses import replace

import numpy as np

from lfcore.optics.planes import Aperture, SensorPlane
from lfcore.optics.slab import Slab

POINTS = 1024, 1021
"""The points along a pair's axis and across it that measure centroids, to 2e-5 of the radius; they
have no common factor, so that few are on slanted edges."""


def dual_pixel_disparity(
    slab: Slab, plane: SensorPlane, depth: np.ndarray | float, first: str = "left"
) -> np.ndarray:
    """Convert depth to the disparity of a dual-pixel pair: from a point's place in the first
    picture to that in the second.

    It is the signed circle of confusion times the distance between the centroids of the halves, as
    a share of the diameter: of circles 4 / (3 pi).

    Parameters
    ----------
    slab : Slab
        The camera, and the pictures' pixels, unless the plane has its own.
    plane : SensorPlane
        The whole picture; the pair is its ``halves(first)``.  A lens from a file counts as perfect.
    depth : array_like
        Metres along the axis, infinity for a miss.
    first : str
        ``left`` or ``top``.

    Returns
    -------
    ndarray
        float32 pixels, of the same shape, along x of left and right, along y of top and bottom:
        affine in inverse depth, 0 in focus, positive behind the focus.

    Raises
    ------
    OpticsError
        ``first`` is another half.

    Examples
    --------
    >>> slab = lfcore.Slab(lfcore.Camera(0.05, 0.036, 2.0, 3.0), views=1, pixels=640)
    >>> plane = lfcore.SensorPlane(focus_m=3.0, f_number=2.0)
    >>> lfcore.dual_pixel_disparity(slab, plane, [2.0, 3.0, 6.0]).round(2)
    array([-1.6,  0. ,  1.6], dtype=float32)
    """
    one, other = (half.lens_aperture(slab) for half in plane.halves(first))
    apart = _centroid(other, int(first == "top")) - _centroid(one, int(first == "top"))
    scale = plane.magnification(slab) * plane.side(slab) / slab.camera.field_width
    with np.errstate(divide="ignore"):
        defocus = plane.delta - 1.0 / np.asarray(depth, np.float64)  # dioptres
    return np.asarray(apart * defocus * scale, np.float32)


def disparity_map(slab: Slab, plane: SensorPlane, depth: np.ndarray) -> np.ndarray:
    """The disparity of left and right at each pixel of a picture of the slab, (H, W) float32.

    ``depth`` (H, W) is that from the middle of the lens, without the plane's magnification.
    """
    middle, larger = [(count - 1) / 2 for count in depth.shape], plane.magnification(slab)
    row, column = (
        np.rint((np.arange(count) - c) / larger + c).clip(0, count - 1).astype(int)
        for count, c in zip(depth.shape, middle, strict=True)
    )
    return dual_pixel_disparity(slab, replace(plane, pixels=None), depth[row[:, None], column])


def _centroid(half: Aperture, axis: int) -> float:
    """The middle of an outline along an axis, metres."""
    s, t = (((np.arange(n) + 0.5) * 2 / n - 1) * half.radius_m for n in POINTS)
    if axis:
        s, t = t, s
    inside = half.contains(s[None, :], t[:, None])
    return float(np.average((s, t)[axis], weights=inside.sum(axis)))

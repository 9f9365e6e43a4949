"""Sensor planes by scattering every ray to the pixel that it falls on, float64.

Thesis chapter 4, Algorithm 1, in the form of the design: refocusing from delta to delta' moves
a ray from x_f to ``x_f + s (delta' - delta)``.
"""

import numpy as np

from lfcore.optics.plane_sums import targets


def form_plane(slab, plane, light, *, bilinear=False):
    """One picture (H, W, 3) float64, linear light, row v and column u, of all rays of the slab,
    (rows, columns, N, N, 3) indexed [v, u, j, i].

    A ray is shared among the four nearest pixels if ``bilinear``, else it falls on the nearest one,
    the larger index where two are equally near.  A pixel is the sum of its rays through the open
    lens samples, divided by their number (or share) with ``normalise='aperture'``, by N^2 with
    ``'lens'``; black where none fell.
    """
    *_, width, height = slab.picture(plane.pixels or slab.pixels)
    total = np.zeros((height, width, 4))
    counted = np.concatenate([light, np.ones((*light.shape[:-1], 1))], -1)
    for j, i in np.argwhere(plane.mask(slab)):
        for x, across in _targets(slab, plane, i, 0, bilinear):
            for y, down in _targets(slab, plane, j, 1, bilinear):
                share = np.outer(down, across)[..., None]
                np.add.at(total, np.ix_(y, x), counted[:, :, j, i] * share)
    picture, weight = total[..., :3], total[..., 3:]
    if plane.normalise == "lens":
        return picture / (slab.views * slab.pixels / (plane.pixels or slab.pixels)) ** 2
    return picture / np.where(weight > 0, weight, 1)


def _targets(slab, plane, sample, axis, bilinear):
    """(pixel of the picture, share) of the rays of the pixels held through one lens column (axis 0)
    or row (1); what falls beside the picture has no share."""
    size, (first, count) = plane.pixels or slab.pixels, slab.held.pixels[axis::2]
    coarser = plane.magnification(slab) * (size / slab.pixels)
    position = first + np.arange(count) + plane.shifts(slab)[sample] - (slab.pixels - 1) / 2
    position = position * coarser + (size - 1) / 2
    low = np.floor(position if bilinear else position + 0.5).astype(np.int64)
    over = position - low
    corner, extent = slab.picture(size)[axis::2]
    return [
        (place.clip(corner, corner + extent - 1) - corner,
         share * ((place >= corner) & (place < corner + extent)))
        for place, share in ([(low, 1 - over), (low + 1, over)] if bilinear else [(low, 1.0)])
    ]  # fmt: skip


def scattered_sums(slab, plane, rays, first=(0, 0)):
    """(3, H, W) uint64 of a plane's picture: every ray is added on its own, exact in float64.

    ``rays`` are whole numbers (rows, columns, N, N, 3), indexed [v, u, j, i], from the pixel (u, v)
    that ``first`` begins with.
    """
    left, top, width, height = slab.picture(plane.side(slab))
    out = np.zeros((3, height * width))
    to, mask = targets(slab, plane), plane.mask(slab)
    for row, column in np.ndindex(rays.shape[:2]):
        y, x = to[first[1] + row] - top, to[first[0] + column] - left
        y, x = np.meshgrid(y, x, indexing="ij")
        counts = mask & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        at, light = (y * width + x)[counts], rays[row, column][counts].astype(float)
        for channel in range(3):
            out[channel] += np.bincount(at, light[:, channel], height * width)
    return out.astype(np.uint64).reshape(3, height, width)

"""A coarse disparity map from views without depth, so that a click can focus.

Plane sweep: each view is shifted to a candidate plane.  Where the surface is in this plane, all
views agree with the central one.  Source: Collins, "A space-sweep approach to true multi-image
matching", CVPR 1996.
"""

import numpy as np

SIDE = 128
"""The most pixels of the map's longer side."""
CANDIDATES = 64
"""The number of candidate planes."""
GRID_SIDE = 5
"""The most views per side of the lens that are compared with the central one."""
SMOOTH = 1.5
"""The standard deviation of the costs' blur, pixels of the map."""
MOST_COST = 60.0
"""The most cost of a pixel and view, sum of codes: occluded pixels differ arbitrarily."""


def estimate(
    pictures: np.ndarray, places: np.ndarray, low: float, high: float
) -> np.ndarray | None:
    """Estimate disparities (h, w) float32 between ``low`` and ``high``; None for a single view.

    Their unit is pixels per step of the views' ``places`` (K, 2).  They are unreliable without
    texture.
    """
    import cv2

    count, height, width, _ = pictures.shape
    if count < 2 or not high > low:
        return None
    scale = min(1.0, SIDE / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))
    centre = int(np.argmin(np.hypot(*places.T)))
    # The views nearest to a coarse grid over the lens.
    ends = zip(places.min(0), places.max(0), strict=True)
    x, y = (np.linspace(*both, GRID_SIDE) for both in ends)
    wanted = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    nearest = {int(np.argmin(np.hypot(*(places - point).T))) for point in wanted}
    chosen = sorted(nearest - {centre})
    small = [
        cv2.resize(pictures[k], size, interpolation=cv2.INTER_AREA).astype(np.float32)
        for k in (centre, *chosen)
    ]
    best = np.full(size[::-1], np.inf, np.float32)
    best_disparity = np.zeros(size[::-1], np.float32)
    for disparity in np.linspace(low, high, CANDIDATES):
        cost = np.zeros(size[::-1], np.float32)
        for picture, k in zip(small[1:], chosen, strict=True):
            # Pixel X of the central view is at X - (s - s0) d of the view at s.
            x, y = (places[centre] - places[k]) * disparity * scale
            move = np.array([[1, 0, -x], [0, 1, -y]], np.float32)
            moved = cv2.warpAffine(picture, move, size, borderMode=cv2.BORDER_REPLICATE)
            cost += np.minimum(np.abs(moved - small[0]).sum(2), MOST_COST)
        cost = cv2.GaussianBlur(cost, (0, 0), SMOOTH)
        better = cost < best
        best[better], best_disparity[better] = cost[better], disparity
    return cv2.medianBlur(best_disparity, 5) if min(size) >= 5 else best_disparity

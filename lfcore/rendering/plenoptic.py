"""The photograph of a plenoptic camera, and refocusing it (thesis Algorithm 2, section 6.2)."""

from collections.abc import Sequence

import numpy as np

from lfcore.colour import to_uint8
from lfcore.opencl.device import Device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.plenoptic import PlenopticCamera, sub_apertures
from lfcore.progress import Progress
from lfcore.refocus.shift_sum import shift_sum_views
from lfcore.rendering.tiles import trace_tile
from lfcore.storage.layout import FrameLayout
from lfcore.storage.ycbcr import rgb_from_planes
from lfcore.tracing.tracer import Tracer

PHOTOGRAPH_RAYS = 1 << 24
"""The rays of a tile of the photograph, whose frames are in memory."""
BLOCK_PX = 512
"""The side of a frame, pixels of the photograph."""


def photograph(
    tracer: Tracer, camera: PlenopticCamera, *, progress: Progress | None = None
) -> np.ndarray:
    """(M N, M N, 3) uint8 sRGB: the photosensor's picture, upright.

    All rays of a microlens meet in one point at the focus distance, so they are traced together,
    one bundle per microlens.  Colours are converted by way of 8-bit YCbCr 4:4:4.
    """
    pack = max(1, min(BLOCK_PX // camera.samples, camera.lenses))
    layout = FrameLayout(
        "macropixels", camera.samples, camera.lenses, "raster", pack, pixel_format="yuv444p"
    )
    out = np.empty((camera.photograph_side, camera.photograph_side, 3), np.uint8)
    traced = 0
    for tile in layout.tiles(PHOTOGRAPH_RAYS):
        elements = tile.elements()
        firsts = np.unique(tile.placement(elements)[:, 0], return_index=True)[1]
        corners = elements[firsts] * camera.samples  # of each frame in the photograph
        tracing = trace_tile(tracer, camera.slab(), tile)
        for chunk in tracing:
            planes = layout.format.views(chunk.frames, layout.frame_width, layout.frame_height)
            for k in range(len(chunk.frames)):
                block = to_uint8(rgb_from_planes([p[k : k + 1] for p in planes], layout.format))[0]
                x, y = corners[chunk.first + k]
                part = out[y : y + len(block), x : x + block.shape[1]]  # cut at its edges
                part[:] = block[: part.shape[0], : part.shape[1]]
        traced += tile.element_count
        if progress:
            progress(traced, camera.lenses**2)
    return out


def refocus_photograph(
    camera: PlenopticCamera,
    picture: np.ndarray,
    planes: Sequence[SensorPlane],
    *,
    filter: str = "bilinear",
    device: Device | None = None,
) -> np.ndarray:
    """Digital refocusing: (P, M, M, 3) float32, linear light, of a photograph (M N, M N, 3), uint8
    sRGB or floating linear light."""
    views = sub_apertures(picture, camera.samples)
    return shift_sum_views(camera.slab(), views, planes, filter=filter, device=device)

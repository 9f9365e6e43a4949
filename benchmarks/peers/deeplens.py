"""DeepLens's thin lens on a sharp picture and its depth: pip install deeplens-core.

The package asks for Python 3.12, and opencv-python beside ours.
"""

from functools import cache

import numpy as np

from benchmarks.peers.method import SkippedError
from lfcore.optics.camera import Camera

LAYERS = 64
"""The layers of depth; their default is 16."""


@cache
def package():
    """Import it; raises :class:`SkippedError`."""
    try:
        import deeplens
    except ImportError as error:
        raise SkippedError(f"not installed: pip install deeplens-core ({error})") from None
    return deeplens


def deeplens(
    sharp: np.ndarray, depth: np.ndarray, camera: Camera, reach: int, halves: bool
) -> np.ndarray:
    """Return the picture of :meth:`DefocusLens.render_rgbd`, or both views of its dual pixels.

    ``reach`` is the greatest radius of blur in pixels.
    """
    import torch

    side = len(sharp)
    lens = package().DefocusLens(
        foclen=1e3 * camera.focal_length_m, fnum=camera.f_number,
        sensor_size=(1e3 * camera.sensor_width_m,) * 2, sensor_res=(side, side), device="cpu",
    )  # fmt: skip
    lens.d_far, lens.d_close = -1e9, -1e-3
    lens.refocus(-1e3 * camera.focus_m)
    light = torch.from_numpy(np.moveaxis(sharp, -1, 0)[None].astype(np.float32))
    metres = torch.from_numpy(1e3 * depth.astype(np.float32))[None, None]
    render = lens.render_rgbd_dp if halves else lens.render_rgbd
    with torch.inference_mode():
        found = render(light, metres, psf_ks=2 * reach + 3, num_layers=LAYERS)
    pictures = found if halves else [found]
    return np.stack([np.moveaxis(picture[0].numpy(), 0, -1) for picture in pictures])

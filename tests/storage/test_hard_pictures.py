"""Pictures that are hard on a codec, at any side from one pixel on, through a segment and back."""

import numpy as np
import pytest

from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentReader, SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames

SIDES = (1, 2, 15, 16, 33, 64)
LOSSLESS = Encoding("ffv1", "yuv444p", preset=None, tune=None)
LOSSY = Encoding("libx264", "yuv420p", crf=22.0)


def patterns(side):
    """Pictures (4, side, side, 3) in [0, 1]; grey, but for ``colour``."""
    rng, shape = np.random.default_rng(side), (4, side, side, 1)
    v, u = np.indices((side, side))
    highlight = np.full(shape, 0.05)
    highlight[:, side // 2, side // 2] = 1.0
    grey = {
        "black": np.zeros(shape),
        "white": np.ones(shape),
        "noise": rng.uniform(0, 1, shape),
        "checker": np.broadcast_to((u + v)[..., None] % 2, shape).astype(float),
        "highlight": highlight,
    }
    return {name: one.repeat(3, axis=-1) for name, one in grey.items()} | {
        "colour": rng.uniform(0, 1, (4, side, side, 3))
    }


def error(rgb, spec, path):
    """The root mean square error of a round trip, in 8-bit codes."""
    side = rgb.shape[1]
    layout = FrameLayout("views", 1, side, pixel_format=spec.pixel_format)
    size = layout.frame_width, layout.frame_height
    with SegmentWriter(path, spec, *size) as writer:
        writer.write(frames_from_rgb(rgb, spec.pixel_format, *size))
    decoded = np.concatenate([block.copy() for block in SegmentReader(path).frames()])
    found = rgb_from_frames(decoded, spec.pixel_format, *size)[:, :side, :side]
    return 255 * np.sqrt(np.square(found - rgb).mean())


@pytest.mark.parametrize("side", SIDES)
def test_lossless_video_errs_by_rounding(tmp_path, side):
    """Y, Cb and Cr are each rounded once: 0.58 codes, and more by chance where pixels are few."""
    for name, rgb in patterns(side).items():
        values = rgb.size if name == "colour" else rgb.size / 3
        bound = 0.58 * np.sqrt(1 + 3 * np.sqrt(0.8 / values))
        assert error(rgb, LOSSLESS, tmp_path / f"{name}.mp4") <= bound, name


@pytest.mark.parametrize("side", SIDES)
def test_lossy_video_errs_by_its_quantiser(tmp_path, side):
    """Flat pictures are coded by key frames, finer than CRF; noise by the coarsest B frames."""
    for name, rgb in patterns(side).items():
        if name != "colour":  # 4:2:0 has no colour of one pixel
            bound = 1.7 if name in ("black", "white") else 26.1
            assert error(rgb, LOSSY, tmp_path / f"{name}.mp4") <= bound, name

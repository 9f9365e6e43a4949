"""Pictures that are hard on a codec, through a segment and back.

Error: root mean square in 8-bit codes of sRGB.  Bounds: lossless 4:4:4 at 52 dB (0.64 codes);
H.264 4:2:0 at 48 dB (1 code) on flat pictures and 30 dB (8.1 codes) on the others, which are
grey: one-pixel colour does not exist in 4:2:0.  Naive: the codec library's own conversion from
RGB and back, untagged, in the same codec.
"""

from __future__ import annotations

import io
import tempfile
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np

from lfcore.evaluation.stability.judge import row
from lfcore.evaluation.stability.rows import Row
from lfcore.evaluation.stability.subject import Subject
from lfcore.storage.codecs import CodecSpec
from lfcore.storage.colour import frames_from_rgb, rgb_from_frames
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentReader, SegmentWriter

SIDES = (1, 2, 15, 16, 33, 64)
FRAMES = 4
FLAT, BUSY, LOSSLESS = 1.0, 8.1, 0.64


def _patterns(side: int) -> dict[str, np.ndarray]:
    """Pictures (FRAMES, side, side) grey in [0, 1]; ``colour`` has a last axis of RGB."""
    rng = np.random.default_rng(side)
    shape = (FRAMES, side, side)
    v, u = np.indices((side, side))
    checker = np.broadcast_to((u + v) % 2, shape).astype(float)
    highlight = np.full(shape, 0.05)
    highlight[:, side // 2, side // 2] = 1.0
    return {
        "black": np.zeros(shape),
        "white": np.ones(shape),
        "noise": rng.uniform(0, 1, shape),
        "checker": checker,
        "highlight": highlight,
        "colour": rng.uniform(0, 1, (*shape, 3)),
    }


def _rms(found: np.ndarray, rgb: np.ndarray) -> float:
    return float(255 * np.sqrt(((found - rgb) ** 2).mean()))


def _round_trip(rgb: np.ndarray, spec: CodecSpec) -> np.ndarray:
    side = rgb.shape[1]
    layout = FrameLayout("views", 1, side, pixel_format=spec.pixel_format)
    width, height = layout.frame_width, layout.frame_height
    frames = frames_from_rgb(rgb, spec.pixel_format, width, height)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "segment.mp4"
        with SegmentWriter(path, spec, width, height) as writer:
            writer.write(frames)
        decoded = np.concatenate([block.copy() for block in SegmentReader(path).frames()])
    pictures = rgb_from_frames(decoded, spec.pixel_format, width, height)
    return pictures[:, :side, :side]


def _library(rgb: np.ndarray, spec: CodecSpec) -> np.ndarray:
    """The same by the library's defaults; sides that the codec refuses are an error of all."""
    file = io.BytesIO()
    codes = np.rint(255 * rgb).astype(np.uint8)
    try:
        with av.open(file, "w", format="matroska") as output:
            stream = output.add_stream(spec.codec, 25, width=rgb.shape[2], height=rgb.shape[1])
            stream.pix_fmt = spec.pixel_format
            stream.options = {} if spec.lossless else {"crf": f"{spec.crf:g}"}
            for picture in codes:
                output.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            output.mux(stream.encode(None))
        file.seek(0)
        with av.open(file) as source:
            found = [frame.to_ndarray(format="rgb24") for frame in source.decode(video=0)]
    except (av.error.FFmpegError, ValueError):
        return np.full(rgb.shape, np.inf)
    return np.stack(found) / 255.0


def hard_pictures(subject: Subject) -> Iterator[Row]:
    """All patterns at sides from one pixel on, odd ones among them."""
    lossless = CodecSpec("ffv1", "yuv444p", preset=None, tune=None)
    lossy = CodecSpec("libx264", "yuv420p", crf=22.0)
    for side in SIDES:
        for name, picture in _patterns(side).items():
            colour = picture.ndim == 4
            rgb = picture if colour else np.repeat(picture[..., None], 3, axis=-1)
            jobs = [("codec 4:4:4 lossless, ", lossless, LOSSLESS)]
            if not colour:
                bound = FLAT if name in ("black", "white") else BUSY
                jobs.append(("codec 4:2:0 lossy, ", lossy, bound))
            for label, spec, bound in jobs:
                yield row(
                    label + name,
                    "side",
                    side,
                    bound,
                    lambda rgb=rgb, spec=spec: _rms(_library(rgb, spec), rgb),
                    lambda rgb=rgb, spec=spec: _rms(_round_trip(rgb, spec), rgb),
                )


CASES = (hard_pictures,)

"""Pictures that are hard on a codec, through a segment and back.

Error: root mean square in 8-bit codes of sRGB.  Bounds follow from the arithmetic of the formats
and of the encoder, whatever it measures; see :func:`lossless_bound`, :func:`lossy_bound` and
:func:`flat_bound`.  Pictures for 4:2:0 are grey: one-pixel colour does not exist in it.  Naive: the
codec library's own conversion from RGB and back, untagged, in the same codec.
"""

from __future__ import annotations

import io
import math
import tempfile
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np

from lfcore.evaluation.stability.measurement import NO_ANSWER, Bound, Measurement, measured, sweep
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest
from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentReader, SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames

CODES = "8-bit codes, rms"
FRAMES = 4
CRF = 22
LUMA = 255 / 219
"""Codes of sRGB to a code of limited-range luma."""
I_OFFSET, B_OFFSET = -6 * math.log2(1.4), 6 * math.log2(1.3)
"""x264 by default: key frames are that much finer than CRF says, B frames coarser."""
USUAL_COST, BLUR = 120, 0.4
"""The quantiser follows the power 0.4 of what a macroblock costs, and is CRF where that is 120."""


def lossless_bound(values: int) -> float:
    """4:4:4 in 8 bits: Y, Cb and Cr are each rounded once, so errors are uniform over half a code.

    R = Y + 1.5748 Cr and so on, of BT.709, with 255 codes to 219 of luma and 224 of chroma: 0.58
    codes over the three channels.  The mean square of n uniform errors passes its expectation by
    three standard deviations, sqrt(4 / 5n) each, once in a thousand.
    """
    luma, chroma = LUMA**2 / 12, (255 / 224) ** 2 / 12
    square = luma + chroma * (1.5748**2 + 0.1873**2 + 0.4681**2 + 1.8556**2) / 3
    return math.sqrt(square * (1 + 3 * math.sqrt(0.8 / values)))


def step(qp: float) -> float:
    """Step of the H.264 quantiser, 8-bit codes: it doubles every 6, and is 1 at 4."""
    return 2 ** ((qp - 4) / 6)


def noise_cost() -> float:
    """What a macroblock of white noise costs x264: sums of absolute Hadamard coefficients.

    Of a picture of half the size, whose pixels are means of four: of 4 x 4 of them with standard
    deviation s every coefficient has 4 s, the mean of its size is sqrt(2 / pi) of that, and half of
    the 16 are counted; four such blocks make a macroblock.
    """
    deviation = 219 / math.sqrt(12) / 2
    return 4 * 16 / 2 * math.sqrt(2 / math.pi) * 4 * deviation


def lossy_bound() -> float:
    """H.264 of the picture that costs most, noise, in B frames, where the quantiser is coarsest.

    Its dead zone and the trellis move a coefficient by up to a step, so the error is within one
    step: a third of its square in the mean.  The transform is orthonormal, and grey has no chroma.
    """
    qp = CRF + 6 * BLUR * math.log2(noise_cost() / USUAL_COST) + B_OFFSET
    return LUMA * step(qp) / math.sqrt(3)


def flat_bound() -> float:
    """H.264 of one colour, which costs nothing: only the mean of the smallest blocks, 4 x 4, is
    coded, in key frames, and no coarser than CRF.

    Two thirds of a step at the most, for the dead zone of intra blocks is a third, and a step of
    the mean's coefficient is a quarter of it in each pixel; half a code more for rounding.
    """
    return LUMA * (step(CRF + I_OFFSET) * 2 / 3 / 4 + 0.5)


FLAT = Bound(flat_bound(), CODES, "key frames' quantiser")
LOSSY = Bound(lossy_bound(), CODES, f"B frames' quantiser at CRF {CRF}")


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


def _round_trip(rgb: np.ndarray, spec: Encoding) -> np.ndarray:
    side = rgb.shape[1]
    layout = FrameLayout("views", 1, side, pixel_format=spec.stored_format)
    width, height = layout.frame_width, layout.frame_height
    frames = frames_from_rgb(rgb, spec.stored_format, width, height)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "segment.mp4"
        with SegmentWriter(path, spec, width, height) as writer:
            writer.write(frames)
        decoded = np.concatenate([block.copy() for block in SegmentReader(path).frames()])
    pictures = rgb_from_frames(decoded, spec.stored_format, width, height)
    return pictures[:, :side, :side]


def _library(rgb: np.ndarray, spec: Encoding) -> np.ndarray:
    """The same by the library's defaults; of sides that the codec refuses no picture comes."""
    file = io.BytesIO()
    codes = np.rint(255 * rgb).astype(np.uint8)
    try:
        with av.open(file, "w", format="matroska") as output:
            stream = output.add_stream(spec.codec, 25, width=rgb.shape[2], height=rgb.shape[1])
            assert isinstance(stream, av.VideoStream)
            stream.pix_fmt = spec.stored_format
            stream.options = {} if spec.lossless else {"crf": f"{spec.crf:g}"}
            for picture in codes:
                output.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
            output.mux(stream.encode(None))
        file.seek(0)
        with av.open(file, "r") as source:
            found = [frame.to_ndarray(format="rgb24") for frame in source.decode(video=0)]
    except (av.error.FFmpegError, ValueError):
        return np.full(rgb.shape, NO_ANSWER)
    return np.stack(found).astype(float) / 255.0


@sweep("codec", "side", (1, 2, 15, 16, 33, 64))
def hard_pictures(tracer: TracerUnderTest, side: int) -> Iterator[Measurement]:
    """All patterns at sides from one pixel on, odd ones among them."""
    lossless = Encoding("ffv1", "yuv444p", preset=None, tune=None)
    lossy = Encoding("libx264", "yuv420p", crf=float(CRF), preset="veryfast")
    for name, picture in _patterns(side).items():
        colour = picture.ndim == 4
        rgb = picture if colour else np.repeat(picture[..., None], 3, axis=-1)
        bound = Bound(lossless_bound(picture.size), CODES, "rounding of Y, Cb and Cr to 8 bits")
        yield _stored(f"codec 4:4:4 lossless, {name}", lossless, bound, rgb)
        if not colour:
            bound = FLAT if name in ("black", "white") else LOSSY
            yield _stored(f"codec 4:2:0 lossy, {name}", lossy, bound, rgb)


def _stored(case: str, spec: Encoding, bound: Bound, rgb: np.ndarray) -> Measurement:
    return measured(
        case,
        bound,
        lambda: _rms(_library(rgb, spec), rgb),
        lambda: _rms(_round_trip(rgb, spec), rgb),
    )

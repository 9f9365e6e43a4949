"""Layout and encoder settings that measured best, by the number of views a side.

``docs/decisions.md`` has the measurements.  Views cost a fraction of a macropixel's bits at
small N.  Where a view's side has fewer than 16 times the pixels of a macropixel's side, a block of
a view sees thousands of triangles in a dense scene, and takes tens of times as long to trace.  8
bits leave bands where few frames are averaged: PQ, and slicing by depth, have 10.  A macropixel is
its neighbour's shifted by less than a pixel: ``ultrafast``, which predicts each block from the
frame before, with arithmetic coding and larger transforms has the error and the size of slower
presets in a third of their time.  A key frame every 128 frames costs 3% of the bits at N = 32, and
bounds what a macropixel costs to read: 64 frames on average.
"""

from dataclasses import replace
from typing import Any

from lfcore.errors import StorageError
from lfcore.optics.size import Pixels, Size
from lfcore.storage.codecs import CODECS, Encoding
from lfcore.storage.layout import FrameLayout

QUICK: dict[str, Any] = {
    "preset": "ultrafast",
    "extra": (("cabac", "1"), ("8x8dct", "1"), ("partitions", "i8x8")),
}
"""Settings of H.264 beyond N = 16."""
_SETTINGS: tuple[tuple[int, float, dict[str, Any]], ...] = (
    # views up to; the CRF of other codecs and presets; what is set
    (16, 30.0, {"preset": "medium", "bframes": 8}),
    (32, 30.0, {"crf": 31.0} | QUICK),
    (64, 34.0, {"crf": 37.0} | QUICK),
    (128, 30.0, {"crf": 38.0} | QUICK),
    (1 << 30, 28.0, {"crf": 36.0} | QUICK),
)
FEW_VIEWS_CRF = 20.0
"""CRF of H.264 where pictures are sliced by depth from up to 16 lens samples a side.  Few frames
are averaged, so the codec's noise must stay below the error of the rays themselves."""
KEY_EVERY = 128
"""Frames from one key frame to the next."""
WIDE = 2048
"""Wider frames refer to the one before alone: decoders hold 2 of them and not 6, 100 MB each at
4096 x 4096.  Measured there: 8% more bits than with B-frames, which hold 4, and pictures of 58.6 to
63.6 dB, 0.5 to 1.1 dB less; at half the side 18% and 1 to 2 dB."""
NO_LOOKAHEAD = (("mbtree", "0"), ("rc-lookahead", "0"))
WIDE_CRF = 2.5
"""The macroblock tree of H.264 holds all frames of a segment.  Without it, a CRF higher by this
gives the same bits and pictures in 0.75 of the time."""
DEFAULT_CODEC = Encoding().codec
OTHER_PRESETS = {"libx265": "fast", "libsvtav1": "8"}
CRF_SCALE = {"libsvtav1": 1.5}
"""AV1's constant rate factor runs to 63, and this times x264's gives about its quality."""
PIXELS_FOR_VIEWS, FEW_VIEWS = 16, 8


def default_kind(views: int, pixels: int = 512) -> str:
    """``views`` or ``macropixels``: which costs fewer bits at equal error, and not long to trace.

    ``views`` and ``pixels`` are N and M, a side.
    """
    _check(views)
    wide = pixels >= PIXELS_FOR_VIEWS * views
    return "views" if wide or views <= FEW_VIEWS else "macropixels"


def default_pack(views: int, pixels: int = 512) -> int:
    """Elements a side that share a frame: one view, or macropixels of 128 pixels together, as an
    encoder spends some 30 microseconds a frame whatever its size."""
    return macropixel_pack(views) if default_kind(views, pixels) == "macropixels" else 1


def macropixel_pack(views: int) -> int:
    """As :func:`default_pack`, for macropixels whether they are the default or not; 8 at most."""
    _check(views)
    return max(1, min(8, 128 // views))


def chosen_encoding(
    views: int, encoding: Encoding | None = None, *, by_depth: bool = False, width: int = 0
) -> Encoding:
    """``encoding`` for N = ``views``, with each None replaced by what measured best, also where
    pictures are sliced ``by_depth``, in frames of ``width`` pixels.

    H.265 has H.264's rate factor of that N and AV1 that times :data:`CRF_SCALE`, for about the same
    quality, at presets of their own; chroma is whole where the codec can store it whole.
    ``bframes`` and ``refs`` stay None where the preset decides.
    """
    _check(views)
    given = encoding or Encoding()
    crf, best = next((crf, own) for limit, crf, own in _SETTINGS if views <= limit)
    if by_depth and views <= 16:
        crf = FEW_VIEWS_CRF
    if given.codec != DEFAULT_CODEC:
        crf = min(63.0, crf * CRF_SCALE.get(given.codec, 1.0))
        best = {"preset": OTHER_PRESETS.get(given.codec)}
    elif given.preset not in (None, best["preset"]):
        best = {}  # another preset has its own
    if width > WIDE and given.codec in ("libx264", "libx265"):
        best = best | {"bframes": 0, "refs": 1}
        if "preset" in best and given.codec == DEFAULT_CODEC and views <= 16:
            crf, best = crf + WIDE_CRF, best | {"extra": NO_LOOKAHEAD}
    full = "yuv444p" if "yuv444p" in CODECS[given.codec] else "yuv420p"
    deep = given.transfer == "pq" or (by_depth and not given.lossless)
    if deep and f"{full}10le" in CODECS[given.codec]:
        full += "10le"
    best = {"crf": crf} | best | {"pixel_format": full, "gop": KEY_EVERY}
    open_keys = [key for key in best if getattr(given, key) in (None, ())]
    chosen = replace(given, **{key: best[key] for key in open_keys})
    return replace(chosen, preset=None, tune=None) if chosen.lossless else chosen


def frame_layout(
    views: int,
    pixels: Pixels,
    pixel_format: str,
    *,
    kind: str | None = None,
    order: str = "serpentine",
    pack: int | None = None,
    peak: float | None = None,
) -> FrameLayout:
    """The layout of N = ``views`` of so many pixels in frames; None is what measured best, and of
    ``peak`` sRGB."""
    size = Size.of(pixels)
    kind = kind or default_kind(views, size.longer)
    if pack is None:
        pack = min(macropixel_pack(views), size.longer) if kind == "macropixels" else 1
    return FrameLayout(kind, views, size.longer, order, pack, pixel_format, size, peak)


def _check(views: int) -> None:
    if views < 1:
        raise StorageError(f"must be positive, not {views}", key="views")

"""The best measured layout and encoder settings, by the number of views per side.

``docs/decisions.md`` has the measurements.  At small N, views need a fraction of macropixels' bits.
If a view's side has fewer than 16 times the pixels of a macropixel's side, a block of a view covers
thousands of triangles in a dense scene, and tracing takes tens of times as long.  With 8 bits,
bands are visible if few frames are averaged: PQ and slicing by depth have 10.  A macropixel is its
neighbour shifted by less than a pixel.  ``ultrafast`` predicts each block from the frame before;
with arithmetic coding and larger transforms it has the error and the size of slower presets in a
third of their time.  A key frame every 128 frames costs 3% of the bits at N = 32, and a macropixel
then needs 64 decoded frames on average.
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
"""The settings of H.264 beyond N = 16."""
_SETTINGS: tuple[tuple[int, float, dict[str, Any]], ...] = (
    # views up to; CRF of other codecs and presets; settings
    (16, 30.0, {"preset": "medium", "bframes": 8}),
    (32, 30.0, {"crf": 31.0} | QUICK),
    (64, 34.0, {"crf": 37.0} | QUICK),
    (128, 30.0, {"crf": 38.0} | QUICK),
    (1 << 30, 28.0, {"crf": 36.0} | QUICK),
)
FEW_VIEWS_CRF = 20.0
"""The CRF of H.264 for slicing by depth from up to 16 lens samples per side.  Few frames are
averaged, so the codec's error must be below the rays' error."""
KEY_EVERY = 128
"""The frames from key frame to key frame."""
WIDE = 2048
"""The width above which frames refer only to the frame before: decoders hold 2 frames instead of 6,
100 MB each at 4096 x 4096.  There it costs 8% of the bits and 0.5 to 1.1 dB of 58.6 to 63.6 dB; at
half the side 18% and 1 to 2 dB."""
NO_LOOKAHEAD = (("mbtree", "0"), ("rc-lookahead", "0"))
"""The settings of H.264 without its macroblock tree, which holds all frames of a segment."""
WIDE_CRF = 2.5
"""The increase of the CRF without the macroblock tree: bits and pictures are then the same, in 0.75
of the time."""
HUGE = 4096
"""The width above which motion is in whole pixels: an encoder then holds each frame that others
refer to once, not at four offsets: at 8192 x 8192 3.8 instead of 7.0 GB."""
WHOLE_PIXELS = (("subme", "0"),)
"""The settings of H.264 for motion in whole pixels."""
HUGE_CRF = 1.5
"""The increase of the CRF with motion in whole pixels: pictures are then the same, with 12% more
bits."""
DEFAULT_CODEC = Encoding().codec
"""The codec of :class:`Encoding`."""
OTHER_PRESETS = {"libx265": "fast", "libsvtav1": "8"}
"""The presets of other codecs."""
CRF_SCALE = {"libsvtav1": 1.5}
"""The ratio of a codec's CRF to x264's at about the same quality; AV1's goes up to 63."""
PIXELS_FOR_VIEWS = 16
"""The least ratio of pixels to views per side for the layout views."""
FEW_VIEWS = 8
"""The most views per side that always have the layout views."""


def default_kind(views: int, pixels: int = 512) -> str:
    """Return the layout, views or macropixels, with fewer bits at equal error that is fast to
    trace; ``views`` and ``pixels`` are N and M, per side."""
    _check(views)
    wide = pixels >= PIXELS_FOR_VIEWS * views
    return "views" if wide or views <= FEW_VIEWS else "macropixels"


def default_pack(views: int, pixels: int = 512) -> int:
    """Return the elements per side of a frame: one view, or macropixels with 128 pixels together.

    Small frames are slow: an encoder needs at least some 30 microseconds per frame.
    """
    return macropixel_pack(views) if default_kind(views, pixels) == "macropixels" else 1


def macropixel_pack(views: int) -> int:
    """Return :func:`default_pack` for macropixels; at most 8."""
    _check(views)
    return max(1, min(8, 128 // views))


def chosen_encoding(
    views: int, encoding: Encoding | None = None, *, by_depth: bool = False, width: int = 0
) -> Encoding:
    """Replace each None of ``encoding`` by the best measured setting.

    The settings depend on N = ``views``, on whether pictures are sliced ``by_depth``, and on the
    ``width`` of frames, pixels.  H.265 has H.264's rate factor, and AV1 that times
    :data:`CRF_SCALE`, for about the same quality, with their own presets.  Chroma is not subsampled
    if the codec allows it.  ``bframes`` and ``refs`` stay None if the preset decides.
    """
    _check(views)
    requested = encoding or Encoding()
    crf, best = next((crf, own) for limit, crf, own in _SETTINGS if views <= limit)
    if by_depth and views <= 16:
        crf = FEW_VIEWS_CRF
    if requested.codec != DEFAULT_CODEC:
        crf = min(63.0, crf * CRF_SCALE.get(requested.codec, 1.0))
        best = {"preset": OTHER_PRESETS.get(requested.codec)}
    elif requested.preset not in (None, best["preset"]):
        best = {}  # another preset has its own
    if width > WIDE and requested.codec in ("libx264", "libx265"):
        best = best | {"bframes": 0, "refs": 1}
        if "preset" in best and requested.codec == DEFAULT_CODEC and views <= 16:
            crf, best = crf + WIDE_CRF, best | {"extra": NO_LOOKAHEAD}
            if width > HUGE:
                crf, best = crf + HUGE_CRF, best | {"extra": NO_LOOKAHEAD + WHOLE_PIXELS}
    full = "yuv444p" if "yuv444p" in CODECS[requested.codec] else "yuv420p"
    deep = requested.transfer == "pq" or (by_depth and not requested.lossless)
    if deep and f"{full}10le" in CODECS[requested.codec]:
        full += "10le"
    best = {"crf": crf} | best | {"pixel_format": full, "gop": KEY_EVERY}
    open_keys = [key for key in best if getattr(requested, key) in (None, ())]
    chosen = replace(requested, **{key: best[key] for key in open_keys})
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
    """Return the layout of N = ``views`` with ``pixels`` in frames.

    None is the best measured value; a ``peak`` of None is sRGB.
    """
    size = Size.of(pixels)
    kind = kind or default_kind(views, size.longer)
    if pack is None:
        pack = min(macropixel_pack(views), size.longer) if kind == "macropixels" else 1
    return FrameLayout(kind, views, size.longer, order, pack, pixel_format, size, peak)


def _check(views: int) -> None:
    if views < 1:
        raise StorageError(f"must be positive, not {views}", key="views")

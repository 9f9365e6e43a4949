"""Layout and encoder settings that measured best, by the number of views a side.

Measured by ``python benchmarks/codecs.py`` on the bike scene at M = 512: libx264, one core of a
2.5 GHz server processor shared with other work, CPU seconds.  "Lens" is the PSNR of the picture in
focus through the whole lens, whose N^2 samples average most of the codec's noise away; "frames"
that of the stored frames.  Rates are million rays a second of encoding.

    N    layout                     settings               bits/ray  frames   lens   rate
    16   views                      veryfast 4:4:4 crf 22     0.600    34.1   46.7     25
    16   views                      veryfast 4:2:0 crf 22     0.465    30.5   41.5     31
    16   views                      medium 4:2:0 crf 22       0.453    31.1   42.2     11
    16   views                      ultrafast 4:2:0 crf 22    0.817    30.9   42.4    103
    16   macropixels, 8 x 8 a frame ultrafast 4:2:0 crf 22    1.735    26.3   39.3     58
    16   macropixels, 1 a frame     veryfast 4:2:0 crf 22     1.496    27.0   40.6      4
    32   views                      veryfast 4:2:0 crf 26     0.201    28.9      -     33
    32   macropixels, 8 x 8         veryfast 4:2:0 crf 26     0.567    27.5   41.2     19
    64   views                      veryfast 4:4:4 crf 28     0.170    30.3      -     37
    64   macropixels, 1             veryfast 4:4:4 crf 30     0.185    31.4   46.3     16
    64   macropixels, 2 x 2         veryfast 4:4:4 crf 32     0.146    30.0   45.1     20
    64   macropixels, 2 x 2         veryfast 4:2:0 crf 26     0.200    29.8   45.2     21
    64   macropixels, 4 x 4         ultrafast 4:2:0 crf 28    0.312    29.2   44.9     79
    128  macropixels                superfast 4:4:4 crf 32    0.161    35.1   52.8     28
    128  macropixels                superfast 4:2:0 crf 32    0.109    32.2   50.5     50
    512  macropixels                ultrafast 4:2:0 crf 34    0.041    36.6   51.4    140
    512  same with 3 B frames       ultrafast 4:2:0 crf 34    0.032    36.4   50.9    180
    512  same with 8 B frames       ultrafast 4:2:0 crf 34    0.032    35.0   48.8    149
    512  macropixels                ultrafast 4:4:4 crf 34    0.065    39.3   60.9    119
    512  macropixels                veryfast 4:2:0 crf 28     0.019    36.3   51.1     52

and at M = 128, all 4:4:4:

    16   views                      veryfast crf 24           1.066    30.0   42.3     16
    16   macropixels, 8 x 8         veryfast crf 24           1.762    30.4   44.6     10
    32   views                      veryfast crf 24           0.870    30.3      -     18
    32   macropixels, 4 x 4         veryfast crf 24           1.193    31.6   47.0     11
    64   views                      veryfast crf 28           0.419    28.1      -     21
    64   macropixels                veryfast crf 28           0.345    32.1   48.0     13
    128  views                      veryfast crf 28           0.338    29.0      -     21
    128  macropixels                veryfast crf 28           0.104    36.6   49.1     22
    512  macropixels                ultrafast crf 34          0.055    41.3   59.1    133

(No "lens" where only 16 x 16 of the views were encoded.)
What follows from it:

- Views cost fewer bits at small N, where a macropixel of 16 x 16 is mostly edges; the two are even
  at N = 64 for M = 512 and at N = 32 for M = 128.  Yet macropixels are the default above N = 8: a
  block of 16 x 16 pixels of one view sees thousands of triangles in a dense scene, and tracing
  bedroom at N = 32, M = 128 as views took tens of times as long as as macropixels (``lfcore trace
  scenes/bedroom --views 32 --size 128 --layout views``).  Ask for views where bits matter most.
- 4:4:4 up to N = 128: at N = 64 it needs 27% fewer bits than 4:2:0 at equal error of the picture,
  at N = 16 a quarter fewer (crf 26: 0.350 bits, 43.0 dB).  At N = 512 the average over the lens
  hides subsampled chroma, and half the samples to encode count for more.
- At large N speed decides, and encoding is the slowest stage: ``ultrafast`` with 3 B frames, which
  are both faster and a quarter smaller than none.  cabac, subme 1, more B frames and the Hilbert
  order gain 4% at most there.  Preset ``veryfast`` would save 40% more bits at a third of the rate.
"""

from __future__ import annotations

from lfcore.errors import StorageError
from lfcore.storage.codecs import CodecSpec

_SETTINGS = (
    # views up to, preset, pixel format, crf, bframes, refs
    (16, "veryfast", "yuv444p", 22, None, None),
    (32, "veryfast", "yuv444p", 25, None, None),
    (64, "veryfast", "yuv444p", 28, None, None),
    (128, "superfast", "yuv444p", 32, None, None),
    (1 << 30, "ultrafast", "yuv420p", 34, 3, 1),
)


def default_kind(views: int, pixels: int = 512) -> str:
    """``views`` or ``macropixels``: which is traced and stored in less time at equal error.

    ``views`` and ``pixels`` are N and M, a side; M does not matter at present.
    """
    _check(views)
    return "macropixels" if views > 8 else "views"


def default_pack(views: int, pixels: int = 512) -> int:
    """Elements a side that share a frame: one view, or macropixels of 128 pixels together.

    An encoder spends some 30 microseconds a frame whatever its size: ``ultrafast`` at N = 16 does
    8 million rays a second one macropixel a frame, and 58 million with 8 x 8 of them together.
    """
    return macropixel_pack(views) if default_kind(views, pixels) == "macropixels" else 1


def macropixel_pack(views: int) -> int:
    """As :func:`default_pack`, for macropixels whether they are the default or not; 8 at most."""
    _check(views)
    return max(1, min(8, 128 // views))


def default_spec(views: int) -> CodecSpec:
    """Encoder settings for N = ``views``: at least about 46 dB through the whole lens.

    A single key frame a segment; one every 16 frames cost a tenth more bits at N = 16, and lets a
    view be read without decoding all before it.  One thread, so that the stream is reproducible;
    cores share the segments.

    Raises :class:`StorageError` unless ``views`` is positive.
    """
    _check(views)
    preset, pixel_format, crf, bframes, refs = next(
        settings for limit, *settings in _SETTINGS if views <= limit
    )
    return CodecSpec(
        preset=preset, pixel_format=pixel_format, crf=float(crf), bframes=bframes, refs=refs
    )


def _check(views: int) -> None:
    if views < 1:
        raise StorageError(f"must be positive, not {views}", key="views")

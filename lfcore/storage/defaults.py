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
and later, with 50 million rays and more, 4:4:4, M = 512, bike (views are all 256 at N = 16, and the
middle 256 of N = 32 and 64, whose "lens" is therefore lower than of all of them):

    N    layout                     settings               bits/ray  frames   lens   rate
    16   views                      medium crf 30, 8 B        0.180    30.0   44.0     23
    16   views                      veryfast crf 26           0.350    31.2   43.1     52
    16   views, Hilbert             medium crf 30, 8 B        0.189    29.9   44.1     21
    16   views                      slow crf 28, 8 B          0.235    31.2   44.9     12
    16   the same                   medium crf 28, 8 B        0.243    31.2   45.2     20
    32   views                      medium crf 30, 8 B        0.138    30.4   42.2     24
    64   views                      medium crf 30, 8 B        0.115    30.6   40.7     26
    64   macropixels, 2 x 2         medium crf 32             0.140    29.8   47.6     20
    64   macropixels, 2 x 2         veryfast crf 28           0.257    31.6   48.5     46
    64   macropixels, 4 x 4         faster crf 32             0.181    29.8   48.2     30
    128  macropixels                medium crf 30             0.082    35.3   51.8     30
    128  macropixels                superfast crf 32          0.163    35.1   53.2    100
    512  macropixels                medium crf 28             0.023    41.2   55.2     38
    512  macropixels                medium 4:2:0 crf 28       0.019    37.4   54.1     45
    512  macropixels                veryfast crf 28           0.027    39.0   52.5     81
    512  macropixels                ultrafast 4:2:0 crf 34    0.032    36.4   50.9    293

and on another processor, slower by a quarter, 67 million rays of views of bike and 60 to 200 of
macropixels, 4:4:4, M = 512; quick is ``--preset veryfast --extra keyint=128 trellis=1
rc-lookahead=40 ref=3 bframes=8`` (20 ahead at N = 256):

    16   views                      medium crf 30, 8 B        0.180    30.0   44.0     17
    16   views                      quick crf 30              0.194    29.6   43.5     36
    32   views                      medium crf 30, 8 B        0.142    30.6   42.7     19
    32   views                      quick crf 30              0.153    30.2   42.2     38
    64   macropixels, 2 x 2         medium crf 33, 8 B        0.164    28.7   48.0     16
    64   macropixels, 2 x 2         quick crf 33              0.194    28.6   47.1     31
    64   macropixels, 2 x 2         veryfast crf 33, 3 B      0.108    29.9   46.4     43
    64   the same rays              medium crf 33, 3 B        0.101    30.6   49.2     15
    64   the same rays              veryfast, 40 ahead        0.109    30.0   46.5     41
    64   the same rays              that, trellis 1           0.109    30.2   47.8     39
    64   the same rays              that, subme 4             0.111    30.6   48.4     29
    128  macropixels                medium crf 30             0.085    34.7   50.0     22
    128  macropixels                quick crf 30              0.089    34.0   48.7     41
    256  macropixels                medium crf 28             0.047    38.6   53.7     28
    256  macropixels                quick crf 28              0.054    37.8   52.8     52

What follows from it:

- Views cost a fraction of the bits at small N, where a macropixel of 16 x 16 is mostly edges, and
  hold at N = 16 and 32 what macropixels cannot: a stream 500 to 1000 times smaller than 12 bytes a
  ray whose pictures are right to 44 dB.  They are the default where a view has at least 16 pixels
  for each one of a macropixel, along a side (and up to N = 8).  With fewer, a block of 16 x 16
  pixels of one view sees thousands of triangles in a dense scene, and tracing bedroom at N = 32,
  M = 128 as views took tens of times as long as as macropixels; at N = 16, M = 512 it is as fast.
- 4:4:4 everywhere: at N = 64 it needs 27% fewer bits than 4:2:0 at equal error of the picture, and
  at N = 512 frames are 2 dB better at equal bits.
- Preset ``medium`` at N = 16, where the codec's noise is averaged least, and beyond N = 256:
  against ``ultrafast`` at N = 512 a quarter fewer bits, and 5 dB of frames and 4 dB of pictures
  besides, at an eighth of its rate.  Ask for ``ultrafast`` where a store is made once and read
  once.
- ``veryfast`` in between, with what gives most of ``medium``'s quality back for 15% of its rate:
  the coefficients' trellis (1.3 dB of the lens picture), frames looked ahead (0.2 dB), and at small
  N three reference frames (6% of the bits).  It does twice the rays of ``medium``.
- 20 frames are looked ahead beyond N = 128 and not 40, which at N = 512 saves 32 MiB of the
  encoder's 74, for 0.6 to 2.3% fewer bits and 0.05 to 0.3 dB less at one CRF, with 0.6 to 1% fewer
  instructions.
- A key frame every 128 frames costs 3% of the bits at N = 32 and bounds what a macropixel costs to
  read: 64 frames decoded on average.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from lfcore.errors import StorageError
from lfcore.storage.codecs import CODECS, CodecSpec
from lfcore.storage.layout import FrameLayout

QUICK: dict[str, Any] = {
    "preset": "veryfast",
    "bframes": 8,
    "refs": 3,
    "lookahead": 40,
    "extra": (("trellis", "1"),),
}
"""Settings of H.264 in the middle of the range of N."""
_SETTINGS: tuple[tuple[int, dict[str, Any]], ...] = (
    # views up to, and what is set
    (16, {"crf": 30.0, "preset": "medium", "bframes": 8}),
    (32, {"crf": 30.0} | QUICK),
    (64, {"crf": 34.0} | QUICK),
    (128, {"crf": 30.0} | QUICK),
    (256, {"crf": 28.0} | QUICK | {"lookahead": 20}),
    (1 << 30, {"crf": 28.0, "preset": "medium", "lookahead": 20}),
)
KEY_EVERY = 128
"""Frames from one key frame to the next."""
AUTO = "auto"
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
    """Encoder settings for N = ``views``: at least about 44 dB through the whole lens.

    One thread, so that the stream is reproducible; cores share the segments.

    Raises :class:`StorageError` unless ``views`` is positive.
    """
    _check(views)
    settings = next(own for limit, own in _SETTINGS if views <= limit)
    return CodecSpec(pixel_format="yuv444p", gop=KEY_EVERY, **settings)


def codec_spec(
    views: int,
    codec: str = "libx264",
    *,
    pixel_format: str = AUTO,
    crf: float | str = AUTO,
    preset: str | None = AUTO,
    tune: str | None = "psnr",
) -> CodecSpec:
    """Settings of any encoder for N = ``views``; what is ``auto`` is as measured best.

    H.265 has H.264's rate factor of that N and AV1 that times :data:`CRF_SCALE`, for about the
    same quality, at presets of their own; chroma is whole where the codec can store it whole.

    Parameters
    ----------
    codec : a key of :data:`lfcore.storage.codecs.CODECS`.
    pixel_format, crf, preset, tune : as :class:`CodecSpec` takes them, or ``auto``.

    Raises :class:`StorageError` for settings that the codec does not take.
    """
    best = default_spec(views)
    if codec == best.codec:
        spec = best if preset == AUTO else best.of_preset(preset)
    else:
        spec = CodecSpec(
            codec,
            "yuv444p" if "yuv444p" in CODECS.get(codec, ()) else "yuv420p",
            crf=min(63.0, best.crf * CRF_SCALE.get(codec, 1.0)),
            preset=OTHER_PRESETS.get(codec) if preset == AUTO else preset,
            gop=best.gop,
        )
    given: dict[str, Any] = {"pixel_format": pixel_format, "crf": crf, "tune": tune}
    spec = replace(spec, **{key: value for key, value in given.items() if value != AUTO})
    return replace(spec, preset=None, tune=None) if spec.lossless else spec


def frame_layout(
    views: int,
    pixels: int,
    pixel_format: str,
    *,
    kind: str = AUTO,
    order: str = "serpentine",
    pack: int | str = AUTO,
) -> FrameLayout:
    """How the rays of N = ``views`` and M = ``pixels`` lie in frames; ``auto`` as measured best."""
    kind = default_kind(views, pixels) if kind == AUTO else kind
    if pack == AUTO:
        pack = min(macropixel_pack(views), pixels) if kind == "macropixels" else 1
    return FrameLayout(kind, views, pixels, order, int(pack), pixel_format)


def _check(views: int) -> None:
    if views < 1:
        raise StorageError(f"must be positive, not {views}", key="views")

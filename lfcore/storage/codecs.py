"""Codecs and their settings: what a segment is encoded with."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, fields, replace

from lfcore.errors import StorageError
from lfcore.storage.pixels import GREY_FORMATS, pixel_format

CODECS = {
    "libx264": ("yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le"),
    "libx265": ("yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le"),
    "libsvtav1": ("yuv420p", "yuv420p10le"),
    "ffv1": ("yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le", "gbrp"),
}
"""Encoders of FFmpeg's that can be used, with the pixel formats of colour of each."""
GREY_CODECS = ("libx264", "ffv1")
"""Those that are used for streams of one plane, too."""
LOSSLESS = ("ffv1",)

WHOLE_ROWS = 128
"""x264's macroblock tree and its like in x265 ("cutree") are used for frames of such widths only.

With others, x264 gave another stream each run at 48, 64, 130, 144 and 200 pixels, never at 128,
256, 384, 512 or 640; x265 damaged the heap (seen with glibc's MALLOC_CHECK_=3) at 16, 32 and 48.
"""
SMALLEST_FRAME = {"libx265": 66}
"""Side of the smallest frame that gives the same file each time.  x265 reads beyond frames that are
one coding tree block wide (64 pixels; 32 with its fastest presets): the same 64 x 64 pixels gave 10
unlike files of 10, now and then a poor one or an error; from 66 pixels on all files were the same.
"""


@dataclass(frozen=True)
class CodecSpec:
    """Settings of an encoder.

    codec : ``libx264`` (H.264), ``libx265`` (H.265), ``libsvtav1`` (AV1) or ``ffv1`` (lossless).
    pixel_format : of the frames handed over and stored; nothing is ever converted.
    crf : constant rate factor; lower is better.  Not for ``ffv1``.
    preset : the encoder's own; None for its default.
    tune : ``psnr`` leaves out what pleases the eye and costs accuracy; None for the default.
    gop : frames from one key frame to the next; 0 for a single one at the start.
    bframes, refs : None for the preset's own (H.264 and H.265).
    lookahead : frames that H.264 looks ahead, which it holds in memory; None for the preset's own.
    threads : of one encoder.  The stream may depend on it: with 1 it is reproducible.
    extra : further (key, value) pairs of the encoder's own parameters.

    Raises :class:`StorageError` for settings that no encoder takes.
    """

    codec: str = "libx264"
    pixel_format: str = "yuv420p"
    crf: float = 22.0
    preset: str | None = "veryfast"
    tune: str | None = "psnr"
    gop: int = 0
    bframes: int | None = None
    refs: int | None = None
    lookahead: int | None = None
    threads: int = 1
    extra: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        if self.codec not in CODECS:
            raise StorageError(
                f"unknown codec {self.codec!r}",
                key="codec",
                remedy=f"Use one of {', '.join(CODECS)}",
            )
        pixel_format(self.pixel_format)
        grey = tuple(GREY_FORMATS) if self.codec in GREY_CODECS else ()
        if self.pixel_format not in (*CODECS[self.codec], *grey):
            raise StorageError(
                f"{self.codec} does not take {self.pixel_format}",
                key="pixel_format",
                remedy=f"Use one of {', '.join(CODECS[self.codec])}",
            )
        checks = (
            ("crf", 0 <= self.crf <= 63, "from 0 to 63"),
            ("gop", self.gop >= 0, "0 or more"),
            ("threads", 1 <= self.threads <= 64, "from 1 to 64"),
            ("bframes", self.bframes is None or 0 <= self.bframes <= 16, "from 0 to 16"),
            ("refs", self.refs is None or 1 <= self.refs <= 16, "from 1 to 16"),
            ("lookahead", self.lookahead is None or 0 <= self.lookahead <= 250, "from 0 to 250"),
        )
        for key, good, range_text in checks:
            if not good:
                raise StorageError(f"must be {range_text}, not {getattr(self, key)}", key=key)

    def of_preset(self, preset: str | None) -> CodecSpec:
        """The same at another preset, with all that a preset decides left to it."""
        if preset == self.preset:
            return self
        return replace(
            self, preset=preset, bframes=None, refs=None, lookahead=None, extra=()
        )  # fmt: skip

    @property
    def lossless(self) -> bool:
        return self.codec in LOSSLESS

    def check_frame(self, width: int, height: int) -> None:
        """Raise :class:`StorageError` for frames smaller than the encoder is reproducible with."""
        least = SMALLEST_FRAME.get(self.codec, 0)
        if min(width, height) < least:
            raise StorageError(
                f"{self.codec} is not reproducible in frames of {width} x {height} pixels",
                key="codec",
                remedy=f"Pack more elements a frame, so that it has {least} pixels a side or more, "
                "or use libx264",
            )

    def options(self, width: int) -> dict[str, str]:
        """The settings as FFmpeg's encoder options, for frames of that width."""
        if self.codec in ("libx264", "libx265"):
            return (self._x264 if self.codec == "libx264" else self._x265)(width)
        return self._svtav1() if self.codec == "libsvtav1" else self._ffv1()

    def _named(self) -> dict[str, str]:
        given = {"preset": self.preset, "tune": self.tune, "crf": f"{self.crf:g}"}
        return {key: value for key, value in given.items() if value is not None}

    def _x264(self, width: int) -> dict[str, str]:
        # Segments are joined: headers must not depend on what is in them (stitchable), and no
        # frame may refer beyond its own segment (open-gop=0).
        own = {
            "keyint": str(self.gop) if self.gop else "infinite",
            "min-keyint": "1",
            "scenecut": "0",
            "open-gop": "0",
            "stitchable": "1",
        }
        if width % WHOLE_ROWS:
            own["mbtree"] = "0"
        if self.bframes is not None:
            own["bframes"] = str(self.bframes)
        if self.refs is not None:
            own["ref"] = str(self.refs)
        if self.lookahead is not None:
            own["rc-lookahead"] = str(self.lookahead)
        return self._named() | {"x264-params": _joined(own | dict(self.extra))}

    def _x265(self, width: int) -> dict[str, str]:
        own = {
            "keyint": str(self.gop) if self.gop else "-1",
            "min-keyint": "1",
            "scenecut": "0",
            "open-gop": "0",
            "repeat-headers": "0",
            "info": "0",
            "log-level": "error",
        }
        if width % WHOLE_ROWS:
            own["cutree"] = "0"
        if self.threads == 1:
            own |= {"pools": "none", "frame-threads": "1", "wpp": "0"}
        if self.bframes is not None:
            own["bframes"] = str(self.bframes)
        if self.refs is not None:
            own["ref"] = str(self.refs)
        return self._named() | {"x265-params": _joined(own | dict(self.extra))}

    def _svtav1(self) -> dict[str, str]:
        os.environ.setdefault("SVT_LOG", "1")  # errors only: it writes to stderr by itself
        own = {
            "keyint": str(self.gop) if self.gop else "-1",
            "irefresh-type": "2",  # closed
            "scd": "0",
            "lp": str(self.threads),
        }
        named = {"crf": f"{self.crf:g}"}
        if self.preset is not None:
            named["preset"] = self.preset
        if self.tune == "psnr":
            own["tune"] = "1"
        return named | {"svtav1-params": _joined(own | dict(self.extra))}

    def _ffv1(self) -> dict[str, str]:
        own = {"level": "3", "slices": "4", "slicecrc": "1", "coder": "range_def", "context": "0"}
        return own | dict(self.extra)

    def to_json(self) -> dict:
        return asdict(self) | {"extra": [list(pair) for pair in self.extra]}

    @classmethod
    def from_json(cls, data: dict) -> CodecSpec:
        """Raises :class:`StorageError` for unknown keys and impossible values."""
        unknown = set(data) - {field.name for field in fields(cls)}
        if unknown:
            raise StorageError(f"unknown keys {sorted(unknown)}", key="codec")
        return cls(**(data | {"extra": tuple(tuple(pair) for pair in data.get("extra", ()))}))


def _joined(parameters: dict[str, str]) -> str:
    return ":".join(f"{key}={value}" for key, value in parameters.items())

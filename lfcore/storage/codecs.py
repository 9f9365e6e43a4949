"""Codecs and their settings."""

import os
from dataclasses import asdict, dataclass
from numbers import Real

from lfcore.errors import StorageError, check_known, suggest_keywords
from lfcore.storage.layout import KINDS
from lfcore.storage.pixels import GREY_FORMATS, pixel_format

CODECS = {
    "libx264": ("yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le"),
    "libx265": ("yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le"),
    "libsvtav1": ("yuv420p", "yuv420p10le"),
    "ffv1": (
        "yuv420p",
        "yuv444p",
        "yuv420p10le",
        "yuv444p10le",
        "yuv420p12le",
        "yuv444p12le",
        "gbrp",
    ),
}
"""The supported encoders of FFmpeg, and the colour formats of each."""
GREY_CODECS = ("libx264", "ffv1")
"""The encoders that are also used for streams with one plane."""
LOSSLESS = ("ffv1",)
"""The lossless encoders."""
TRANSFERS = ("srgb", "pq")
"""The transfer functions from linear light to codes."""

WHOLE_ROWS = 128
"""The divisor, pixels, of frame widths with x264's macroblock tree and x265's "cutree".

At widths of 48, 64, 130, 144 and 200 pixels x264's streams differed between runs, at multiples of
128 never; at 16, 32 and 48 x265 damaged the heap (found with glibc's MALLOC_CHECK_=3).
"""
SMALLEST_FRAME = {"libx265": 66}
"""The side, pixels, of the smallest frame whose file is the same in each run.  x265 reads beyond
frames that are one coding tree block wide (64 pixels; 32 with its fastest presets): 10 runs on the
same 64 x 64 pixels gave 10 different files, some poor, and errors; from 66 pixels on none differed.
"""
RANGES = {
    "crf": (0, 63), "gop": (0, 1 << 20), "threads": (1, 64), "bframes": (0, 16), "refs": (1, 16),
}  # fmt: skip
"""The least and the greatest value of each number in :class:`Encoding`."""


@suggest_keywords
@dataclass(frozen=True)
class Encoding:
    """The settings with which a light field is stored as video.

    None stands for the best measured setting of the codec and number of views
    (:mod:`lfcore.storage.defaults`).

    Parameters
    ----------
    codec : str
        ``libx264`` (H.264), ``libx265`` (H.265), ``libsvtav1`` (AV1) or ``ffv1`` (lossless).
    pixel_format : str, optional
        The format of the stored frames, such as ``yuv444p`` or ``yuv420p10le``; with ``ffv1`` also
        ``gbrp``, which keeps 8-bit RGB exactly.
    crf : float, optional
        The constant rate factor, 0 to 63.  Lower means better and larger; ``ffv1`` ignores it.
    preset : str or int, optional
        The encoder's name for a compromise of speed and size.
    tune : str, optional
        ``psnr`` (default) switches off methods that please the eye but increase the error; None is
        the encoder's default.
    gop : int, optional
        Frames from one key frame to the next; 0 for one key frame per segment.
    bframes, refs : int, optional
        B-frames in a row and reference frames (H.264 and H.265).
    threads : int
        Threads of one encoder.  With 1 (default) the stream is reproducible.
    extra : tuple of (str, str)
        More parameters of the encoder, as (key, value).
    transfer : str, optional
        ``srgb``, which clips at white, or ``pq`` (SMPTE ST 2084), which needs 10 bits and does not
        clip; default ``pq`` if the traced scene may be brighter than white.
    layout : str, optional
        ``views`` (a frame holds one view) or ``macropixels`` (all lens samples of a pixel).
    depth : bool, optional
        Store the inverse depth of every ray as a second stream.

    Raises
    ------
    StorageError
        The encoder does not take these settings.

    Examples
    --------
    >>> exact = lfcore.Encoding("ffv1", depth=False)
    >>> lfcore.record(scene, "exact.mkv", views=2, pixels=16, encoding=exact).metadata.codec
    'ffv1'
    """

    codec: str = "libx264"
    pixel_format: str | None = None
    crf: float | None = None
    preset: str | None = None
    tune: str | None = "psnr"
    gop: int | None = None
    bframes: int | None = None
    refs: int | None = None
    threads: int = 1
    extra: tuple[tuple[str, str], ...] = ()
    transfer: str | None = None
    layout: str | None = None
    depth: bool | None = None

    def __post_init__(self) -> None:
        check_known(StorageError, "codec", self.codec, CODECS)
        if self.transfer is not None:
            check_known(StorageError, "transfer", self.transfer, TRANSFERS)
        if self.layout is not None:
            check_known(StorageError, "layout", self.layout, KINDS)
        if isinstance(self.preset, int) and not isinstance(self.preset, bool):
            object.__setattr__(self, "preset", str(self.preset))  # SVT-AV1's are numbers
        if not isinstance(self.preset, str | None):
            raise StorageError(f"must be a preset's name, not {self.preset!r}", key="preset")
        if self.pixel_format is not None:
            pixel_format(self.pixel_format)
            known = CODECS[self.codec]
            grey = tuple(GREY_FORMATS) if self.codec in GREY_CODECS else ()
            if self.pixel_format not in (*known, *grey):
                problem = f"{self.codec} does not take {self.pixel_format}"
                remedy = f"Use one of {', '.join(known)}"
                raise StorageError(problem, key="pixel_format", remedy=remedy)
        for key, (low, high) in RANGES.items():
            value = getattr(self, key)
            if value is not None and not (isinstance(value, Real) and low <= float(value) <= high):
                raise StorageError(f"must be from {low} to {high}, not {value!r}", key=key)

    @property
    def stored_format(self) -> str:
        """``pixel_format``; raises :class:`StorageError` if it is None."""
        if self.pixel_format is None:
            raise StorageError("is not chosen", key="pixel_format", remedy="Name one")
        return self.pixel_format

    @property
    def lossless(self) -> bool:
        return self.codec in LOSSLESS

    def check_frame(self, width: int, height: int) -> None:
        """Raise :class:`StorageError` for frames that are too small for reproducible files."""
        least = SMALLEST_FRAME.get(self.codec, 0)
        if min(width, height) < least:
            raise StorageError(
                f"{self.codec} is not reproducible in frames of {width} x {height} pixels",
                key="codec",
                remedy=f"Pack more elements per frame, so that it has {least} pixels per side "
                "or more, or use libx264",
            )

    def options(self, width: int) -> dict[str, str]:
        """Return the settings as FFmpeg's encoder options, for frames of ``width`` pixels."""
        if self.codec in ("libx264", "libx265"):
            return self._x26x(width)
        if self.codec == "libsvtav1":
            return self._svtav1()
        own = {"level": "3", "slices": "4", "slicecrc": "1", "coder": "range_def", "context": "0"}
        return own | dict(self.extra)

    def _named(self, **more: str | None) -> dict[str, str]:
        crf = None if self.crf is None else f"{self.crf:g}"
        named = {"crf": crf, "preset": self.preset, **more}
        return {key: value for key, value in named.items() if value is not None}

    def _x26x(self, width: int) -> dict[str, str]:
        # Segments are joined: their headers must be the same whatever the frames (stitchable),
        # and no frame may refer beyond its own segment (open-gop=0).
        is_x265 = self.codec == "libx265"
        endless = "-1" if is_x265 else "infinite"
        own = {"keyint": str(self.gop or endless), "min-keyint": "1", "scenecut": "0",
               "open-gop": "0"}  # fmt: skip
        if is_x265:
            own |= {"repeat-headers": "0", "info": "0", "log-level": "error"}
        else:
            own["stitchable"] = "1"
        if width % WHOLE_ROWS:
            own["cutree" if is_x265 else "mbtree"] = "0"
        if is_x265 and self.threads == 1:
            own |= {"pools": "none", "frame-threads": "1", "wpp": "0"}
        chosen = {"bframes": self.bframes, "ref": self.refs}
        own |= {key: str(value) for key, value in chosen.items() if value is not None}
        name = self.codec.removeprefix("lib")
        return self._named(tune=self.tune) | {f"{name}-params": _joined(own | dict(self.extra))}

    def _svtav1(self) -> dict[str, str]:
        os.environ.setdefault("SVT_LOG", "1")  # SVT-AV1 writes to stderr: errors only
        own = {
            "keyint": str(self.gop) if self.gop else "-1",
            "irefresh-type": "2",  # closed groups of pictures
            "scd": "0",
            "lp": str(self.threads),
        }
        if self.tune == "psnr":
            own["tune"] = "1"
        return self._named() | {"svtav1-params": _joined(own | dict(self.extra))}

    def to_json(self) -> dict:
        """Return the encoder's settings as light field files record them."""
        data = asdict(self) | {"extra": [list(pair) for pair in self.extra]}
        return {
            key: value for key, value in data.items() if key not in ("transfer", "layout", "depth")
        }


def _joined(parameters: dict[str, str]) -> str:
    return ":".join(f"{key}={value}" for key, value in parameters.items())

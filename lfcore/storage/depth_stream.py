"""The stream of inverse depths: its codes, and its description in a light field file.

Slicing by depth (:mod:`lfcore.refocus.depth_slicing`) spreads a ray on a plane over
``|delta' - 1 / z|`` times its part of the lens.  This sweep is linear in inverse depth, so codes
are equal steps of inverse depth: a quarter of a pixel of the sweep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from lfcore.errors import StorageError, check_known
from lfcore.optics.ray_cells import ViewSet, views_of
from lfcore.optics.slab import Slab
from lfcore.storage.codecs import LOSSLESS, Encoding
from lfcore.storage.defaults import HUGE, KEY_EVERY, NO_LOOKAHEAD, WHOLE_PIXELS, WIDE
from lfcore.storage.pixels import GREY_FORMATS, PixelFormat

SWEEP_PX = 0.25
"""The step of depth codes: the sweep of a view's part of the lens, in pixels of a view."""
PRESENT = 0.75
"""The share of codes that are depths where the last code means none: lossy codecs ring between."""
LATTICES = ("plain", "crossed")
"""The file format's names of plain and of displaced views."""
FINEST_CRF = 0.0
"""The lowest rate factor of depths."""
COARSEST_CRF = 40.0
"""The highest rate factor of depths."""
WIDE_DEPTH_CRF = 8.8
"""The counterpart of :data:`lfcore.storage.defaults.WIDE_CRF` for depths."""


@dataclass(frozen=True)
class DepthCodes:
    """Codes of inverse depth: equal steps from ``far`` (code 0) to ``near`` (the last), 1/m.

    Codes from ``absent`` on, if any, mean that a ray has no such depth.
    """

    far: float
    near: float
    pixel_format: str = "gray"
    absent: int | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.far < self.near < math.inf:
            raise StorageError(f"{[self.far, self.near]} is no range", key="depth.dioptres")
        check_known(StorageError, "depth.pixel_format", self.pixel_format, GREY_FORMATS)
        if self.absent is not None and not (
            type(self.absent) is int and 0 < self.absent <= self.last
        ):
            raise StorageError(f"{self.absent!r} is no code", key="depth.absent")

    @classmethod
    def of_range(cls, slab: Slab, far: float, near: float, *, gaps: bool = False) -> DepthCodes:
        """Codes with steps of :data:`SWEEP_PX` for a slab's views, in 8 or, if needed, 10 bits.

        With ``gaps``, the last codes mean that there is no depth.
        """
        step = sweep_step(slab)
        near = max(near, far + step)  # for a scene with one depth
        if gaps:
            near = far + (near - far) / PRESENT
        codes = cls(far, near, "gray" if near - far <= 255 * step else "gray10le")
        # Half way between the depths and the last code, which stands for none.
        return replace(codes, absent=round(codes.last * (1 + PRESENT) / 2)) if gaps else codes

    @property
    def format(self) -> PixelFormat:
        return GREY_FORMATS[self.pixel_format]

    @property
    def last(self) -> int:
        return (1 << self.format.bits) - 1

    def of_depth(self, depth: np.ndarray) -> np.ndarray:
        """Convert depths, metres, to codes; infinity is a miss, 0 no depth, and depths beyond the
        range are clipped to its ends."""
        with np.errstate(divide="ignore"):
            share = (1.0 / np.asarray(depth, np.float64) - self.far) / (self.near - self.far)
        return np.rint(np.clip(share, 0, 1) * self.last).astype(self.format.dtype)

    def depth(self, codes: np.ndarray) -> np.ndarray:
        """Convert codes to float32 metres; 0 dioptres is infinity, 0 metres no depth."""
        return self.table[codes]

    @cached_property
    def table(self) -> np.ndarray:
        """The float32 metres of every code."""
        inverse = self.far + np.arange(self.last + 1) * ((self.near - self.far) / self.last)
        with np.errstate(divide="ignore", over="ignore"):
            metres = (1.0 / inverse).astype(np.float32)
        metres[self.last + 1 if self.absent is None else self.absent :] = 0
        return metres

    def spec(self, slab: Slab, *, lossless: bool = False) -> Encoding:
        """Return FFV1, or H.264 with quantisers whose error, half a step, is :data:`SWEEP_PX`.

        A step is 1 code at quantiser 4 for 8 bits and doubles every 6.  Finer steps did not improve
        pictures, coarser ones made them worse (docs/decisions.md).
        """
        if lossless:
            return Encoding(LOSSLESS[0], self.pixel_format, preset=None, tune=None, gop=KEY_EVERY)
        step = 2 * sweep_step(slab) / (self.near - self.far) * 255
        crf = min(max(4 + 6 * math.log2(step), FINEST_CRF), COARSEST_CRF)
        own: dict[str, Any] = {"bframes": 8}
        if slab.size.width > WIDE:
            crf += WIDE_DEPTH_CRF
            motion = WHOLE_PIXELS if slab.size.width > HUGE else ()
            own = {
                "bframes": 0, "refs": 1, "extra": (*NO_LOOKAHEAD, ("trellis", "0"), *motion),
            }  # fmt: skip
        return Encoding(
            pixel_format=self.pixel_format, crf=round(crf, 1), preset="medium", gop=KEY_EVERY, **own
        )


@dataclass(frozen=True)
class StoredSpecular:
    """The metadata of specular light, a stream of colours, and of its virtual depths.

    Attributes
    ----------
    depth : StoredDepth
        The virtual depths, absent where a ray has no specular light.
    codec, header_crc32, settings, segments
        Of the stream of colours, as for depths.
    """

    depth: StoredDepth
    codec: str
    header_crc32: int
    settings: dict
    segments: tuple[tuple[int, int], ...]

    def to_json(self) -> dict[str, Any]:
        return vars(self) | {
            "depth": self.depth.to_json(), "segments": [list(part) for part in self.segments],
        }  # fmt: skip

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> StoredSpecular:
        """Raises :class:`StorageError` or an exception of Python's for impossible values."""
        if set(data) != {"depth", "codec", "header_crc32", "settings", "segments"}:
            raise StorageError(f"has the keys {sorted(data)}", key="specular")
        depth = StoredDepth.from_json(data["depth"])
        colours = StoredDepth.from_json(
            data["depth"] | {key: value for key, value in data.items() if key != "depth"}
        )
        if depth.codes.absent is None:
            raise StorageError("is missing", key="specular.depth.absent")
        return cls(depth, colours.codec, colours.header_crc32, colours.settings, colours.segments)


def sweep_step(slab: Slab) -> float:
    """Return the change of inverse depth, 1/m, that changes a view's sweep by :data:`SWEEP_PX`."""
    return SWEEP_PX * slab.pixel_pitch / slab.lens_pitch_m


@dataclass(frozen=True)
class StoredDepth:
    """The metadata of the depth stream.

    Attributes
    ----------
    codes : DepthCodes
        The meaning of its samples.
    displaced : bool
        Whether each view is displaced within a pixel against all others.
    pixels : int
        The longer side of the pictures that the file was recorded for.
    codec, header_crc32, settings
        As for the stream of colours.
    segments : tuple
        Bytes and CRC-32 of each segment; its frames are those of the colours' segment.
    """

    codes: DepthCodes
    displaced: bool
    pixels: int
    codec: str
    header_crc32: int
    settings: dict
    segments: tuple[tuple[int, int], ...]

    def __post_init__(self) -> None:
        if not (type(self.pixels) is int and 1 <= self.pixels <= 65536):
            raise StorageError(f"cannot be {self.pixels!r}", key="depth.pixels")

    def views(self, slab: Slab) -> ViewSet:
        """The views of the file's slab, plain or displaced."""
        return views_of(slab, displaced=self.displaced)

    def to_json(self) -> dict[str, Any]:
        return {
            "dioptres": [self.codes.far, self.codes.near],
            **({} if self.codes.absent is None else {"absent": self.codes.absent}),
            "pixel_format": self.codes.pixel_format,
            "lattice": LATTICES[self.displaced],
            "pixels": self.pixels,
            "codec": self.codec,
            "header_crc32": self.header_crc32,
            "settings": self.settings,
            "segments": [list(part) for part in self.segments],
        }

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> StoredDepth:
        """Raises :class:`StorageError` or an exception of Python's for impossible values."""
        if set(data) - {"absent"} != set(KEYS):
            raise StorageError(f"must have exactly the keys {sorted(KEYS)}", key="depth")
        for key, kind in (("codec", str), ("header_crc32", int), ("settings", dict)):
            if type(data[key]) is not kind:
                raise StorageError(f"cannot be {data[key]!r}", key=f"depth.{key}")
        check_known(StorageError, "depth.lattice", data["lattice"], LATTICES)
        far, near = data["dioptres"]
        segments = tuple((size, crc) for size, crc in data["segments"])
        if not all(type(n) is int and 0 <= n < 1 << 63 for part in segments for n in part):
            raise StorageError("must be two whole numbers each", key="depth.segments")
        displaced = data["lattice"] == LATTICES[True]
        return cls(
            DepthCodes(float(far), float(near), data["pixel_format"], data.get("absent")),
            displaced, data["pixels"], data["codec"], data["header_crc32"], data["settings"],
            segments,
        )  # fmt: skip


KEYS = (
    "dioptres", "pixel_format", "lattice", "pixels", "codec", "header_crc32", "settings",
    "segments",
)  # fmt: skip

"""The metadata of a light field file: geometry, layout, colour, and an index of its segments.

They are JSON in the Matroska tag ``LIGHTFIELD`` before the video, with a digest; programs that copy
streams keep the tag.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import LfcoreError, StorageError, check_known
from lfcore.optics.array import CameraArray
from lfcore.optics.slab import Slab
from lfcore.storage.depth_stream import StoredDepth, StoredSpecular
from lfcore.storage.index import BYTES, CRC32, FIRST, FRAMES, SegmentIndex
from lfcore.storage.instants import Instants
from lfcore.storage.layout import FrameLayout

TAG = "LIGHTFIELD"
"""The name of the Matroska tag."""
SQUARE = 1
"""The version of files whose frames have squares."""
VERSION = 2
"""The version of files whose frames have wide pictures."""
FILM = 3
"""The version of files of several instants."""
TWO_PARTS = 4
"""The version of files with specular light apart."""
GEOMETRIES = ("slab", "array")
"""The kinds of geometry."""
COLOUR = {
    "transfer": "sRGB, IEC 61966-2-1",
    "primaries": "BT.709",
    "matrix": "BT.709",
    "range": "limited",
    "chroma_location": "centre of 2 x 2 pixels for 4:2:0",
}
PQ = {"transfer": "PQ, SMPTE ST 2084; layout.peak is the linear light of the brightest code"}
COLOUR_RGB = COLOUR | {"matrix": "none, RGB", "range": "full", "chroma_location": "none"}
OPTIONAL_KEYS = {"content", "depth", "film", "specular"}
TYPES: dict[str, type] = {
    "software": str, "geometry": str, "slab": dict, "array": dict, "layout": dict, "colour": dict,
    "codec": str, "header_crc32": int, "settings": dict, "scene": dict, "segments": list,
    "content": dict, "depth": dict, "film": dict, "specular": dict,
}  # fmt: skip
KEYS = {"version", *TYPES} - OPTIONAL_KEYS
_NAMES = {str: "text", dict: "an object", int: "a whole number", list: "a list"}


@dataclass(frozen=True)
class Metadata:
    """Everything but the frames; the page on the file format explains all keys.

    Attributes
    ----------
    slab : Slab or None
        The geometry, unless it is an array.
    array : dict or None
        :meth:`CameraArray.to_json`, and ``white``, the linear light of the brightest code.
    layout : FrameLayout
        The positions of rays in frames.
    codec, settings : str, dict
        The codec of the video stream, e.g. ``h264``, and the encoder's settings.
    header_crc32 : int
        The check sum of the codec's global header.
    scene : dict
        At least ``name`` and ``digest``.
    segments : SegmentIndex
        The frames of each tile.
    software : str
        The program that wrote the file.
    content : dict
        Facts beside the rays.
    depth : StoredDepth, optional
        The stream of inverse depths.
    film : Instants, optional
        The instants of a film; ``segments`` has the tiles of each of its groups.
    specular : StoredSpecular, optional
        The streams of specular light, which the other colours lack, and of its virtual depths.
    """

    slab: Slab | None
    array: dict | None
    layout: FrameLayout
    codec: str
    header_crc32: int
    settings: dict
    scene: dict
    segments: SegmentIndex
    software: str
    content: dict = field(default_factory=dict)
    depth: StoredDepth | None = None
    film: Instants | None = None
    specular: StoredSpecular | None = None

    @property
    def streams(self) -> list[Metadata]:
        """The metadata of each video stream, in the file's order."""
        specular = self.of_specular().streams if self.specular else []
        return [self, *([self.of_depth()] if self.depth else []), *specular]

    @property
    def camera_array(self) -> CameraArray | None:
        """The camera array of an ``array`` geometry; :class:`OpticsError` if it is invalid."""
        return CameraArray.from_json(self.array) if self.array is not None else None

    def of_depth(self) -> Metadata:
        """Return the metadata of the stream of depths; its layout is that of colours."""
        depth = self.depth
        if depth is None:
            raise StorageError("has no depth", key="depth")
        layout = replace(self.layout, pixel_format=depth.codes.pixel_format, peak=None)
        return self._of_stream(depth, layout, depth=None)

    def of_specular(self) -> Metadata:
        """Return the metadata of the specular light and its depths, as of a file of its own."""
        if self.specular is None:
            raise StorageError("has no specular part", key="specular")
        return self._of_stream(self.specular, self.layout, depth=self.specular.depth)

    def _of_stream(
        self, stream: StoredDepth | StoredSpecular, layout: FrameLayout, **changes: Any
    ) -> Metadata:
        numbers = self.segments.numbers.copy()
        numbers[:, [BYTES, CRC32]] = stream.segments
        return replace(
            self,
            layout=layout,
            codec=stream.codec,
            header_crc32=stream.header_crc32,
            settings=stream.settings,
            segments=SegmentIndex(layout, numbers),
            specular=None,
            **changes,
        )

    @property
    def white(self) -> float:
        return float((self.array or {}).get("white", 1.0))

    @property
    def version(self) -> int:
        """The least version of the format that has what the file has."""
        if self.specular:
            return TWO_PARTS
        return FILM if self.film else VERSION if self.layout.picture else SQUARE

    def to_text(self) -> str:
        """Return JSON with a digest."""
        data = {
            "version": self.version,
            "software": self.software,
            "geometry": "array" if self.slab is None else "slab",
            "slab": self.slab.to_json() if self.slab else None,
            "array": self.array,
            "layout": self.layout.to_json(),
            "colour": (COLOUR_RGB if self.layout.format.rgb else COLOUR)
            | (PQ if self.layout.peak else {}),
            "codec": self.codec,
            "header_crc32": self.header_crc32,
            "settings": self.settings,
            "scene": self.scene,
            "segments": self.segments.to_json(),
        }
        if self.content:
            data["content"] = self.content
        if self.depth:
            data["depth"] = self.depth.to_json()
        if self.film:
            data["film"] = self.film.to_json()
        if self.specular:
            data["specular"] = self.specular.to_json()
        return _canonical(data | {"digest": _digest(data)})

    @classmethod
    def from_text(cls, text: str, file: Path) -> Metadata:
        """Raises :class:`StorageError` if the text is damaged, too new, or contradicts itself."""
        try:
            data = json.loads(text)
            whole = data.pop("digest") == _digest(data)
        # RecursionError: text that nests deeper than Python's stack is not ours.
        except (ValueError, KeyError, AttributeError, TypeError, RecursionError):
            whole = False
        if not whole:
            problem = f"the metadata (tag {TAG}) are damaged, so that nothing can be read"
            remedy = "Join the segments again, or take a copy of the file"
            raise StorageError(problem, file=file, remedy=remedy)
        if (version := data.get("version")) not in (SQUARE, VERSION, FILM, TWO_PARTS):
            problem = f"has metadata of version {version}; only {SQUARE} to {TWO_PARTS} can be read"
            remedy = "Use the program that wrote it, or a later one"
            raise StorageError(problem, file=file, remedy=remedy)
        if set(data) - OPTIONAL_KEYS != KEYS:
            odd = (set(data) - OPTIONAL_KEYS) ^ KEYS
            raise StorageError(f"has unknown or missing metadata: {sorted(odd)}", file=file)
        try:
            return cls._from_json(data)
        except StorageError as error:
            raise error.named(StorageError, file=file) from error
        except (
            LfcoreError, LookupError, TypeError, ValueError, AttributeError, ArithmeticError,
        ) as error:  # fmt: skip
            raise StorageError(f"has invalid metadata: {error}", file=file) from error

    @classmethod
    def _from_json(cls, data: dict[str, Any]) -> Metadata:
        for key, kind in TYPES.items():
            absent = key in GEOMETRIES and data[key] is None
            if not isinstance(data.get(key, kind()), kind) and not absent:
                raise StorageError(f"must be {_NAMES[kind]}, not {data[key]!r}", key=key)
        layout = FrameLayout.from_json(data["layout"])
        segments = SegmentIndex.from_json(layout, data["segments"])
        check_known(StorageError, "geometry", data["geometry"], GEOMETRIES)
        lacking = [key for key in GEOMETRIES if (data[key] is None) == (key == data["geometry"])]
        if lacking:
            raise StorageError(f"is {data['geometry']}, which lacks its data", key="geometry")
        slab = Slab.from_json(data["slab"]) if data["slab"] is not None else None
        metadata = cls(
            slab, data["array"], layout, data["codec"], data["header_crc32"],
            data["settings"], data["scene"], segments, data["software"],
            data.get("content", {}),
            StoredDepth.from_json(data["depth"]) if "depth" in data else None,
            Instants.from_json(data["film"]) if "film" in data else None,
            StoredSpecular.from_json(data["specular"]) if "specular" in data else None,
        )  # fmt: skip
        metadata.check()
        return metadata

    def instant(self, number: int) -> Metadata:
        """The metadata of one instant of a film, as of a file that has no other."""
        film = self.film
        if film is None or not 0 <= number < len(film.times):
            raise StorageError(f"there is no instant {number}", key="film")
        counts = film.counts
        group, tiles = number // film.group, len(self.segments) // len(counts)
        rows = slice(group * tiles, (group + 1) * tiles)
        numbers = self.segments.numbers[rows].copy()
        numbers[:, FRAMES] //= counts[group]
        numbers[:, FIRST] = np.cumsum(numbers[:, FRAMES]) - numbers[:, FRAMES]
        depth = self.depth and replace(self.depth, segments=self.depth.segments[rows])
        specular = self.specular and replace(
            self.specular, segments=self.specular.segments[rows],
            depth=replace(self.specular.depth, segments=self.specular.depth.segments[rows]),
        )  # fmt: skip
        return replace(
            self, segments=SegmentIndex(self.layout, numbers), depth=depth, film=None,
            specular=specular, content=self.content | film.content[number],
        )  # fmt: skip

    def _check_film(self, film: Instants) -> None:
        counts, numbers = film.counts, self.segments.numbers
        tiles, rest = divmod(len(numbers), len(counts))
        first = np.cumsum(numbers[:, FRAMES]) - numbers[:, FRAMES]
        if rest or not tiles or (numbers[:, FRAMES] % np.repeat(counts, tiles)).any():
            raise StorageError(f"do not fit {len(counts)} groups of instants", key="segments")
        if (numbers[:, FIRST] != first).any():
            raise StorageError("are not one after another", key="segments")
        for group in range(len(counts)):
            self.instant(group * film.group).check()

    def check(self) -> None:
        """Raise :class:`StorageError` if the parts contradict one another."""
        slab, array, layout = self.slab, self.camera_array, self.layout
        n, m = layout.views, layout.pixels
        if slab and (slab.views, slab.pixels) != (n, m):
            raise StorageError(
                f"the slab has {slab.views} views and {slab.pixels} pixels per side, the layout "
                f"{n} and {m}", key="layout",
            )  # fmt: skip
        if array and (array.cameras, array.tile) != ((n, n), (m, m)):
            raise StorageError(
                f"the array has {array.cameras} cameras of {array.tile} pixels, the layout {n} and "
                f"{m} per side", key="layout",
            )  # fmt: skip
        if not (self.white > 0 and math.isfinite(self.white)):
            problem = f"white must be positive and finite, not {self.white}"
            raise StorageError(problem, key="array")
        if not all(isinstance(self.scene.get(key), str) for key in ("name", "digest")):
            raise StorageError("the scene lacks name or digest", key="scene")
        if layout.picture and (slab is None or slab.size != layout.size):
            raise StorageError("has pictures of another size than the slab's", key="layout")
        whole = slab is None or bool(slab.views_held().all())
        same = slab is None or slab.size == layout.size
        if layout.kind != "views" and not (whole and same):
            raise StorageError("must be views for a part of the grids", key="layout")
        if layout.format.grey:
            raise StorageError(f"{layout.pixel_format} has no colours", key="layout")
        for content in (self.content, *(self.film.content if self.film else ())):
            _check_content(content)
        if self.film:
            self._check_film(self.film)
        else:
            by_views = slab if layout.kind == "views" else None
            self.segments.check(by_views.held.views if by_views else None)
        if self.depth and not (slab and whole and same):
            raise StorageError("belongs to a slab with all views", key="depth")
        if self.specular and not self.depth:
            raise StorageError("needs depths", key="specular")
        streams = {"depth": self.depth, "specular": self.specular}
        streams |= {"specular.depth": self.specular.depth} if self.specular else {}
        for key, stream in streams.items():
            if stream and len(stream.segments) != len(self.segments):
                raise StorageError("must have a segment for each of the colours'", key=key)


def _check_content(content: dict) -> None:
    for key in ("depth_m", "seen_m", "ends_m"):
        ends = content.get(key) if isinstance(content, dict) else ()
        if ends is not None and not (len(ends) == 2 and 0 < ends[0] <= ends[1] < math.inf):
            raise StorageError(f"{key} {ends} is no range of depths", key="content")


def _canonical(data: dict) -> str:
    return json.dumps(data, sort_keys=True, separators=(",", ":"), ensure_ascii=True)


def _digest(data: dict) -> str:
    return hashlib.sha256(_canonical(data).encode()).hexdigest()

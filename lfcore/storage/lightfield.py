"""An open light field file: geometry, and rays as views, macropixels and rectangles.

The file alone is enough: geometry, layout and an index of segments are in its metadata.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from lfcore.colour import srgb_codes
from lfcore.errors import StorageError, suggest_keywords
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Ends
from lfcore.progress import Progress
from lfcore.storage.blocks import read_block
from lfcore.storage.codecs import Encoding
from lfcore.storage.file_geometry import FileGeometry
from lfcore.storage.from_views import store_arrays
from lfcore.storage.index import FIRST, Segment
from lfcore.storage.instant_video import GroupedVideo, InstantVideo
from lfcore.storage.integrity import (
    Damage,
    damage_error,
    find_damage,
    read_metadata,
    segment_damage,
)
from lfcore.storage.metadata import Metadata
from lfcore.storage.remote import located
from lfcore.storage.stored_video import StoredVideo

if TYPE_CHECKING:
    from lfcore.scene.model import Scene


class LightFieldFile(FileGeometry):
    """An open light field file: its geometry, and its rays as views and macropixels.

    Attributes
    ----------
    whole : Metadata
        The metadata of all instants.
    video, depth_video : StoredVideo
        The streams of colours and of inverse depths; the latter is None in a file without depth.
    damage : list of Damage
        Segments that cannot be read.  Only a file opened with ``salvage`` has any; else damage
        raises an error.
    instant : int
        The number of the instant that this is, 0 in a file of one; :meth:`at` gives the others.
    """

    def __init__(
        self, path: Path, metadata: Metadata, keys: list[int], *, threads: int, salvage: bool
    ):
        self.path, self.whole, self._salvage = path, metadata, salvage
        self._file_damage: list[Damage] = []
        tiles = len(metadata.segments) // (len(metadata.film.counts) if metadata.film else 1)
        self._videos = [
            GroupedVideo(path, stream, keys, threads, track, tiles=tiles)
            for track, stream in enumerate(metadata.streams)
        ]
        self._show(0)

    @classmethod
    def _of(cls, field: LightFieldFile) -> Self:
        """Another object of the same open file at the same instant, without what is cached."""
        other = cls.__new__(cls)
        other.path, other.whole, other._salvage = field.path, field.whole, field._salvage
        other._file_damage, other._videos = field._file_damage, field._videos
        other._show(field.instant)
        return other

    def _show(self, instant: int) -> None:
        """Give this object an instant."""
        self.instant, self.metadata, self.damage = instant, self.whole, self._file_damage
        streams: Sequence[StoredVideo] = self._videos
        film = self.whole.film
        if film:
            group, place = divmod(instant, film.group)
            self.metadata = self.whole.instant(instant)
            streams = [
                InstantVideo(whole, stream, group, place, film.counts[group])
                for whole, stream in zip(self._videos, self.metadata.streams, strict=True)
            ]
            parts = self.metadata.segments
            first = group * len(parts)
            self.damage = [
                Damage(parts[each.segment.index - first], each.reason)
                for each in self._file_damage
                if first <= each.segment.index < first + len(parts)
            ]
        self.video: StoredVideo = streams[0]
        self.depth_video: StoredVideo | None = streams[1] if len(streams) > 1 else None
        self._specular_videos = tuple(streams[2:])

    @property
    def specular(self) -> LightFieldFile | None:
        """The specular light with its virtual depths, which :attr:`video` lacks, as a file of its
        own; None in a file without."""
        if not self._specular_videos:
            return None
        part = LightFieldFile._of(self)
        part.metadata, part._specular_videos = self.metadata.of_specular(), ()
        part.video, part.depth_video = self._specular_videos
        return part

    @property
    def times(self) -> tuple[float, ...]:
        """The instants of the file, seconds; 0 of a file of one."""
        return self.whole.film.times if self.whole.film else (0.0,)

    def at(self, instant: int) -> Self:
        """The light field of an instant of a film.

        Instants share the file and what is decoded of it: read them in order.

        Parameters
        ----------
        instant : int
            Its number, from 0; -1 is the last.

        Raises
        ------
        StorageError
            The file has no such instant.
        """
        total = len(self.times)
        if not -total <= instant < total:
            problem = f"has no instant {instant}; it has 0 to {total - 1}"
            raise StorageError(problem, file=self.path, key="instant")
        other = self._of(self)
        other._show(instant % total)
        return other

    @classmethod
    @suggest_keywords
    def open(cls, path: str | Path, *, salvage: bool = False, threads: int = 1) -> Self:
        """Open a light field file.

        Parameters
        ----------
        path : str or Path
            A file, or a URL of http, https, s3 or gs, of which only the ranges that are read are
            fetched.
        salvage : bool
            Open a damaged file for its whole segments: all are checked, and ``damage`` lists those
            that cannot be read.
        threads : int
            Threads of a decoder.

        Returns
        -------
        LightField
            The file, opened.

        Raises
        ------
        StorageError
            The file is missing, foreign, cut short, damaged outside the video, lacks segments or
            contradicts itself; the error names damaged and readable segments.
        """
        path = located(path)
        metadata, keys = read_metadata(path)
        field = cls(path, metadata, keys, threads=threads, salvage=salvage)
        index = metadata.segments
        if salvage or not np.isin(index.numbers[:, FIRST], keys).all():
            field._file_damage = find_damage(field._videos)
            field._show(0)
        if field._file_damage and not salvage:
            raise damage_error(path, len(index), field._file_damage)
        return field

    @classmethod
    @suggest_keywords
    def from_views(
        cls,
        views: np.ndarray,
        geometry: Camera | CameraArray | float,
        path: str | Path,
        *,
        encoding: Encoding | None = None,
        scene: Scene | None = None,
        name: str | None = None,
        white: float | None = None,
        progress: Progress | None = None,
    ) -> Self:
        """Store views as a light field file.

        Parameters
        ----------
        views : ndarray
            (rows, columns, height, width, 3): floats are linear light, uint8 and uint16 sRGB codes.
            Row 0 is the top camera, column 0 the leftmost.  With a :class:`CameraArray` also the
            mosaic that :func:`lfcore.trace_array` returns.
        geometry : Camera, CameraArray or float
            The lens whose samples are the views; parallel cameras; or, if nothing else is known,
            the metres between neighbouring views: then refocus by disparity.
        path : str or Path
            The file to write, ``.mkv``.
        encoding : Encoding, optional
            How the views are stored; with ``ffv1``, uint8 codes are kept exactly.
        scene : Scene, optional
            The scene that the views show, for :meth:`depth` and exports with depth.
        name : str, optional
            Default: the scene's, else the file's.
        white : float, optional
            The light of the brightest code, for a :class:`CameraArray`; brighter light is clipped.
            Default: the views' maximum, and at least 1.
        progress : callable, optional
            Called with (views done, total).

        Returns
        -------
        LightField
            The file, opened.

        Raises
        ------
        OpticsError
            Views of another shape, or light that the file cannot store.
        StorageError
            The codec does not take the settings, or the file cannot be written.
        """
        store_arrays(
            Path(path), views, geometry, encoding, scene=scene, name=name, white=white,
            progress=progress,
        )  # fmt: skip
        return cls.open(path)

    def __repr__(self) -> str:
        (columns, rows), (width, height) = self.grid, self.picture_size
        size = f"{columns} x {rows} views of {width} x {height}"
        depth = ", with depth" if self.metadata.depth else ""
        if self.whole.film:
            depth += f", instant {self.instant} of {len(self.times)}"
        return f"<{type(self).__name__} {str(self.path)!r}: {size}{depth}>"

    def __reduce__(self) -> tuple:
        """Pickle by path: unpickling opens the file again."""
        path = self.path.absolute() if isinstance(self.path, Path) else self.path
        how: dict[str, Any] = {"salvage": self._salvage, "threads": self.video.threads}
        return partial(_opened, type(self), self.instant, **how), (str(path),)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; it is opened again when it is read again."""
        for stream in self._videos:
            stream.close()

    @property
    def segments(self) -> Sequence[Segment]:
        """The segments that can be read, as far as is known."""
        if not self.damage:
            return self.metadata.segments
        damaged = {damage.segment.index for damage in self.damage}
        return tuple(part for part in self.metadata.segments if part.index not in damaged)

    def verify(self, progress: Progress | None = None) -> None:
        """Check every segment, of colours and of depths, at all instants.

        ``progress`` is called with (segments done, total).  Raises :class:`StorageError` that
        names all damaged segments and what can still be read.
        """
        total = len(self.whole.segments)
        damage: list[Damage] = []
        for part in self.whole.segments:
            damage += segment_damage(self._videos, part)
            if progress:
                progress(part.index + 1, total)
        if damage:
            raise damage_error(self.path, total, damage)

    def require_depth_video(self) -> StoredVideo:
        """The stream of depths; raises :class:`OpticsError` in a file without one."""
        self.require_depth()
        assert self.depth_video is not None
        return self.depth_video

    def macropixel(self, u: int, v: int, *, codes: bool = False) -> np.ndarray:
        """Read the rays of one pixel through all lens samples.

        ``u`` is the column, ``v`` the row.  Returns (N, N, 3), indexed [j, i]; otherwise as
        :meth:`rectangle`.
        """
        return self.rectangle(u, v, u + 1, v + 1, codes=codes)[0, 0]

    def view(self, i: int, j: int, *, codes: bool = False) -> np.ndarray:
        """Read the picture from one lens sample.

        ``i`` is the column, ``j`` the row.  Returns (M, M, 3), indexed [v, u]; otherwise as
        :meth:`views`.
        """
        return self.views(i, j, i + 1, j + 1, codes=codes)[0, 0]

    def views(self, i0: int, j0: int, i1: int, j1: int, *, codes: bool = False) -> np.ndarray:
        """Read a rectangle of views.

        Parameters
        ----------
        i0, j0, i1, j1 : int
            First column and row, and the column and row after the last.
        codes : bool
            Return sRGB codes, with light above white clipped, instead of linear light.

        Returns
        -------
        ndarray
            (j1 - j0, i1 - i0, M, M, 3), indexed [j, i, v, u]: float32 linear light, or uint8 codes.
            M is ``slab.size``, the recorded pixels: of a file with depth, twice those of its
            pictures and of :meth:`lfcore.LightField.depth`, ``made_views.size``, by default.

        Raises
        ------
        StorageError
            The file does not hold these views, or is damaged.
        """
        *_, width, height = self.extent.pixels
        return self.block((i0, j0, i1, j1), (0, 0, width, height), codes=codes)

    def rectangle(self, u0: int, v0: int, u1: int, v1: int, *, codes: bool = False) -> np.ndarray:
        """Read the rays of a rectangle of pixels, through all lens samples.

        Parameters
        ----------
        u0, v0, u1, v1, codes
            As of :meth:`views`.

        Returns
        -------
        ndarray
            (v1 - v0, u1 - u0, N, N, 3), indexed [v, u, j, i]: float32 linear light, or uint8 codes.
            Damaged segments are black if the file was opened to salvage.

        Raises
        ------
        StorageError
            The file does not hold these pixels, or is damaged.
        """
        *_, columns, rows = self.extent.views
        rays = self.block((0, 0, columns, rows), (u0, v0, u1, v1), codes=codes)
        return np.ascontiguousarray(rays.transpose(2, 3, 0, 1, 4))

    def block(self, lens: Ends, film: Ends, *, codes: bool = False) -> np.ndarray:
        """Read the rectangle of pixels ``film`` of a rectangle of views, as :meth:`views` does.

        Both are (first column, first row, column after the last, row after the last).
        """
        moved = []
        held_views, held_pixels = self.extent.views, (*self.corner, *self.picture_size)
        for rectangle, (column, row, columns, rows) in ((lens, held_views), (film, held_pixels)):
            a, b, c, d = rectangle
            if not (0 <= a < c <= columns and 0 <= b < d <= rows):
                problem = (
                    f"columns {a} to {c - 1} and rows {b} to {d - 1} are not all there: columns "
                    f"are 0 to {columns - 1}, rows 0 to {rows - 1}"
                )
                raise StorageError(problem, file=self.path)
            moved.append((a + column, b + row, c + column, d + row))
        if self.layout.kind == "views":
            return self._rays(*moved, codes=codes)
        return self._rays(*moved[::-1], codes=codes).transpose(2, 3, 0, 1, 4)

    def _rays(self, outer: Ends, inner: Ends, *, codes: bool) -> np.ndarray:
        damaged = {damage.segment.index for damage in self.damage}
        if self._specular_videos:
            own, shown = (
                read_block(video, outer, inner, codes=False, damaged=damaged)
                for video in (self.video, self._specular_videos[0])
            )
            return srgb_codes(own + shown) if codes else own + shown
        rays = read_block(self.video, outer, inner, codes=codes, damaged=damaged)
        return rays if codes or self.white == 1.0 else rays * np.float32(self.white)


def _opened(kind: type[LightFieldFile], instant: int, path: str, **how: Any) -> LightFieldFile:
    """Open an instant of a file again, for unpickling."""
    return kind.open(path, **how).at(instant)

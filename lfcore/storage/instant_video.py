"""One instant of a film's streams, decoded with the group that it is in."""

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np

from lfcore.storage.metadata import Metadata
from lfcore.storage.stored_video import StoredVideo

MOST_HELD = 1 << 30
"""The most bytes of a group's decoded frames that are kept for the next instant."""


class GroupedVideo(StoredVideo):
    """A stream of a film: each segment has a tile at all instants of a group."""

    def __init__(self, *arguments: Any, tiles: int):
        super().__init__(*arguments)
        self._tiles, self._lock = tiles, threading.Lock()
        self._held: dict[int, list[list[np.ndarray]]] = {}

    def of_instant(self, segment: int, place: int, count: int) -> Iterator[list[np.ndarray]]:
        """Yield the planes (h, w) of a tile's frames at the instant ``place`` of ``count``.

        The group's frames are kept until another group is read, if memory allows, also when the
        file is closed in between.
        """
        frames = self.segments[segment].frames
        if frames * self.layout.frame_bytes > MOST_HELD:
            for number, planes in enumerate(self.planes(segment)):
                if number % count == place:
                    yield planes
            return
        with self._lock:
            if segment not in self._held:
                of_group = segment // self._tiles
                for other in [each for each in self._held if each // self._tiles != of_group]:
                    del self._held[other]
                decoded = [[plane.copy() for plane in planes] for planes in self.planes(segment)]
                self._held[segment] = decoded
            decoded = self._held[segment]
        yield from decoded[place::count]


class InstantVideo(StoredVideo):
    """A stream of a film at one instant: the segments of a file of that instant alone.

    Parameters
    ----------
    whole : GroupedVideo
        The film's stream.
    metadata : Metadata
        The stream's, of the instant.
    group, place, count : int
        The number of the group, and the place of the instant among its ``count``.
    """

    def __init__(self, whole: GroupedVideo, metadata: Metadata, group: int, place: int, count: int):
        tiles = len(metadata.segments)
        firsts = [part.first for part in metadata.segments]
        super().__init__(whole.path, metadata, firsts, whole.threads)
        self._whole, self._first = whole, group * tiles
        self._place, self._count = place, count

    def check_segment(self, index: int) -> None:
        """As of a file of one instant."""
        self._whole.check_segment(self._first + index)

    def check_once(self, index: int) -> None:
        """As of a file of one instant."""
        self._whole.check_once(self._first + index)

    def planes(
        self, segment: int, start: int = 0, stop: int | None = None
    ) -> Iterator[list[np.ndarray]]:
        """As of a file of one instant."""
        _, stop = self._span(segment, start, stop)
        self.decoded_segments.add(segment)
        before = self._whole.decoded_frames
        frames = self._whole.of_instant(self._first + segment, self._place, self._count)
        for number, planes in enumerate(frames):
            if start <= number < stop:
                yield planes
        self.decoded_frames += self._whole.decoded_frames - before

    def close(self) -> None:
        """Close the film."""
        self._whole.close()

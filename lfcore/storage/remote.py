"""Light field files by URL: only those ranges of bytes are fetched that are read, and each once.

A server that sends no byte for 30 s is given up, after one more try.
"""

from __future__ import annotations

import io
import os
import re
import threading
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from typing import TypeVar, cast

from lfcore.errors import LfcoreError, StorageError
from lfcore.files import refuse_special
from lfcore.storage import ranges
from lfcore.storage.ranges import DOWNLOAD, ranges_of

BLOCK = 1024
"""Bytes of which a range is made: small, as structure is scattered between clusters of video."""
MOST_BLOCKS = (256 << 20) // BLOCK
"""That are kept: a segment is read twice, to be checked and to be decoded."""
Made = TypeVar("Made")


class RemoteFile:
    """A file behind a URL, with as much of a ``Path`` as opening a light field takes."""

    def __init__(self, url: str):
        self.url = url
        self._path = PurePosixPath(url.partition("://")[2].partition("?")[0])
        self.name, self.stem, self.suffix = self._path.name, self._path.stem, self._path.suffix
        self._blocks: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.RLock()
        self._run = (0, 0)
        self._source = self._twice(lambda: ranges_of(url))
        self._size = self._source.size

    def _twice(self, work: Callable[[], Made]) -> Made:
        """What ``work`` makes, after one more try where a server fails."""
        for last in (False, True):
            try:
                return work()
            except LfcoreError:
                raise
            except FileNotFoundError:
                raise StorageError("no such file", file=self.url) from None
            except Exception as error:  # each file system has errors of its own
                if last:
                    problem = f"cannot be read: {_reason(error)}"
                    raise StorageError(problem, file=self.url, remedy=DOWNLOAD) from error
        raise AssertionError

    def __str__(self) -> str:
        return self.url

    def stat(self) -> SimpleNamespace:
        return SimpleNamespace(st_size=self._size)

    def open(self, mode: str = "rb") -> RemoteReader:
        """The file from its beginning; several may be open at a time."""
        return RemoteReader(self)

    def range(self, start: int, stop: int) -> bytes:
        """Bytes start ... stop - 1, as far as the file goes."""
        stop = min(stop, self._size)
        if start >= stop:
            return b""
        first, last = start // BLOCK, (stop - 1) // BLOCK
        with self._lock:
            held = {n: self._blocks[n] for n in range(first, last + 1) if n in self._blocks}
            for n in range(first, last + 1):
                if n in held:
                    continue
                end = next((k for k in range(n + 1, last + 1) if k in held), last + 1)
                end = self._ahead(n, end)
                data = self._fetch(n * BLOCK, min(end * BLOCK, self._size))
                for k in range(n, end):
                    held[k] = data[(k - n) * BLOCK : (k - n + 1) * BLOCK]
            self._blocks.update(held)
            while len(self._blocks) > MOST_BLOCKS:
                self._blocks.popitem(last=False)
        whole = b"".join(held[n] for n in range(first, last + 1))
        return whole[start - first * BLOCK : stop - first * BLOCK]

    def _ahead(self, first: int, stop: int) -> int:
        """To which block to fetch: of what is read in one go, an eighth more each time.

        Requests grow with the run, and what is fetched in vain stays below an eighth of it.
        """
        if first != self._run[1]:
            self._run = (first, first)
        end = -(-self._size // BLOCK)
        wanted = min(stop + (stop - self._run[0]) // 8, end)
        while wanted > stop and wanted - 1 in self._blocks:
            wanted -= 1
        self._run = (self._run[0], max(wanted, stop))
        return self._run[1]

    def _fetch(self, low: int, high: int) -> bytes:
        def whole() -> bytes:
            data = self._source.read(low, high)
            if len(data) != high - low:
                raise OSError(f"{len(data)} bytes came of {high - low} asked for at {low}")
            return data

        return self._twice(whole)


def _reason(error: Exception) -> str:
    """What a server did wrong, without the client's own names."""
    error = getattr(error, "reason", None) or error
    if isinstance(error, TimeoutError) or "timeout" in type(error).__name__.lower():
        return f"no byte came for {ranges.TIMEOUT_S:g} s"
    return re.sub(r"^\w+\(.*?\): ", "", str(error)) or type(error).__name__


class RemoteReader(io.RawIOBase):
    """A remote file as an open file for reading."""

    def __init__(self, remote: RemoteFile):
        super().__init__()
        self._remote, self._position = remote, 0

    def read(self, size: int | None = -1) -> bytes:
        whole = size is None or size < 0
        stop = self._remote.stat().st_size if whole else self._position + int(size or 0)
        data = self._remote.range(self._position, stop)
        self._position += len(data)
        return data

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        base = {os.SEEK_SET: 0, os.SEEK_CUR: self._position}.get(
            whence, self._remote.stat().st_size
        )
        self._position = max(0, base + offset)
        return self._position

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True


def located(name: str | Path) -> Path:
    """Where a file is: a path, or a :class:`RemoteFile`, which stands in for one; raises as it."""
    if isinstance(name, RemoteFile):
        return cast(Path, name)
    if isinstance(name, str) and "://" in name:
        return cast(Path, RemoteFile(name))
    refuse_special(name)
    return Path(name)

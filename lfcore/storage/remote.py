"""Light field files by URL: only ranges of bytes that are read are fetched, and each once.

A request fails after 30 s without a byte; each is repeated once.
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
"""The bytes of a block, the unit of ranges; small, as structure is scattered between clusters of
video."""
MOST_BLOCKS = (256 << 20) // BLOCK
"""The most blocks in memory: a segment is read twice, first checked and then decoded."""
Result = TypeVar("Result")


class RemoteFile:
    """A file at a URL, with the methods of ``Path`` that opening a light field needs."""

    def __init__(self, url: str):
        self.url = url
        self._path = PurePosixPath(url.partition("://")[2].partition("?")[0])
        self.name, self.stem, self.suffix = self._path.name, self._path.stem, self._path.suffix
        self._blocks: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.RLock()
        self._run = (0, 0)
        self._source = self._twice(lambda: ranges_of(url))
        self._size = self._source.size

    def _twice(self, work: Callable[[], Result]) -> Result:
        """Return the result of ``work``, repeated once if the server fails."""
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
        """Open the file at its beginning; several readers may be open at a time."""
        return RemoteReader(self)

    def range(self, start: int, stop: int) -> bytes:
        """Return bytes start ... stop - 1, up to the end of the file."""
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
        """Return the block up to which to fetch: an eighth more than the current run of reads.

        Requests grow with the run, and less than an eighth of it is fetched in vain.
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
                raise OSError(f"sent {len(data)} of {high - low} bytes at {low}")
            return data

        return self._twice(whole)


def _reason(error: Exception) -> str:
    """Return the server's fault, without the client's class names."""
    error = getattr(error, "reason", None) or error
    if isinstance(error, TimeoutError) or "timeout" in type(error).__name__.lower():
        return f"the server sent no byte for {ranges.TIMEOUT_S:g} s"
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
    """Return a path, or for a URL a :class:`RemoteFile` in its place; raises its errors."""
    if isinstance(name, RemoteFile):
        return cast(Path, name)
    if isinstance(name, str) and "://" in name:
        return cast(Path, RemoteFile(name))
    refuse_special(name)
    return Path(name)

"""Light field files by URL: only those ranges of bytes are fetched that are read, and each once.

Any file system that fsspec knows will do (https, s3, gs, ...), if it hands out ranges.
"""

from __future__ import annotations

import io
import os
import threading
from collections import OrderedDict
from pathlib import Path, PurePosixPath
from types import SimpleNamespace
from typing import cast

from lfcore.errors import LfcoreError, StorageError

BLOCK = 1024
"""Bytes of which a range is made: small, as structure is scattered between clusters of video."""
MOST_BLOCKS = (256 << 20) // BLOCK
"""That are kept: a segment is read twice, to be checked and to be decoded."""
NO_RANGES = "the server hands out no ranges of the file"
DOWNLOAD = "Download the file, and open the copy"


class RemoteFile:
    """A file behind a URL, with as much of a ``Path`` as opening a light field takes."""

    def __init__(self, url: str):
        self.url = url
        self._path = PurePosixPath(url.partition("://")[2].partition("?")[0])
        self.name, self.stem, self.suffix = self._path.name, self._path.stem, self._path.suffix
        self._blocks: OrderedDict[int, bytes] = OrderedDict()
        self._lock = threading.RLock()
        self._run = (0, 0)
        try:
            import fsspec

            system, path = fsspec.url_to_fs(self.url)
            self._file = system.open(path, "rb", cache_type="none")
        except ImportError as error:
            problem = f"cannot be opened: {error}"
            remedy = "pip install 'lfcore[remote]', and s3fs or gcsfs for such URLs"
            raise StorageError(problem, file=self.url, remedy=remedy) from None
        except Exception as error:  # each file system has errors of its own
            raise self._failed(error) from error
        if not getattr(self._file, "size", None) or not hasattr(self._file, "cache"):
            raise StorageError(NO_RANGES, file=self.url, remedy=DOWNLOAD)
        self._size = int(self._file.size)

    def _failed(self, error: Exception) -> StorageError:
        if isinstance(error, FileNotFoundError):
            return StorageError("no such file", file=self.url)
        return StorageError(f"cannot be read: {error or type(error).__name__}", file=self.url)

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
        try:
            self._file.seek(low)
            data = self._file.read(high - low)
        except LfcoreError:
            raise
        except Exception as error:  # each file system has errors of its own
            if "bytes so far" in str(error) or "range" in str(error).lower():
                raise StorageError(NO_RANGES, file=self.url, remedy=DOWNLOAD) from error
            raise self._failed(error) from error
        if len(data) != high - low:
            problem = f"{len(data)} bytes came of {high - low} asked for at {low}"
            raise StorageError(problem, file=self.url)
        return data


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
    return Path(name)

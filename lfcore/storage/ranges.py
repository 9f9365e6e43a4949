"""Ranges of bytes of a file on an HTTP server or in an object store, with time-outs."""

from __future__ import annotations

import re
from typing import Any, Protocol

from lfcore.errors import StorageError

TIMEOUT_S = 30.0
"""Seconds without a byte after which a request is given up."""
MOST_REDIRECTS = 10
STORES = {"s3": "s3fs", "gs": "gcsfs"}
"""Schemes of object stores, and the packages that read them."""
SCHEMES = ("http", "https", *STORES)
HEAD_BYTES = 1024
NO_RANGES = "the server hands out no ranges of the file"
DOWNLOAD = "Download the file, and open the copy"


class Ranges(Protocol):
    """A file of ``size`` bytes."""

    size: int

    def read(self, low: int, high: int) -> bytes:
        """Bytes low ... high - 1, or fewer; raises anything."""


def ranges_of(url: str) -> Ranges:
    """The file behind a URL of one of :data:`SCHEMES`; other exceptions are the server's fault.

    Raises :class:`StorageError` for another scheme, a package that is missing, and a server without
    ranges.
    """
    scheme = url.partition("://")[0].lower()
    if scheme not in SCHEMES or "::" in url:
        remedy = f"Give a URL of {', '.join(SCHEMES)}, or download the file"
        raise StorageError("is no URL that is read", file=url, remedy=remedy)
    try:
        return _Store(url, scheme) if scheme in STORES else _Http(url)
    except ImportError as error:
        needed = STORES.get(scheme, "'lfcore[remote]'")
        remedy = f"pip install {needed}"
        raise StorageError(f"cannot be opened: {error}", file=url, remedy=remedy) from None


class _Http:
    """A server may promise anything: no more than what was asked for is read."""

    def __init__(self, url: str):
        import urllib3

        once: dict[str, Any] = {"connect": 0, "read": 0, "status": 0, "other": 0}
        self._url, self.size = url, 0
        self._pool = urllib3.PoolManager(
            timeout=urllib3.Timeout(connect=TIMEOUT_S, read=TIMEOUT_S),
            retries=urllib3.Retry(MOST_REDIRECTS, redirect=MOST_REDIRECTS, **once),
        )
        self.read(0, HEAD_BYTES)

    def read(self, low: int, high: int) -> bytes:
        headers = {"Range": f"bytes={low}-{high - 1}", "Accept-Encoding": "identity"}
        reply = self._pool.request("GET", self._url, headers=headers, preload_content=False)
        try:
            if reply.status in (404, 410):
                raise FileNotFoundError(self._url)
            if reply.status not in (200, 206):
                raise OSError(f"the server answers {reply.status}")
            place = re.fullmatch(r"bytes (\d+)-\d+/(\d+)", reply.headers.get("Content-Range", ""))
            if reply.status == 200 or not place or int(place[1]) != low:
                raise StorageError(NO_RANGES, file=self._url, remedy=DOWNLOAD)
            size, self.size = self.size, int(place[2])
            if size not in (0, self.size):
                raise OSError("the file has changed meanwhile")
            data: bytes = reply.read(high - low, decode_content=False)
            if not reply.read(1):
                reply.release_conn()
            return data
        finally:
            reply.close()


class _Store:
    def __init__(self, url: str, scheme: str):
        import fsspec

        system, path = fsspec.url_to_fs(url, **_options(scheme))
        system.retries = 1  # s3fs tries five times
        self._file = system.open(path, "rb", cache_type="none")
        self.size = int(self._file.size)

    def read(self, low: int, high: int) -> bytes:
        self._file.seek(low)
        return self._file.read(high - low)


def _options(scheme: str) -> dict[str, Any]:
    """Time-outs, as each package takes them."""
    if scheme == "s3":
        waits = {"connect_timeout": TIMEOUT_S, "read_timeout": TIMEOUT_S}
        return {"config_kwargs": {**waits, "retries": {"total_max_attempts": 1}}}
    import aiohttp

    timeout = aiohttp.ClientTimeout(total=None, sock_connect=TIMEOUT_S, sock_read=TIMEOUT_S)
    return {"session_kwargs": {"timeout": timeout}}

"""Ranges of bytes of a file on an HTTP server or in an object store, with time-outs."""

from __future__ import annotations

import re
from typing import Any, Protocol

from lfcore.errors import StorageError

TIMEOUT_S = 30.0
"""The seconds without a byte after which a request fails."""
MOST_REDIRECTS = 10
"""The most redirections of a request."""
STORES = {"s3": "s3fs", "gs": "gcsfs"}
"""The schemes of object stores, and the packages that read them."""
SCHEMES = ("http", "https", *STORES)
"""The supported schemes."""
HEAD_BYTES = 1024
"""The bytes of the first request, which yields the file's size."""
DOWNLOAD = "Download the file, and open the copy"
"""The remedy for a server that cannot serve the file."""


class Ranges(Protocol):
    """A file with ``size`` bytes."""

    size: int

    def read(self, low: int, high: int) -> bytes:
        """Return bytes low ... high - 1, or fewer; may raise any exception."""


def ranges_of(url: str) -> Ranges:
    """Open the file of a URL with one of :data:`SCHEMES`.

    Raises :class:`StorageError` for another scheme, a missing package, and a server without ranges;
    any other exception is a failure of the server.
    """
    scheme = url.partition("://")[0].lower()
    if scheme not in SCHEMES or "::" in url:
        remedy = f"Give a URL of {', '.join(SCHEMES)}, or download the file"
        raise StorageError("has an unsupported scheme", file=url, remedy=remedy)
    try:
        return _Store(url, scheme) if scheme in STORES else _Http(url)
    except ImportError as error:
        needed = STORES.get(scheme, "'lfcore[remote]'")
        remedy = f"pip install {needed}"
        raise StorageError(f"cannot be opened: {error}", file=url, remedy=remedy) from None


class _Http:
    """A file on an HTTP server.  No more than the requested bytes are read, whatever its headers
    promise."""

    def __init__(self, url: str):
        import urllib3

        no_retries: dict[str, Any] = {"connect": 0, "read": 0, "status": 0, "other": 0}
        self._url, self.size = url, 0
        self._pool = urllib3.PoolManager(
            timeout=urllib3.Timeout(connect=TIMEOUT_S, read=TIMEOUT_S),
            retries=urllib3.Retry(MOST_REDIRECTS, redirect=MOST_REDIRECTS, **no_retries),
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
                problem = "the server does not serve ranges of the file"
                raise StorageError(problem, file=self._url, remedy=DOWNLOAD)
            size, self.size = self.size, int(place[2])
            if size not in (0, self.size):
                raise OSError("the file has changed since it was opened")
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
    """Return the time-outs as options of the scheme's package."""
    if scheme == "s3":
        waits = {"connect_timeout": TIMEOUT_S, "read_timeout": TIMEOUT_S}
        return {"config_kwargs": {**waits, "retries": {"total_max_attempts": 1}}}
    import aiohttp

    timeout = aiohttp.ClientTimeout(total=None, sock_connect=TIMEOUT_S, sock_read=TIMEOUT_S)
    return {"session_kwargs": {"timeout": timeout}}

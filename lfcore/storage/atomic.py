"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from av.error import FFmpegError

from lfcore.errors import StorageError


@contextmanager
def whole_file(path: str | Path) -> Iterator[BinaryIO]:
    """A binary file that takes the name ``path`` when the block ends without an exception.

    Until then it has a temporary name in the same folder; after an exception nothing is left.
    Raises :class:`StorageError` with the file's name when it cannot be created or finished.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        file = open(temporary, "w+b", buffering=1 << 18)
    except OSError as error:
        raise cannot_write(path, error) from error
    try:
        yield file
    except BaseException:
        with suppress(OSError):  # a full disk fails again when buffers are flushed
            file.close()
        temporary.unlink(missing_ok=True)
        raise
    try:
        file.close()
        os.replace(temporary, path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise cannot_write(path, error) from error


@contextmanager
def writing(path: Path, what: str) -> Iterator[None]:
    """Turn errors of the system and of FFmpeg into :class:`StorageError` with the file's name.

    ``what`` says in words what was being done, e.g. "encoding with libx264".
    """
    try:
        yield
    except FFmpegError as error:
        raise StorageError(f"{what} failed: {error.strerror or error}", file=path) from error
    except OSError as error:
        raise cannot_write(path, error) from error


def cannot_write(path: Path, error: OSError) -> StorageError:
    """What to tell the user when the system refuses to write ``path``."""
    return StorageError(
        f"cannot be written: {error.strerror or error}",
        file=path,
        remedy="Free space on that disk, or choose a folder that can be written",
    )

"""Files and folders that appear whole or not at all.

What is being written has a temporary name, a *draft*, beside its place.  When it is complete, its
bytes are on the disk and the disk said so, it takes its name.  A draft is held by a lock that ends
with its process, however that ends: drafts without a holder are remains of a run that was killed,
and the next run that writes into their folder removes them.
"""

import hashlib
import io
import json
import os
import re
import secrets
import shutil
import stat
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from lfcore.errors import LfcoreError, StorageError

try:
    import fcntl
except ImportError:  # Windows, where a file that is open cannot be removed: that is its lock
    fcntl = None  # type: ignore[assignment]

Read = TypeVar("Read")
_DRAFT = re.compile(r"\..*\.[0-9a-f]{12}\.draft(\.[^.]*)?", re.DOTALL)
_LONGEST_NAME = 160
"""Bytes of a file's name that its draft's name repeats: file systems take 255 in all."""
_drafts: dict[Path, int] = {}
"""Drafts of this process, with the descriptor that holds each one's lock."""
_cleared: set[Path] = set()
_lock = threading.Lock()


class _KeptRefusal(io.FileIO):
    """A file without a buffer that keeps the system's first refusal to write."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        return self.kept(super().write, data)

    def kept(self, work: Callable[[Any], Any], of: Any) -> Any:
        try:
            return work(of)
        except OSError as error:
            self.error = self.error or error
            raise


class WholeFile(io.BufferedRandom):
    """A binary file that is being written.

    It has no ``fileno``, so that numpy, Pillow and others write by :meth:`write`, whose failure is
    an exception, and not beside it, where a full disk may pass unseen.
    """

    raw: _KeptRefusal

    def fileno(self) -> int:
        raise io.UnsupportedOperation("fileno")

    def sync(self) -> None:
        """Wait until the disk has all that was written; several files are then renamed at once."""
        self.flush()
        self.raw.kept(os.fsync, self.raw.fileno())


@contextmanager
def whole_file(path: str | Path) -> Iterator[WholeFile]:
    """A binary file that takes the name ``path`` when the block ends without an exception.

    After an exception nothing is left, and a file of that name is as it was.
    """
    path = Path(path)
    with _held_draft(path) as draft:
        with _named(path):
            file = WholeFile(_KeptRefusal(draft, "r+"), 1 << 18)
        try:
            yield file
            file.sync()
            file.close()
        except BaseException as error:
            with suppress(OSError):  # a full disk fails again when buffers are flushed
                file.close()
            if file.raw.error:
                raise cannot_write(path, file.raw.error) from error
            raise
        with _named(path):
            os.replace(draft, path)


@contextmanager
def draft_folder(path: str | Path) -> Iterator[Path]:
    """A folder beside ``path`` for what it is made of; it is gone when the block ends."""
    make_folder(Path(path).parent)
    with _held_draft(Path(path), folder=True) as folder:
        yield folder


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text, whole or not at all; raises :class:`StorageError` when it cannot."""
    make_folder(Path(path).parent)
    with whole_file(path) as file:
        file.write(text.encode())


def write_json(path: str | Path, data: object) -> None:
    """Write indented JSON; refuses NaN and infinities, which are not JSON."""
    write_text(path, json.dumps(data, indent=2, allow_nan=False) + "\n")


def read_json(path: str | Path) -> Any:
    """Read a JSON file of UTF-8 text."""
    return json.loads(Path(path).read_text(encoding="utf-8"))


def read_arrays(
    path: str | Path,
    what: str,
    read: Callable[[Any], Read],
    *,
    kind: type[LfcoreError] = LfcoreError,
    remedy: str = "Delete it and run again",
) -> Read:
    """What ``read`` makes of the arrays of an npz file."""
    import numpy as np  # help needs no arrays

    refuse_special(path, kind)
    try:
        with np.load(path, allow_pickle=False) as archive:
            return read(archive)
    except MemoryError:
        raise
    except Exception as error:  # zipfile, zlib, numpy and a foreign header raise anything
        reason = " ".join(str(error).split())[:120]
        raise kind(f"not a whole {what} ({reason})", file=path, remedy=remedy) from None


def refuse_special(path: str | Path, kind: type[LfcoreError] = StorageError) -> None:
    """Raise an error for a device or a pipe, which would be read for ever."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):  # whoever opens it says so
        return
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise kind("is a device or pipe", file=path, remedy="Give a regular file")


def make_folder(path: Path) -> None:
    """Make a folder and those above it; raises :class:`StorageError` when it cannot."""
    with _named(path):
        path.mkdir(parents=True, exist_ok=True)


def abandon_drafts() -> None:
    """Remove all drafts of this process, which is about to end without unwinding."""
    for draft in list(_drafts):
        _remove(draft)


def cannot_write(path: str | Path, error: OSError) -> StorageError:
    """What to tell the user when the system refuses to write ``path``."""
    problem = f"cannot be written: {error.strerror or error}"
    remedy = "Free space on that disk, or choose a folder that can be written"
    return StorageError(problem, file=path, remedy=remedy)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise cannot_write(path, error) from error


@contextmanager
def _held_draft(path: Path, *, folder: bool = False) -> Iterator[Path]:
    """The name of a new, empty draft of ``path``, held by its lock; removed in the end."""
    _clear_remains(path.parent)
    name = os.fsdecode(os.fsencode(path.name)[:_LONGEST_NAME])
    while True:
        suffix = "" if folder else path.suffix
        draft = path.with_name(f".{name}.{secrets.token_hex(6)}.draft{suffix}")
        with _named(path):
            if folder:
                draft.mkdir()
            else:
                draft.open("xb").close()
        with _held(draft) as there:
            if not there:
                continue  # another run took it for remains before it was locked
            try:
                yield draft
            finally:
                _remove(draft)  # a file has its name by now if all went well
            return


@contextmanager
def _held(draft: Path) -> Iterator[bool]:
    """Hold the lock of a draft; gives whether it is still there."""
    descriptor, there = -1, True
    if fcntl is not None:
        with suppress(OSError):  # a file system without locks: nobody will clear it
            descriptor = os.open(draft, os.O_RDONLY)
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        there = draft.exists()
    with _lock:
        _drafts[draft] = descriptor
    try:
        yield there
    finally:
        with _lock:
            del _drafts[draft]
        if descriptor >= 0:
            os.close(descriptor)


def _clear_remains(folder: Path) -> None:
    """Remove drafts in ``folder`` whose process is gone; once a process and folder."""
    folder = folder.absolute()
    with _lock:
        if folder in _cleared:
            return
        _cleared.add(folder)
    with suppress(OSError):
        for entry in os.scandir(folder):
            if _DRAFT.fullmatch(entry.name):
                _clear(Path(entry.path))


def _clear(draft: Path) -> None:
    if fcntl is None:
        with suppress(OSError):
            draft.unlink()
        return
    with suppress(OSError):
        descriptor = os.open(draft, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _remove(draft)
        finally:
            os.close(descriptor)


def _remove(draft: Path) -> None:
    if draft.is_dir():
        shutil.rmtree(draft, ignore_errors=True)
    else:
        with suppress(OSError):
            draft.unlink(missing_ok=True)


def file_digest(path: str | Path) -> str:
    """SHA-256 of a file, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()

"""Built programs on disk, shared by all processes of a user and by machines that share a home.

An entry's name is a digest of all that its binary depends on: source with what it includes,
options, driver, its version, device, and the processor's instruction set.  So a processor never
finds what was built for another.  An entry carries a digest of its name and contents: one that is
damaged, cut short, under another's name or refused by the driver is built again.  Where no folder
can be written, or others could write into it, programs are kept by the process alone.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import logging
import os
import platform
import re
import stat
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from lfcore.errors import StorageError, printable
from lfcore.files import whole_file
from lfcore.progress import BUILDING, stage

if TYPE_CHECKING:
    import pyopencl as cl

log = logging.getLogger(__name__)

Program = TypeVar("Program")

LIMIT_BYTES = 256 << 20
"""Of all entries: those that were not used for longest make room for new ones."""
_MAGIC = b"lfcore program 2\n"
_DIGEST_BYTES = hashlib.sha256().digest_size
_INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
_HELD = ("CL_CONFIG_", "POCL_", "PYOPENCL_BUILD_OPTIONS")
"""Beginnings of variables by which a user tells a driver how to build."""


def cache_home() -> Path:
    """The user's folder for what can be made again."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    except RuntimeError:  # a user without a home
        return Path(os.devnull)


def own_folder(path: Path) -> Path:
    """``path``, a folder that only this user can change, made if need be; raises OSError.

    What others could have put into it is removed.
    """
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid"):
        found = path.stat()
        if found.st_uid != os.getuid():
            raise PermissionError(f"{path} belongs to another user")
        for above in path.resolve().parents:
            mode = above.stat().st_mode
            if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
                raise PermissionError(f"any user can replace what is in {above}")
        if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            path.chmod(0o700)
            for file in path.iterdir():
                file.unlink(missing_ok=True)
    tempfile.TemporaryFile(dir=path).close()
    return path


@functools.cache
def folder() -> Path | None:
    """Where entries are, made if need be; None, with a line in the log, where none can be."""
    try:
        return own_folder(cache_home() / "lfcore" / "programs")
    except OSError as error:
        log.warning(
            "OpenCL programs are built anew by each process: no folder for them (%s). "
            "Set XDG_CACHE_HOME to a folder that can be written",
            printable(str(error)),
        )
        return None


@functools.cache
def instruction_set() -> str:
    """What the processor can execute, as far as the system tells; two kinds may share a name."""
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:
        for line in file:
            if line.startswith(("flags", "Features")):
                return " ".join(sorted(line.partition(":")[2].split()))
    return f"{platform.machine()} {platform.processor()}"


def expanded(source: str, folders: Sequence[str]) -> str:
    """A source followed by every file that it includes, each once, found in ``folders``."""
    texts, found = [source], set()
    for text in texts:
        for name in _INCLUDE.findall(text):
            for folder in folders:
                path = Path(folder) / name
                if path not in found and path.is_file():
                    found.add(path)
                    texts.append(path.read_text(encoding="utf-8"))
    return "\0".join(texts)


def key(device: cl.Device, source: str, options: Sequence[str]) -> str:
    """The name of an entry: ``source`` is expanded, ``device`` a pyopencl Device."""
    held = [f"{k}={value}" for k, value in sorted(os.environ.items()) if k.startswith(_HELD)]
    driver = device.platform.name, device.platform.version, device.driver_version
    processor = device.vendor, device.name, device.version, instruction_set()
    whole = "\0".join([_MAGIC.decode(), *driver, *processor, *held, *options, source])
    return hashlib.sha256(whole.encode()).hexdigest()


def cached(
    name: str,
    load: Callable[[bytes], Program | None],
    build: Callable[[], tuple[Program, bytes]],
) -> Program:
    """The program called ``name``, by :func:`key`: loaded, or built by one process at a time.

    ``load`` makes a program of its binary, or None of one that the driver refuses; ``build``
    returns a program and its binary.
    """
    path = folder()
    if path is None:
        with stage(BUILDING):
            return build()[0]
    entry = path / f"{name}.bin"
    program = _read(entry, load)
    if program is None:
        with stage(BUILDING), _alone(path / f"{name[:2]}.lock"):
            program = _read(entry, load)  # of a process that was waited for
            if program is None:
                program, binary = build()
                _write(entry, binary)
    return program


def _read(entry: Path, load: Callable[[bytes], Program | None]) -> Program | None:
    try:
        contents = entry.read_bytes()
    except OSError:
        return None
    head = len(_MAGIC) + _DIGEST_BYTES
    binary, digest = contents[head:], contents[len(_MAGIC) : head]
    if contents[: len(_MAGIC)] == _MAGIC and _digest(entry, binary) == digest:
        program = load(binary)
        if program is not None:
            with contextlib.suppress(OSError):
                os.utime(entry)  # the last use, by which entries make room
            return program
    log.info("built program %s is damaged or foreign, and is built again", entry.name)
    return None


def _digest(entry: Path, binary: bytes) -> bytes:
    return hashlib.sha256(entry.name.encode() + b"\0" + binary).digest()


def _write(entry: Path, binary: bytes) -> None:
    """Give an entry its name when it is whole; a full disk costs the entry alone."""
    try:
        with whole_file(entry) as file:
            file.write(_MAGIC + _digest(entry, binary) + binary)
    except StorageError as error:
        log.warning("a built OpenCL program was not kept: %s", error)
    _make_room(entry.parent, LIMIT_BYTES)


def _make_room(path: Path, limit: int) -> None:
    """Remove what was not used for longest until entries take less than three quarters of a limit.

    What is half written counts as an entry.
    """
    with contextlib.suppress(OSError):  # another process may remove them as well
        entries = [(file.stat().st_mtime, file.stat().st_size, file) for file in path.glob("*.bin")]
        total = sum(size for _, size, _ in entries)
        for _, size, file in sorted(entries) if total > limit else ():
            if total > 0.75 * limit:
                file.unlink(missing_ok=True)
                total -= size


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock that the system frees with the process; go on without where there are none."""
    with contextlib.ExitStack() as held:
        with contextlib.suppress(ImportError, OSError):
            import fcntl

            file = held.enter_context(open(path, "w", encoding="utf-8"))
            fcntl.flock(file, fcntl.LOCK_EX)
        yield

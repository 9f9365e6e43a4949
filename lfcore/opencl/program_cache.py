"""Built programs on disk, shared by all processes of a user and by machines that share a home.

An entry's name is a digest of everything that its binary depends on: source with its includes,
options, driver, its version, device, and the processor's instruction set.  So a processor never
loads another processor's program.  An entry has a digest of its name and contents: a damaged,
truncated, renamed or refused entry is built again.  Without a folder that only the user can write,
programs stay in the process.
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
"""The largest total size of entries; the least recently used ones are removed."""
_MAGIC = b"lfcore program 2\n"
_DIGEST_BYTES = hashlib.sha256().digest_size
_INCLUDE = re.compile(r'^\s*#\s*include\s*"([^"]+)"', re.MULTILINE)
_HELD = ("CL_CONFIG_", "POCL_", "PYOPENCL_BUILD_OPTIONS")
"""The prefixes of environment variables that change builds."""


def cache_home() -> Path:
    """The user's folder of caches."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    except RuntimeError:  # a user without a home
        return Path(os.devnull)


def own_folder(path: Path) -> Path:
    """Return ``path``, made if missing, as a folder that only this user can change; raises OSError.

    Files that others could have written are removed.
    """
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    if hasattr(os, "getuid"):
        status = path.stat()
        if status.st_uid != os.getuid():
            raise PermissionError(f"{path} belongs to another user")
        for above in path.resolve().parents:
            mode = above.stat().st_mode
            if mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
                raise PermissionError(f"any user can replace files in {above}")
        if status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            path.chmod(0o700)
            for file in path.iterdir():
                file.unlink(missing_ok=True)
    tempfile.TemporaryFile(dir=path).close()
    return path


@functools.cache
def folder() -> Path | None:
    """The folder of entries, made if missing; None, with a line in the log, if it cannot be
    made."""
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
    """The processor's instruction sets, if the system reports them: its name does not suffice."""
    with contextlib.suppress(OSError), open("/proc/cpuinfo", encoding="utf-8") as file:
        for line in file:
            if line.startswith(("flags", "Features")):
                return " ".join(sorted(line.partition(":")[2].split()))
    return f"{platform.machine()} {platform.processor()}"


def expanded(source: str, folders: Sequence[str]) -> str:
    """A source followed by every file that it includes, each once, found in ``folders``."""
    texts, included = [source], set()
    for text in texts:
        for name in _INCLUDE.findall(text):
            for folder in folders:
                path = Path(folder) / name
                if path not in included and path.is_file():
                    included.add(path)
                    texts.append(path.read_text(encoding="utf-8"))
    return "\0".join(texts)


def key(device: cl.Device, source: str, options: Sequence[str]) -> str:
    """The name of an entry: ``source`` is expanded, ``device`` a pyopencl Device."""
    variables = [f"{k}={value}" for k, value in sorted(os.environ.items()) if k.startswith(_HELD)]
    driver = device.platform.name, device.platform.version, device.driver_version
    processor = device.vendor, device.name, device.version, instruction_set()
    whole = "\0".join([_MAGIC.decode(), *driver, *processor, *variables, *options, source])
    return hashlib.sha256(whole.encode()).hexdigest()


def cached(
    name: str,
    load: Callable[[bytes], Program | None],
    build: Callable[[], tuple[Program, bytes]],
) -> Program:
    """The program ``name`` of :func:`key`, loaded, or built by one process at a time.

    ``load`` makes a program from a binary, or None if the driver refuses it; ``build``
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
            program = _read(entry, load)  # built by the process that held the lock
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
                os.utime(entry)  # the time of the last use
            return program
    log.info("built program %s is damaged or foreign, and is built again", entry.name)
    return None


def _digest(entry: Path, binary: bytes) -> bytes:
    return hashlib.sha256(entry.name.encode() + b"\0" + binary).digest()


def _write(entry: Path, binary: bytes) -> None:
    """Write an entry, whole or not at all; a full disk only loses the entry."""
    try:
        with whole_file(entry) as file:
            file.write(_MAGIC + _digest(entry, binary) + binary)
    except StorageError as error:
        log.warning("a built OpenCL program was not stored: %s", error)
    _make_room(entry.parent, LIMIT_BYTES)


def _make_room(path: Path, limit: int) -> None:
    """Remove the least recently used entries until entries take less than three quarters of a
    limit.

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

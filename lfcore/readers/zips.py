"""ZIP archives of bounded size, which files of several formats are."""

import io
import zipfile
import zlib
from pathlib import Path

from lfcore.reading import LARGEST_TEXT, Where

DAMAGED = (
    zipfile.BadZipFile, zlib.error, EOFError, OSError, ValueError, NotImplementedError,
    RuntimeError,
)  # fmt: skip
"""What zipfile raises for an archive that is damaged or locked."""


def opened(path: Path, data: bytes) -> zipfile.ZipFile:
    """The archive of a file's bytes; :class:`SceneError` for one that is damaged or too large."""
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
        if sum(info.file_size for info in archive.infolist()) <= LARGEST_TEXT:
            return archive
    except DAMAGED as error:
        raise Where(path).error(f"mesh cannot be unpacked: {error}", "Export it again") from None
    raise Where(path).error("mesh file holds more than 1024 MiB", "Split it")


def unpacked(path: Path, archive: zipfile.ZipFile, name: str) -> bytes:
    """A file of an archive."""
    try:
        return archive.read(name)
    except (*DAMAGED, KeyError) as error:
        raise Where(path).error(f"{name} cannot be unpacked: {error}", "Export it again") from None

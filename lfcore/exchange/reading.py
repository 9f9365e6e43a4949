"""Reading of other programs' files, whole or with an error that names the file."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from lfcore.errors import SceneError, StorageError
from lfcore.reading import LARGEST_TEXT, read_bytes


class ExchangeError(StorageError):
    """A light field of another program that is incomplete or contradicts itself."""


GIVE_GRID = "Give the columns and rows of views, as --views 9x9 does"
NOT_OF_THE_FORMAT = (
    ArithmeticError, AttributeError, LookupError, OSError, RecursionError, TypeError, ValueError,
)  # fmt: skip


def unreadable(file: Path, error: Exception, problem: str = "cannot be read") -> ExchangeError:
    """The error for a file that a library cannot read, with the beginning of its reason."""
    if isinstance(error, FileNotFoundError):
        return ExchangeError("no such file", file=file)
    reason = " ".join(str(getattr(error, "strerror", None) or error).split())[:120]
    return ExchangeError(f"{problem}: {reason}", file=file)


@contextmanager
def refused(problem: str, file: Path, key: str | None = None) -> Iterator[None]:
    """Convert the errors of unsuitable values in the block to this :class:`ExchangeError`."""
    try:
        yield
    except NOT_OF_THE_FORMAT:
        raise ExchangeError(problem, file=file, key=key) from None


def read_text(file: Path) -> str:
    try:
        # Others write a byte order mark, and Windows's line ends.
        return read_bytes(file, LARGEST_TEXT).decode("utf-8-sig").replace("\r\n", "\n")
    except SceneError as error:
        raise error.named(ExchangeError) from None
    except UnicodeDecodeError as error:
        raise unreadable(file, error) from None


def load_json(file: Path) -> dict:
    """The object in a JSON file."""
    try:
        data = json.loads(read_text(file))
    except (ValueError, RecursionError) as error:
        raise unreadable(file, error) from None
    if not isinstance(data, dict):
        raise ExchangeError("is no JSON object", file=file)
    return data


def existing(files: Iterable[Path], asked_by: str) -> Path:
    """Return the first file that exists; ``asked_by`` is the reason in the error."""
    files = list(files)
    for file in files:
        if file.is_file():
            return file
    raise ExchangeError(f"no such file; {asked_by}", file=files[0])

"""Files that others wrote, read within bounds of size and depth: whatever they hold, it ends."""

from __future__ import annotations

import gzip
import os
import re
import stat
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, NoReturn

import yaml

from lfcore.errors import SceneError

DESCRIPTIONS = (".yaml", ".yml")
MIB = 2**20
LARGEST_DESCRIPTION = 4 * MIB
"""The largest YAML file, bytes."""
LARGEST_TEXT = 1024 * MIB
"""The largest file of text, such as pbrt's or a material library, bytes."""
LARGEST_MESH = 4096 * MIB
"""The largest mesh file, bytes."""
LARGEST_PICTURE = 4096 * MIB
"""The largest picture, bytes: mosaics of views are large by nature."""
DEEPEST_YAML = 64
"""The deepest nesting of a YAML file."""
MOST_YAML_NODES = 100_000
"""The largest number of values of a YAML file with its aliases followed."""


@dataclass(frozen=True)
class Where:
    """A place in a file, which errors name."""

    file: str | Path
    key: str = ""

    def __getitem__(self, name: object) -> Where:
        """The place of an entry, by its key or index."""
        if isinstance(name, int):
            return Where(self.file, f"{self.key}[{name}]")
        return Where(self.file, f"{self.key}.{name}" if self.key else str(name))

    def error(self, problem: str, remedy: str | None = None) -> SceneError:
        return SceneError(problem, file=self.file, key=self.key or None, remedy=remedy)


NOWHERE = Where("")


def read_bytes(path: str | Path, most: int, what: str = "file") -> bytes:
    """At most ``most`` bytes of a regular file; a ``.gz`` is unpacked."""
    path = Path(path)
    with opened(path, what) as stream:
        if path.suffix.lower() == ".gz":
            return _unpacked(stream, path, most, what)
        try:
            size = os.fstat(stream.fileno()).st_size
            if size > most:
                raise _too_large(path, most, what)
            return stream.read(size)  # which takes memory for as many bytes as it is told
        except OSError as error:
            raise _unreadable(path, error, what) from None


def opened(path: str | Path, what: str = "file") -> BinaryIO:
    """A regular file, open; :class:`SceneError` for anything else, and where it cannot be read."""
    path, check = Path(path), "Check the path"
    try:
        stream = open(path, "rb", opener=lambda name, flags: os.open(name, flags | _NO_WAIT))
    except (FileNotFoundError, NotADirectoryError):
        raise Where(path).error(f"{what} not found", check) from None
    except ValueError:  # a NUL in the name
        raise SceneError(f"{what} cannot have the name {str(path)!r}", remedy=check) from None
    except OSError as error:
        raise _unreadable(path, error, what) from None
    if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
        stream.close()
        raise Where(path).error(f"{what} is a device or pipe", "Give a regular file")
    return stream


def _unreadable(path: Path, error: OSError, what: str) -> SceneError:
    problem = f"{what} cannot be read: {error.strerror or error}"
    return Where(path).error(problem, "Check the path")


# A pipe that nobody writes to would keep open() waiting; Windows has none in its file system.
_NO_WAIT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def _unpacked(stream: Any, path: Path, most: int, what: str) -> bytes:
    content = bytearray()
    try:
        with gzip.GzipFile(fileobj=stream) as packed:
            while len(content) <= most and (part := packed.read(MIB)):
                content += part
        if not stream.tell():
            raise EOFError("it is empty")
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        problem = f"{what} cannot be unpacked: {error}"
        raise Where(path).error(problem, "Get or make the file again") from None
    if len(content) > most:
        raise _too_large(path, most, what)
    return bytes(content)


def _too_large(path: Path, most: int, what: str) -> SceneError:
    size = f"{most // MIB} MiB" if most >= MIB else f"{most} bytes"
    return Where(path).error(f"{what} holds more than {size}", "Split it, or make it less")


def read_yaml(path: str | Path) -> Any:
    """What a YAML file says, plain lists, dictionaries and scalars."""
    raw, where = read_bytes(path, LARGEST_DESCRIPTION, "scene file"), Where(Path(path))
    try:
        text = raw.decode("utf-8")
        _check_bounds(text, where)
        loader = _Loader(text)
        loader.where = where
        return loader.get_single_data()
    except UnicodeDecodeError as error:
        problem = f"scene file is not text in UTF-8: {error}"
        raise where.error(problem, "Save it as UTF-8") from None
    except yaml.YAMLError as error:
        problem = f"not valid YAML: {' '.join(str(error).split())}"
        raise where.error(problem, "Mend the syntax") from None
    except ValueError as error:  # a date such as 2026-99-99, or an integer of 10,000 digits
        problem = f"holds a value that YAML cannot read: {error}"
        raise where.error(problem, "Put it in quotes") from None


class _Loader(yaml.SafeLoader):
    """YAML in which every key is given once and every number means what it looks like."""

    where: Where

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        keys = [key for key, _ in node.value if key.tag != "tag:yaml.org,2002:merge"]
        seen: set[str] = set()
        for key in keys:
            if isinstance(key, yaml.ScalarNode) and key.value in seen:
                self._refuse(key, f"has the key {key.value!r} twice", "Remove one of them")
            seen.add(str(key.value))
        return super().construct_mapping(node, deep)

    def number(self, node: Any) -> int | float:
        kind = node.tag.rpartition(":")[2]
        value = getattr(self, f"construct_yaml_{kind}")(node)
        if _ODD_NUMBER.fullmatch(node.value):
            problem = f"has {node.value}, which YAML takes for {value}"
            self._refuse(node, problem, "Write the number without leading zeros and colons")
        return value

    def _refuse(self, node: Any, problem: str, remedy: str) -> NoReturn:
        raise self.where.error(f"{problem}, on line {node.start_mark.line + 1}", remedy)


_ODD_NUMBER = re.compile(r"[-+]?0[0-9_]+|.*:.*")
"""Numbers of base 8 and of base 60."""
for _kind in ("int", "float"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _Loader.number)
_Loader.add_implicit_resolver(  # 1e-3, which YAML 1.1 takes for text
    "tag:yaml.org,2002:float",
    re.compile(r"[-+]?[0-9][0-9_]*[eE][-+]?[0-9]+$"),
    list("-+0123456789"),
)


def _check_bounds(text: str, where: Where) -> None:
    """Refuse YAML that nests deeply, contains itself, or is large with its aliases followed."""
    levels: list[list[Any]] = [["", 0, 0]]  # per open collection: anchor, line, number of values
    sizes: dict[str | None, int] = {}
    for event in yaml.parse(text, yaml.SafeLoader):
        anchor, size = getattr(event, "anchor", None), 0
        line = event.start_mark.line + 1 if event.start_mark else 0
        if isinstance(event, yaml.CollectionStartEvent):
            levels.append([anchor, line, 1])
        elif isinstance(event, yaml.CollectionEndEvent):
            anchor, _, size = levels.pop()
        elif isinstance(event, yaml.ScalarEvent):
            size = 1
        elif isinstance(event, yaml.AliasEvent):
            for other, start, _ in levels:
                if other == anchor:
                    problem = f"what starts on line {start} contains itself"
                    raise where.error(problem, "Remove the alias")
            size = sizes.get(anchor, 0)
        sizes[anchor] = size
        levels[-1][2] += size
        if len(levels) > DEEPEST_YAML:
            problem = f"nests more than {DEEPEST_YAML} deep on line {line}"
            raise where.error(problem, "Close the brackets, or flatten it")
        if levels[-1][2] > MOST_YAML_NODES:
            problem = f"holds more than {MOST_YAML_NODES} values once its aliases are followed"
            raise where.error(problem, "Write fewer aliases")

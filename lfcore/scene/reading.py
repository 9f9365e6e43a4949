"""Files that others wrote, read within bounds of size and depth: whatever they hold, it ends."""

from __future__ import annotations

import gzip
import os
import stat
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from lfcore.errors import SceneError

DESCRIPTIONS = (".yaml", ".yml")
SCENES = (
    *DESCRIPTIONS, ".npz", ".pbrt", ".pbrt.gz", ".glb", ".gltf", ".obj", ".off", ".ply", ".stl"
)  # fmt: skip
"""The ends of the names of files that are scenes; other formats of meshes are seldom met."""
MIB = 2**20
LARGEST_DESCRIPTION = 4 * MIB
LARGEST_TEXT = 1024 * MIB
LARGEST_MESH = 4096 * MIB
DEEPEST_YAML = 64
MOST_YAML_NODES = 100_000
"""Of a YAML file with its aliases followed."""


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
    path, check = Path(path), "Check the path"
    try:
        with open(os.open(path, os.O_RDONLY | _NO_WAIT), "rb") as stream:
            status = os.fstat(stream.fileno())
            if not stat.S_ISREG(status.st_mode):
                raise Where(path).error(f"{what} is a device or pipe", "Give a regular file")
            if path.suffix.lower() == ".gz":
                return _unpacked(stream, path, most, what)
            if status.st_size > most:
                raise _too_large(path, most, what)
            return stream.read()
    except (FileNotFoundError, NotADirectoryError):
        raise Where(path).error(f"{what} not found", check) from None
    except ValueError:  # a NUL in the name
        raise SceneError(f"{what} cannot have the name {str(path)!r}", remedy=check) from None
    except OSError as error:
        reason = error.strerror or str(error)
        raise Where(path).error(f"{what} cannot be read: {reason}", check) from None


# A pipe that nobody writes to would keep open() waiting; Windows has none in its file system.
_NO_WAIT = getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)


def _unpacked(stream: Any, path: Path, most: int, what: str) -> bytes:
    try:
        with gzip.GzipFile(fileobj=stream) as packed:
            made = packed.read(most + 1)
        if not stream.tell():
            raise EOFError("it is empty")
    except (EOFError, gzip.BadGzipFile, zlib.error) as error:
        problem = f"{what} cannot be unpacked: {error}"
        raise Where(path).error(problem, "Get or make the file again") from None
    if len(made) > most:
        raise _too_large(path, most, what)
    return made


def _too_large(path: Path, most: int, what: str) -> SceneError:
    size = f"{most // MIB} MiB" if most >= MIB else f"{most} bytes"
    return Where(path).error(f"{what} holds more than {size}", "Split it, or make it less")


def read_yaml(path: str | Path, what: str = "scene file") -> Any:
    """What a YAML file says, plain lists, dictionaries and scalars."""
    raw, where = read_bytes(path, LARGEST_DESCRIPTION, what), Where(Path(path))
    try:
        loader = _Loader(raw.decode("utf-8"))
        loader.where = where
        try:
            node = loader.get_single_node()
            if node is None:
                return None
            _count(node, {}, where)
            return loader.construct_document(node)
        finally:
            loader.dispose()
    except UnicodeDecodeError as error:
        raise where.error(f"{what} is not text in UTF-8: {error}", "Save it as UTF-8") from None
    except yaml.YAMLError as error:
        problem = f"not valid YAML: {' '.join(str(error).split())}"
        raise where.error(problem, "Mend the syntax") from None
    except ValueError as error:  # a date such as 2026-99-99, or an integer of 10,000 digits
        problem = f"holds a value that YAML cannot read: {error}"
        raise where.error(problem, "Put it in quotes") from None


class _Loader(yaml.SafeLoader):
    """yaml.SafeLoader, which calls itself for each level, down to :data:`DEEPEST_YAML`."""

    depth, where = 0, NOWHERE

    def compose_node(self, parent: Any, index: Any) -> Any:
        self.depth += 1
        if self.depth > DEEPEST_YAML:
            line = self.peek_event().start_mark.line + 1
            problem = f"nests more than {DEEPEST_YAML} deep on line {line}"
            raise self.where.error(problem, "Close the brackets, or flatten it")
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _count(node: yaml.Node, known: dict[int, int | None], where: Where) -> int:
    """Nodes below and including ``node`` when every alias is written out."""
    if id(node) in known:
        size = known[id(node)]
        if size is None:
            line = node.start_mark.line + 1
            raise where.error(f"what starts on line {line} contains itself", "Remove the alias")
        return size
    known[id(node)] = None
    size = 1
    if isinstance(node, yaml.CollectionNode):
        for item in node.value:
            for part in item if isinstance(item, tuple) else (item,):
                size += _count(part, known, where)
    if size > MOST_YAML_NODES:
        problem = f"holds more than {MOST_YAML_NODES} values once its aliases are followed"
        raise where.error(problem, "Write fewer aliases")
    known[id(node)] = size
    return size

"""The files that a scene is made from, found by scanning: nothing is parsed, decoded or built.

A build system asks this before it parses a scene, so that an edit of any of them parses it anew.
Names are searched for in the text, by the formats' own marks; of names that mean no file, or a
file that is missing, parsing tells the user.  A name in a comment counts: it costs a parse at most.
"""

import os
import re
import urllib.parse
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from lfcore import reading
from lfcore.errors import SceneError
from lfcore.reading import DESCRIPTIONS
from lfcore.scene.baked import ASKS

_INCLUDE = re.compile(rb'\b(?:Include|Import)\s*"([^"\n]{1,4096})"')
_SKY = re.compile(rb'^[^#\n]*LightSource\s*"infinite"', re.MULTILINE)
_QUOTED = re.compile(rb'"([^"\n]{1,4096})"')
_IMAGE = re.compile(rb"<init_from>\s*([^<]{1,4096}?)\s*<")
"""The pictures of COLLADA."""
_NAMED = re.compile(
    rb"^[ \t]*(?:mtllib|comment TextureFile|map_\w+|bump|disp|decal|refl|norm)[ \t]+(\S[^\r\n]*)",
    re.MULTILINE | re.IGNORECASE,
)
"""Lines of OBJ, MTL and PLY files that name a file."""
_PLY_HEADER_BYTES = 1 << 16
"""The part of a PLY file, bytes, in which its header ends."""

Scanner = Callable[[Path], Iterable[str]]


def files_of_scene(path: str | Path) -> list[Path]:
    """A scene file and every existing file that it names, the scene first: meshes, textures,
    includes, spectra, material libraries, buffers and images."""
    path = Path(path)
    return [path, *sorted({file for file, _ in _walk(path)} - {path})]


def _walk(path: Path) -> Iterator[tuple[Path, Scanner]]:
    """The files and how each is scanned."""
    waiting = [(path, path.parent, _scanner_of(path))]
    seen = {path}
    while waiting:
        file, main, scanner = waiting.pop()
        yield file, scanner
        for name, scanner_of_named in _named_by(file, scanner):
            # pbrt looks beside its main file, then beside the file that includes.
            candidates = (folder / name for folder in dict.fromkeys((main, file.parent)))
            named = next((each for each in candidates if os.path.isfile(each)), None)
            if named and named not in seen:
                seen.add(named)
                beside = main if scanner is _pbrt else named.parent
                waiting.append((named, beside, scanner_of_named or _scanner_of(named)))


def asks_for_light(path: str | Path) -> bool:
    """Whether light is to be baked for a scene; a file that cannot be read says so when parsed."""
    path = Path(path)
    try:
        if _scanner_of(path) is _pbrt:
            scenes = [file for file, scanner in _walk(path) if scanner is _pbrt]
            read = (reading.read_bytes(file, reading.LARGEST_TEXT) for file in scenes)
            return any(_SKY.search(text) for text in read)
        description = reading.read_yaml(path) if path.suffix.lower() in DESCRIPTIONS else None
    except SceneError:
        return False
    return isinstance(description, dict) and any(key in description for key in ASKS)


def _named_by(file: Path, scanner: Scanner) -> list[tuple[str, Scanner | None]]:
    """Names in a file, and how to scan what they mean; None: by its suffix."""
    try:
        names: list[tuple[str, Scanner | None]] = [(name, None) for name in scanner(file)]
        if scanner is _pbrt:
            included = _INCLUDE.findall(reading.read_bytes(file, reading.LARGEST_TEXT))
            names = [(_text(name), _pbrt) for name in included] + names
        return names
    except (OSError, ValueError, SceneError):
        return []


def _scanner_of(file: Path) -> Scanner:
    suffix = file.name.lower().removesuffix(".gz").rpartition(".")[2]
    return _SCANNERS.get(suffix, lambda file: ())


def _strings(value: object) -> Iterator[str]:
    """Every string in a tree of lists and dictionaries, as it is and as a URI."""
    if isinstance(value, str):
        yield value
        yield urllib.parse.unquote(value)
    for each in (
        value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    ):
        yield from _strings(each)


def _pbrt(file: Path) -> Iterator[str]:
    # Whatever is quoted and names a file: the parameters that take one differ by version.
    data = reading.read_bytes(file, reading.LARGEST_TEXT)
    yield from map(_text, dict.fromkeys(_QUOTED.findall(data)))


def _text(name: bytes) -> str:
    return name.decode("utf-8", errors="surrogateescape")


def _tails(data: bytes) -> Iterator[str]:
    """A name may hold spaces, and options may stand before it: every end of the line is tried."""
    for line in dict.fromkeys(_NAMED.findall(data)):
        words = _text(line).split()
        for first in range(len(words)):
            yield " ".join(words[first:])


def _yaml(file: Path) -> Iterator[str]:
    return _strings(reading.read_yaml(file))


def _obj(file: Path) -> Iterator[str]:
    return _tails(reading.read_bytes(file, reading.LARGEST_MESH))


def _dae(file: Path) -> Iterator[str]:
    names = _IMAGE.findall(reading.read_bytes(file, reading.LARGEST_TEXT))
    return _strings([_text(name) for name in names])


def _ply(file: Path) -> Iterator[str]:
    with file.open("rb") as stream:
        return _tails(stream.read(_PLY_HEADER_BYTES))


def _gltf(file: Path) -> Iterator[str]:
    from lfcore.readers.gltf.document import Document  # arrays, which a build system has no need of

    return _strings(Document(file).tree)


_SCANNERS: dict[str, Scanner] = {
    "dae": _dae,
    "yaml": _yaml, "yml": _yaml, "pbrt": _pbrt, "obj": _obj, "mtl": _obj, "ply": _ply,
    "gltf": _gltf, "glb": _gltf,
}  # fmt: skip

"""The tree of a glTF or GLB file, its buffers and its accessors.

Source: Khronos, "glTF 2.0 Specification", sections 3.6 and 4, and the extensions
EXT_meshopt_compression, KHR_meshopt_compression and KHR_mesh_quantization.
"""

import base64
import json
import struct
import urllib.parse
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.reading import LARGEST_MESH, Where, read_bytes

SUFFIXES = (".glb", ".gltf")
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
MESHOPT = "EXT_meshopt_compression", "KHR_meshopt_compression"
MOST_ELEMENTS = 1 << 27
"""The largest number of elements of an accessor: 134 million."""
MOST_UNPACKED = 1 << 30
"""The largest size of a packed bufferView, bytes."""
_HEAD, _CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
_JSON, _BINARY = 0x4E4F534A, 0x004E4942


def extension(entry: dict, *names: str) -> dict | None:
    """The first of these extensions that an object of the file has."""
    extensions = entry.get("extensions", {})
    return next((extensions[name] for name in names if name in extensions), None)


class Document:
    """The tree of a file; whatever makes no sense raises :class:`SceneError`."""

    def __init__(self, path: str | Path):
        self.path = Path(path)
        text = read_bytes(self.path, LARGEST_MESH, "mesh file")
        self._chunk: bytes | None = None
        if text[:4] == b"glTF":
            text, self._chunk = self._chunks(text)
        try:
            tree = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise self.broken(f"its JSON cannot be read: {error}") from None
        if not isinstance(tree, dict):
            raise self.broken("its JSON is no object")
        self.tree: dict[str, Any] = tree
        self._entries: dict[str, list[dict]] = {}
        self._buffers: dict[int, bytes] = {}
        self._unpacked: dict[int, bytes] = {}
        self._accessors: dict[tuple[int, bool], np.ndarray] = {}

    def broken(self, problem: str, remedy: str = "Export it again") -> SceneError:
        return Where(self.path).error(f"mesh cannot be read: {problem}", remedy)

    def check_version(self) -> None:
        asset = self.tree.get("asset", {})
        version, least = str(asset.get("version")), str(asset.get("minVersion", "2.0"))
        if version[:2] != "2." or least != "2.0":
            problem = f"it is glTF {version if least == '2.0' else least}, not 2.0"
            raise self.broken(problem, "Convert it, e.g. with 'gltf-pipeline', or export it again")

    def _chunks(self, raw: bytes) -> tuple[bytes, bytes | None]:
        """The JSON of a GLB file, and its binary chunk."""
        chunks: dict[int, bytes] = {}
        start = _HEAD.size
        if len(raw) < start:
            raise self.broken("it ends early")
        _, version, length = _HEAD.unpack_from(raw)
        if version != 2:
            raise self.broken(f"it is GLB {version}, not 2", "Convert it, or export it again")
        while start + _CHUNK.size <= min(len(raw), length):
            size, kind = _CHUNK.unpack_from(raw, start)
            start += _CHUNK.size
            if len(raw) < start + size:
                raise self.broken("it ends early")
            chunks.setdefault(kind, raw[start : start + size])
            start += size
        if _JSON not in chunks:
            raise self.broken("it has no JSON chunk")
        return chunks[_JSON], chunks.get(_BINARY)

    def entries(self, kind: str) -> list[dict]:
        """The objects of a list of the file; empty where there is none."""
        if kind not in self._entries:
            objects = self.tree.get(kind, [])
            if not isinstance(objects, list) or not all(isinstance(item, dict) for item in objects):
                raise self.broken(f"{kind!r} is no list of objects")
            self._entries[kind] = objects
        return self._entries[kind]

    def entry(self, kind: str, index: Any) -> dict:
        """The object of an index in a list of the file."""
        entries = self.entries(kind)
        if not isinstance(index, int) or not 0 <= index < len(entries):
            raise self.broken(f"it names {kind}[{index!r}] of {len(entries)}")
        return entries[index]

    def numbers(self, holder: dict, key: str, default: Any) -> np.ndarray:
        """Finite numbers of the shape of ``default``, float64."""
        values = holder.get(key, default)
        try:
            array = np.asarray(values)
        except ValueError:  # lists of unlike lengths
            array = np.zeros(0, object)
        numeric = array.dtype.kind in "iuf" and array.shape == np.shape(default)
        if not numeric or not np.isfinite(array).all():
            raise self.broken(f"{key} is {str(values)[:40]!r}", "Give finite numbers")
        return array.astype(np.float64)

    def number(self, holder: dict, key: str, default: float) -> float:
        return float(self.numbers(holder, key, default))

    # -- bytes --------------------------------------------------------------------------------

    def data(self, uri: str, role: str) -> bytes:
        """The bytes of a data URI or of a file beside this one."""
        if not isinstance(uri, str):
            raise self.broken(f"the URI of a {role} is {uri!r}")
        head, comma, rest = uri.partition(",")
        if head[:5].lower() == "data:" and comma:
            try:
                plain = urllib.parse.unquote_to_bytes(rest)
                return base64.b64decode(plain) if head.lower().endswith(";base64") else plain
            except ValueError as error:
                raise self.broken(f"the data URI of a {role}: {error}") from None
        if "://" in uri:
            remedy = "Get it, and name the file in its place"
            raise self.broken(f"{role} {uri!r} is not fetched", remedy)
        as_written = self.path.parent / uri  # some writers do not escape names
        unescaped = self.path.parent / urllib.parse.unquote(uri)
        file = as_written if as_written.is_file() else unescaped
        return read_bytes(file, LARGEST_MESH, role)

    def _buffer(self, index: Any) -> bytes:
        if index not in self._buffers:
            uri = self.entry("buffers", index).get("uri")
            data = self._chunk if uri is None and index == 0 else b""
            if uri is not None:
                data = self.data(uri, "buffer")
            if not data:
                raise self.broken(f"buffer {index} has no data")
            self._buffers[index] = data
        return self._buffers[index]

    def _part(self, holder: dict) -> memoryview:
        """The bytes of a bufferView, or of compressed data in its place."""
        buffer = memoryview(self._buffer(holder.get("buffer")))
        start, length = holder.get("byteOffset", 0), holder.get("byteLength")
        whole = isinstance(start, int) and isinstance(length, int) and start >= 0 <= length
        if not whole or start + length > len(buffer):
            raise self.broken("a buffer ends early")
        return buffer[start : start + length]

    def view(self, index: Any) -> bytes | memoryview:
        """The bytes of a bufferView, unpacked."""
        view = self.entry("bufferViews", index)
        packed = extension(view, *MESHOPT)
        if packed is None:
            return self._part(view)
        if index not in self._unpacked:
            self._unpacked[index] = self._unpack(packed)
        return self._unpacked[index]

    def _unpack(self, packed: dict) -> bytes:
        try:
            import meshopt
        except ImportError:
            remedy = "Install the package meshopt, or unpack it with 'gltf-transform copy'"
            raise self.broken("its buffers are packed by meshoptimizer", remedy) from None
        count, stride = packed.get("count"), packed.get("byteStride")
        if not isinstance(count, int) or not isinstance(stride, int):
            raise self.broken("a packed buffer has no count and stride")
        if not 0 < count * stride <= MOST_UNPACKED:
            raise self.broken(f"a packed buffer of {count} elements of {stride} bytes")
        mode, change = packed.get("mode"), packed.get("filter")
        try:
            data = meshopt.decode_gltf_buffer(
                bytes(self._part(packed)), count, stride, mode, change
            )
        except (ValueError, RuntimeError) as error:
            raise self.broken(f"a packed buffer is damaged: {error}") from None
        return data.tobytes()

    # -- arrays -------------------------------------------------------------------------------

    def accessor(self, index: Any, *, unit: bool = False) -> np.ndarray:
        """(count, width) numbers of an accessor: as they are stored, or float64 where they are
        normalized; with ``unit`` all integers count as normalized."""
        key = index, unit
        if key not in self._accessors:
            entry = self.entry("accessors", index)
            self._accessors[key] = self.normalized(entry, self._values(entry), unit=unit)
        return self._accessors[key]

    @staticmethod
    def normalized(entry: dict, values: np.ndarray, *, unit: bool = False) -> np.ndarray:
        """Integers of a normalized accessor as float64 from -1 or 0 to 1; others as they are."""
        if values.dtype.kind == "f" or not (unit or entry.get("normalized") is True):
            return values
        return np.maximum(values / np.iinfo(values.dtype).max, -1.0)

    def _values(self, entry: dict) -> np.ndarray:
        count, width = entry.get("count"), WIDTHS.get(str(entry.get("type")))
        kind = COMPONENTS.get(entry.get("componentType", 0))
        if width is None or kind is None or not isinstance(count, int):
            raise self.broken("an accessor has no known type, component type or count")
        if not 0 <= count <= MOST_ELEMENTS:
            raise self.broken(f"an accessor of {count} elements")
        values = np.zeros((count, width), kind)
        if "bufferView" in entry:
            values = self._elements(entry, count, width, kind)
        sparse = entry.get("sparse")
        if sparse is None:
            return values
        changed, values = sparse["count"], values.copy()
        places = COMPONENTS[sparse["indices"]["componentType"]]
        at = self._elements(sparse["indices"], changed, 1, places)[:, 0]
        if len(at) and not 0 <= at.min() <= at.max() < count:
            raise self.broken(f"a sparse accessor changes element {at.max()} of {count}")
        values[at] = self._elements(sparse["values"], changed, width, kind)
        return values

    def _elements(self, entry: dict, count: int, width: int, kind: str) -> np.ndarray:
        view = self.entry("bufferViews", entry["bufferView"])
        data, start = self.view(entry["bufferView"]), entry.get("byteOffset", 0)
        item = np.dtype(kind).itemsize
        stride = view.get("byteStride", (extension(view, *MESHOPT) or {}).get("byteStride"))
        stride = stride if stride else item * width
        if not all(isinstance(number, int) and number >= 0 for number in (count, start, stride)):
            raise self.broken("an accessor's offset or stride makes no sense")
        if count and start + (count - 1) * stride + item * width > len(data):
            raise self.broken("an accessor ends beyond its bufferView")
        return np.ndarray((count, width), kind, data, start, (stride, item))

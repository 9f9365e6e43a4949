"""What a glTF file says beside its meshes: lights, cameras, extensions, and what is not rendered.

trimesh reads nodes, meshes, textures and factors; here is its JSON.  Source: Khronos, "glTF 2.0
Specification", and the extensions KHR_draco_mesh_compression, KHR_lights_punctual,
KHR_materials_unlit, KHR_materials_emissive_strength and KHR_texture_transform.
"""

import base64
import json
import math
import struct
import urllib.parse
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.reading import LARGEST_MESH, Where, read_bytes
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.framing import FoundCamera
from lfcore.scene.notes import LEFT_OUT, NOT_USED, Notebook
from lfcore.scene.surface_mesh import normalise, triple
from lfcore.scene.transforms import affine, parse_transform

SUFFIXES = (".glb", ".gltf")
GLOSSY, DRACO = "KHR_materials_pbrSpecularGlossiness", "KHR_draco_mesh_compression"
# Those that trimesh or this package knows; others may be used, but not required.
KNOWN = (
    "EXT_texture_webp",
    DRACO,
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    GLOSSY,
    "KHR_materials_unlit",
    "KHR_texture_transform",
)
BASIS = "KHR_texture_basisu"
REMEDIES = {
    BASIS: "Convert its KTX2 textures to PNG, JPEG or WebP, e.g. with 'gltf-transform "
    "ktxdecompress'"
}
"""What to do about a required extension; default: export the file without it."""
DEEPEST_NODE = 200
_HEAD, _CHUNK = struct.Struct("<4sII"), struct.Struct("<II")
_JSON = 0x4E4F534A
_TRIANGLES = (None, 4, 5)  # trimesh reads no fans


def found(holder: Any, kind: Any, *keys: str) -> Any:
    """What is of this kind below ``keys``; what is malformed counts as absent: None."""
    for key in keys:
        holder = holder.get(key) if isinstance(holder, dict) else None
    return holder if isinstance(holder, kind) else None


def has(entry: dict, extension: str) -> bool:
    """Whether an object of the file uses an extension."""
    return extension in (found(entry, dict, "extensions") or ())


class Document:
    """The JSON of a glTF or GLB file."""

    def __init__(self, path: str | Path):
        self.path = Path(path)
        raw = read_bytes(self.path, LARGEST_MESH, "mesh file")
        self._version: int | None = None
        text, self._rest = raw, b""
        if raw[:4] == b"glTF":
            self._version, text, self._rest = self._chunks(raw)
        try:
            self.tree = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise self._broken(f"its JSON cannot be read: {error}") from None
        if not isinstance(self.tree, dict):
            raise self._broken("its JSON is no object")
        unknown = self.extensions("Required") - set(KNOWN)
        # Where KTX2 is optional there is another picture, but exporters forget to require it.
        for texture in self.objects("textures"):
            alone = "source" not in texture and not has(texture, "EXT_texture_webp")
            if alone and has(texture, BASIS):
                unknown = {BASIS}
        if unknown:
            name, where = min(unknown), Where(self.path, "extensionsRequired")
            remedy = REMEDIES.get(name, "Export the file without it")
            raise where.error(f"needs the extension {name}, which is not known", remedy)

    def extensions(self, how: str) -> set[str]:
        """Names of extensions that are ``Used`` or ``Required``; empty where these are no list."""
        return set(map(str, found(self.tree, list, f"extensions{how}") or ()))

    def _broken(self, problem: str) -> SceneError:
        return Where(self.path).error(f"mesh cannot be read: {problem}", "Export it again")

    def _chunks(self, raw: bytes) -> tuple[int, bytes, bytes]:
        """The version of a GLB file, its JSON, and what follows."""
        start = _HEAD.size + _CHUNK.size
        if len(raw) < start:
            raise self._broken("it ends early")
        length, kind = _CHUNK.unpack_from(raw, _HEAD.size)
        if kind != _JSON or len(raw) < start + length:
            raise self._broken("it has no JSON chunk")
        return _HEAD.unpack_from(raw)[1], raw[start : start + length], raw[start + length :]

    def objects(self, *keys: str, of: dict | None = None) -> list[dict]:
        """The objects of a list below ``keys``; empty ones for what is malformed."""
        values = found(self.tree if of is None else of, list, *keys) or ()
        return [value if isinstance(value, dict) else {} for value in values]

    def entry(self, number: Any, *keys: str) -> dict | None:
        """The object of a number among those below ``keys``."""
        known = self.objects(*keys)
        return known[number] if isinstance(number, int) and 0 <= number < len(known) else None

    def view(self, number: int) -> bytes:
        """The bytes of a bufferView; raises as :class:`Document`, or a LookupError or TypeError."""
        view = self.tree["bufferViews"][number]
        buffer = self.tree["buffers"][view["buffer"]]
        start = view.get("byteOffset", 0)
        uri = buffer.get("uri")
        if uri is None:
            data, start = self._rest, start + _CHUNK.size
        elif uri.startswith("data:"):
            data = base64.b64decode(uri.partition(",")[2])
        else:
            data = read_bytes(self.path.parent / urllib.parse.unquote(uri), LARGEST_MESH, "buffer")
        part = data[start : start + view["byteLength"]]
        if len(part) < view["byteLength"]:
            raise self._broken("a buffer ends early")
        return part

    def pictures(self) -> Iterator[tuple[int, bytes]]:
        """Number and bytes of the images that textures take from within the file."""
        images, used = self.objects("images"), set()
        for texture in self.objects("textures"):
            webp = found(texture, object, "extensions", "EXT_texture_webp", "source")
            used |= {texture.get("source"), webp}
        for number, image in enumerate(images):
            uri, view = image.get("uri"), image.get("bufferView")
            if number in used and view is not None:
                yield number, self.view(view)
            elif number in used and isinstance(uri, str) and uri.startswith("data:"):
                yield number, base64.b64decode(uri.partition(",")[2])

    def readable(self) -> bytes:
        """The file with the number of each material as its name, so that it can be found again."""
        materials = [
            {**entry, "name": str(index)} for index, entry in enumerate(self.objects("materials"))
        ]
        text = json.dumps(self.tree | ({"materials": materials} if materials else {})).encode()
        if self._version is None:
            return text
        text += b" " * (-len(text) % 4)
        size = _HEAD.size + _CHUNK.size + len(text) + len(self._rest)
        head = _HEAD.pack(b"glTF", self._version, size) + _CHUNK.pack(len(text), _JSON)
        return head + text + self._rest

    def material(self, number: str) -> dict:
        """The material of a name that :meth:`readable` gave; empty for none."""
        return self.entry(int(number) if number.isdecimal() else None, "materials") or {}

    @cached_property
    def placed(self) -> list[tuple[dict, np.ndarray]]:
        """Nodes of the scene that is shown, with their (4, 4) node to world."""
        nodes, shown = self.objects("nodes"), self.entry(self.tree.get("scene", 0), "scenes")
        roots = list(range(len(nodes))) if shown is None else shown.get("nodes", [])
        return list(self._below(roots, np.eye(4), nodes, frozenset()))

    def _below(
        self, indices: Any, matrix: np.ndarray, nodes: list[Any], above: frozenset[int]
    ) -> Iterator[tuple[dict, np.ndarray]]:
        for index in indices if isinstance(indices, list) else ():
            if not isinstance(index, int) or not 0 <= index < len(nodes) or index in above:
                continue
            if len(above) > DEEPEST_NODE:
                raise self._broken(f"its nodes nest more than {DEEPEST_NODE} deep")
            here = matrix @ self._pose(nodes[index])
            yield nodes[index], here
            yield from self._below(nodes[index].get("children"), here, nodes, above | {index})

    def _pose(self, node: dict) -> np.ndarray:
        from scipy.spatial.transform import Rotation  # slow to import

        try:
            if "matrix" in node:
                return np.array(node["matrix"], np.float64).reshape(4, 4).T
            turn = Rotation.from_quat(np.array(node.get("rotation", (0, 0, 0, 1)), np.float64))
            size = np.array(node.get("scale", (1, 1, 1)), np.float64)
            return affine(turn.as_matrix() * size, node.get("translation", (0, 0, 0)))
        except (ValueError, TypeError, OverflowError) as error:
            raise self._broken(f"a node's pose makes no sense: {error}") from None

    def lights(self) -> list[Light]:
        """Its lights, in the world. Its candela and lux are over pi in ours, as a matte surface of
        colour c returns c / pi of what arrives in glTF."""
        where = "extensions", "KHR_lights_punctual"
        known = ((self.entry(found(node, int, *where, "light"), *where, "lights"), matrix)
                 for node, matrix in self.placed)  # fmt: skip
        return [self._light(light, matrix) for light, matrix in known if light is not None]

    def _light(self, light: dict, matrix: np.ndarray) -> Light:
        name, kind = light.get("name", "without name"), light.get("type")
        try:
            given = np.array(light.get("color", (1, 1, 1)), np.float64)
            colour = triple(given * float(light.get("intensity", 1.0)) / math.pi)
        except (ValueError, TypeError, OverflowError) as error:
            raise self._broken(f"light {name!r} makes no sense: {error}") from None
        if kind == "directional":
            # It shines along the node's -z.
            return Light(DIRECTIONAL, triple(normalise(matrix[:3, 2])), colour)
        lamp = Light(POINT, triple(matrix[:3, 3]), colour, 1.0)
        if kind != "spot":
            return lamp
        spot = found(light, dict, "spot") or {}
        angles = [spot.get("innerConeAngle", 0.0), spot.get("outerConeAngle", math.pi / 4)]
        if not all(isinstance(angle, (int, float)) for angle in angles) or not (
            0 <= angles[0] < angles[1] <= math.pi / 2 + 1e-6
        ):
            raise self._broken(f"the cone of light {name!r} makes no sense: {angles}")
        inner, outer = (max(math.cos(angle), 0.0) for angle in angles)
        return replace(lamp, normal=triple(-normalise(matrix[:3, 2])), cone=(inner, outer))

    def camera(self, notebook: Notebook) -> FoundCamera | None:
        """The first perspective camera of the scene; others are noted."""
        first = None
        for node, matrix in self.placed:
            camera = self.entry(node.get("camera"), "cameras")
            if camera is None:
                continue
            lens = found(camera, dict, "perspective")
            here = None if lens is None else self._perspective(lens, matrix)
            if here is None or first is not None:
                name = camera.get("name") or node.get("name") or node["camera"]
                notebook.add(NOT_USED, self.path, f"camera {name!r}")
            else:
                first = here
        return first

    def _perspective(self, lens: dict, matrix: np.ndarray) -> FoundCamera | None:
        angle, aspect = lens.get("yfov"), lens.get("aspectRatio", 1.0)
        axes = normalise(matrix[:3, :3].T).T
        square = np.allclose(axes.T @ axes, np.eye(3), atol=1e-4) and np.linalg.det(axes) > 0
        if not isinstance(angle, (int, float)) or not 0 < angle < math.pi or not square:
            return None
        narrow = min(float(aspect), 1.0) if isinstance(aspect, (int, float)) and aspect > 0 else 1.0
        return FoundCamera(affine(axes, matrix[:3, 3]), 2 * math.tan(angle / 2) * narrow)

    def note_what_is_left_out(self, notebook: Notebook) -> None:
        """Note what the file as a whole loses; materials note their own."""
        for key, kind in (("animations", "animation"), ("skins", "skin")):
            for index, entry in enumerate(self.objects(key)):
                what = f"{kind} {entry.get('name', index)!r}; the file's pose is shown"
                notebook.add(LEFT_OUT, self.path, what)
        for mesh in self.objects("meshes"):
            name = mesh.get("name", "without name")
            for primitive in self.objects("primitives", of=mesh):
                if primitive.get("mode") not in _TRIANGLES:
                    notebook.add(LEFT_OUT, self.path, f"points, lines or fans of mesh {name!r}")
                if primitive.get("targets"):
                    what = f"morph targets of mesh {name!r}; its rest shape is shown"
                    notebook.add(LEFT_OUT, self.path, what)
        for name in sorted(self.extensions("Used") - set(KNOWN)):
            notebook.add(LEFT_OUT, self.path, f"extension {name}")


def staging_of(
    description: dict, file: Path, notebook: Notebook
) -> tuple[list[Light], FoundCamera | None]:
    """Lights and a camera, in world space, of the glTF files of a checked description; what it
    overrides is noted."""
    lights: list[Light] = []
    camera: FoundCamera | None = None
    for index, entry in enumerate(description["objects"]):
        name = entry.get("file", "")
        if not name.lower().endswith(SUFFIXES):
            continue
        document = Document(file.parent / name)
        matrix = parse_transform(
            entry.get("transform", []), Where(file)["objects"][index]["transform"]
        )
        here = [moved(light, matrix) for light in document.lights()]
        own = document.camera(notebook)
        if here and "lights" in description:
            notebook.add(NOT_USED, document.path, f"{len(here)} lights: the scene has its own")
        else:
            lights += here
        if own is not None and ("pose" in description["camera"] or camera is not None):
            notebook.add(NOT_USED, document.path, "its camera: the scene has another")
        elif own is not None:
            pose = matrix @ own.to_world
            pose[:3, :3] = normalise(pose[:3, :3].T).T  # a scale makes no camera larger
            camera = replace(own, to_world=pose)
    return lights, camera


def moved(light: Light, matrix: np.ndarray) -> Light:
    """A light after an affine (4, 4) ``matrix``; what it sends stays."""
    if light.kind == POINT:
        vector = triple(matrix[:3, :3] @ light.vector + matrix[:3, 3])
        if light.is_spot:
            light = replace(light, normal=triple(normalise(matrix[:3, :3] @ light.normal)))
    else:
        vector = triple(normalise(matrix[:3, :3] @ light.vector))
    return replace(light, vector=vector)

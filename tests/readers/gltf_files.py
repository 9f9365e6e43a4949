"""A writer of small glTF files whose accessors may be of any kind."""

import base64
import io
import json

import numpy as np
from PIL import Image

CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], np.float32)
UVS = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)
COMPONENTS = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123, "uint32": 5125,
              "float32": 5126}  # fmt: skip
KINDS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


def png(picture):
    stream = io.BytesIO()
    Image.fromarray(np.asarray(picture, np.uint8)).save(stream, "PNG")
    return stream.getvalue()


class File:
    """A glTF tree to which a test adds what it asks for."""

    def __init__(self):
        self.data = b""
        self.tree = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}

    def add(self, kind, **entry):
        self.tree.setdefault(kind, []).append(entry)
        return len(self.tree[kind]) - 1

    def view(self, data, **more):
        self.data += b"\0" * (-len(self.data) % 4) + data
        start = len(self.data) - len(data)
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(data), **more)

    def accessor(self, array, *, stride=None, **more):
        """``stride``: bytes from one element to the next."""
        array = np.asarray(array)
        rows = array.reshape(len(array), -1)
        raw, extra = np.ascontiguousarray(rows).tobytes(), {}
        if stride:
            wide = np.full((len(rows), stride), 255, np.uint8)
            wide[:, : rows.strides[0]] = np.frombuffer(raw, np.uint8).reshape(len(rows), -1)
            raw, extra = wide.tobytes(), {"byteStride": stride}
        return self.add(
            "accessors", bufferView=self.view(raw, **extra), count=len(rows),
            componentType=COMPONENTS[array.dtype.name], type=KINDS[rows.shape[1]], **more,
        )  # fmt: skip

    def primitive(self, material=None, *, indices=FACES, **attributes):
        """A primitive of arrays, or of numbers of accessors; a square by default."""
        given = {"POSITION": CORNERS, **attributes}
        made = {k: v if isinstance(v, int) else self.accessor(v) for k, v in given.items()}
        entry = {"attributes": made}
        if indices is not None:
            entry["indices"] = indices if isinstance(indices, int) else self.accessor(indices)
        if material is not None:
            entry["material"] = self.add("materials", **material)
        return entry

    def node(self, *primitives, root=True, mesh=None, **node):
        if primitives:
            node["mesh"] = self.add("meshes", primitives=list(primitives), **(mesh or {}))
        index = self.add("nodes", **node)
        if root:
            self.tree["scenes"][0]["nodes"].append(index)
        return index

    def texture(self, picture=None, **more):
        picture = np.full((4, 4, 3), 128) if picture is None else picture
        uri = "data:image/png;base64," + base64.b64encode(png(picture)).decode()
        return {"index": self.add("textures", source=self.add("images", uri=uri), **more)}

    def use(self, *names):
        self.tree.setdefault("extensionsUsed", []).extend(names)

    def write(self, folder):
        uri = "data:application/octet-stream;base64," + base64.b64encode(self.data).decode()
        tree = {"buffers": [{"byteLength": len(self.data), "uri": uri}], **self.tree}
        path = folder / "file.gltf"
        path.write_text(json.dumps(tree))
        return path


def square(**attributes):
    """A file of one square."""
    file = File()
    file.node(file.primitive(**attributes))
    return file

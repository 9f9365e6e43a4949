"""Meshes of glTF files that are compressed by Draco, unpacked for any reader of glTF.

Source: Khronos, extension KHR_draco_mesh_compression; the decoder is Google's, in the package
DracoPy.
"""

import base64
import copy
from collections.abc import Callable

import numpy as np

EXTENSION = "KHR_draco_mesh_compression"
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}


def unpacked(tree: dict, view: Callable[[int], bytes]) -> dict:
    """A copy of a file's JSON whose meshes are in a buffer of their own, without the extension;
    ``view`` gives the bytes of the bufferView of a number."""
    import DracoPy

    tree = copy.deepcopy(tree)
    data = bytearray()
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            packed = primitive.get("extensions", {}).pop(EXTENSION, None)
            if packed is None:
                continue
            try:
                decoded = DracoPy.decode(view(packed["bufferView"]))
            except DracoPy.FileTypeException as error:
                raise ValueError(str(error)) from None
            arrays = {each["unique_id"]: each["data"] for each in decoded.attributes}
            for name, number in packed["attributes"].items():
                _store(tree, primitive["attributes"][name], arrays[number], data)
            if "indices" in primitive:
                _store(tree, primitive["indices"], decoded.faces.reshape(-1, 1), data)
    for names in ("extensionsUsed", "extensionsRequired"):
        tree[names] = [name for name in tree.get(names, []) if name != EXTENSION]
    text = base64.b64encode(data).decode()
    uri = f"data:application/octet-stream;base64,{text}"
    tree["buffers"].append({"byteLength": len(data), "uri": uri})
    return tree


def _store(tree: dict, accessor: int, values: np.ndarray, data: bytearray) -> None:
    """Append values (V, C) to ``data``, and make an accessor read them there."""
    entry = tree["accessors"][accessor]
    raw = np.ascontiguousarray(values, _DTYPES[entry["componentType"]]).tobytes()
    data.extend(bytes(-len(data) % 4))
    view = {"buffer": len(tree["buffers"]), "byteOffset": len(data), "byteLength": len(raw)}
    data.extend(raw)
    tree["bufferViews"].append(view)
    entry |= {"bufferView": len(tree["bufferViews"]) - 1, "byteOffset": 0, "count": len(values)}

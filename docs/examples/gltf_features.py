"""Write a glTF scene with every feature that lfcore renders, and some that it reports as left out.

    python docs/examples/gltf_features.py features.glb
    lfcore render features.glb -o features.png --pixels 512

Numpy and Pillow are all it needs; nothing is downloaded.
"""

import io
import json
import struct
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
from PIL import Image

TYPES = (5125, np.uint32), (5126, np.float32)
"""The component types of whole numbers and of floats."""
KINDS = [None, "SCALAR", "VEC2", "VEC3", "VEC4"]


class Glb:
    """A glTF tree and its binary chunk, to which parts are added."""

    def __init__(self):
        self.data, asset = b"", {"version": "2.0", "generator": "lfcore example"}
        self.tree = defaultdict(list, asset=asset, scene=0)

    def add(self, kind, **entry):
        self.tree[kind].append(entry)
        return len(self.tree[kind]) - 1

    def view(self, data):
        self.data += b"\0" * (-len(self.data) % 4)
        start = len(self.data)
        self.data += data
        return self.add("bufferViews", buffer=0, byteOffset=start, byteLength=len(data))

    def accessor(self, values):
        """Floats, (K,) or (K, 2 to 4), or whole numbers (K,)."""
        array = np.asarray(values)
        component, kind = TYPES[array.dtype.kind == "f"]
        array = array.astype(kind).reshape(len(array), -1)
        ends = {"min": array.min(0).tolist(), "max": array.max(0).tolist()}
        return self.add(
            "accessors", bufferView=self.view(array.tobytes()), componentType=component,
            count=len(array), type=KINDS[array.shape[1]], **ends,
        )  # fmt: skip

    def texture(self, picture, **more):
        stream = io.BytesIO()
        Image.fromarray(picture).save(stream, "PNG")
        image = self.add("images", bufferView=self.view(stream.getvalue()), mimeType="image/png")
        return {"index": self.add("textures", source=image), **more}

    def mesh(self, shape, material, **node):
        made = {name: self.accessor(values) for name, values in shape.items()}
        primitive = {"indices": made.pop("indices"), "attributes": made, "material": material}
        return self.add("nodes", mesh=self.add("meshes", primitives=[primitive]), **node)

    def write(self, path):
        self.tree["scenes"] = [{"nodes": list(range(len(self.tree["nodes"])))}]
        self.tree["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.tree).encode()
        text += b" " * (-len(text) % 4)
        data = self.data + b"\0" * (-len(self.data) % 4)
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
        chunks += struct.pack("<II", len(data), 0x004E4942) + data
        Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def square(width, height):
    """A square upright in x and y, its foot at the origin."""
    x, y = width / 2, height
    return {
        "POSITION": np.array([[-x, 0, 0], [x, 0, 0], [x, y, 0], [-x, y, 0]], float),
        "NORMAL": np.tile([0.0, 0.0, 1.0], (4, 1)),
        "TEXCOORD_0": np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float),
        "indices": [0, 1, 2, 0, 2, 3],
    }


def turned(axis, angle):
    """The rotation of a node, a quaternion, about x (0), y (1) or z (2)."""
    return [*(np.sin(angle / 2) * np.eye(3)[axis]).tolist(), np.cos(angle / 2)]


def ball(radius, rings):
    v, u = np.meshgrid(
        np.linspace(0, 1, rings + 1), np.linspace(0, 1, 2 * rings + 1), indexing="ij"
    )
    down, around = np.pi * v.ravel(), 2 * np.pi * u.ravel()
    normals = [np.sin(down) * np.sin(around), np.cos(down), np.sin(down) * np.cos(around)]
    normals = np.stack(normals, 1)
    first = (np.arange(rings)[:, None] * (2 * rings + 1) + np.arange(2 * rings)).ravel()
    below = first + 2 * rings + 1
    faces = np.stack([first, below, below + 1, first, below + 1, first + 1], 1).reshape(-1, 3)
    # The triangles of no area at both poles, every other one, are left out.
    keep = np.ones(len(faces), bool)
    keep[1 : 4 * rings : 2] = keep[-4 * rings :: 2] = False
    uvs = np.stack([u.ravel(), v.ravel()], 1)
    return {"POSITION": radius * normals, "NORMAL": normals, "TEXCOORD_0": uvs,
            "indices": faces[keep].ravel()}  # fmt: skip


def grid(size):
    """The texels' x and y from 0 to 1, y down."""
    at = (np.arange(size) + 0.5) / size
    return np.meshgrid(at, at)


def codes(*channels):
    return np.rint(255 * np.clip(np.stack(channels, -1), 0, 1)).astype(np.uint8)


def checks(low, high):
    x, y = grid(64)
    odd = ((2 * x).astype(int) + (2 * y).astype(int)) % 2
    return codes(*(np.where(odd, a, b) for a, b in zip(low, high, strict=True)))


def leaf():
    """A leaf whose outline and gaps are in the alpha channel, as a mask."""
    x, y = grid(256)
    along = np.clip(1 - y, 0, 1)
    half = 0.42 * np.sin(np.pi * along**0.7) + 0.012
    side = np.abs(x - 0.5)
    gaps = (np.abs((along + 0.9 * side) * 9 % 1 - 0.5) > 0.36) & (side > 0.12 * half)
    alpha = np.where((side < half) & ~(gaps & (side > 0.06)), 1.0, 0.0)
    vein = np.where(side < 0.012, 0.25, 0.0)
    return codes(0.2 + vein + 0.1 * along, 0.5 + vein, 0.14 + vein, alpha)


def veil():
    """Soft spots with different transparency."""
    x, y = grid(128)
    alpha = 0.5 + 0.5 * np.sin(2 * np.pi * 4 * x) * np.sin(2 * np.pi * 4 * y)
    return codes(0.75 + 0 * x, 0.3 + 0 * x, 0.35 + 0 * x, alpha)


def bumps():
    """The normals of a wave, with slopes up to 0.9."""
    x, y = grid(256)
    dx = np.cos(2 * np.pi * 8 * x) * np.sin(2 * np.pi * 4 * y)
    dy = -np.sin(2 * np.pi * 8 * x) * np.cos(2 * np.pi * 4 * y)  # v points down, y up
    normal = np.stack([-0.9 * dx, -0.9 * dy, np.ones_like(x)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return codes(*np.moveaxis(normal / 2 + 0.5, -1, 0))


def metals():
    """Bands of polished metal and dull paint: green is roughness, blue is metal."""
    _, y = grid(64)
    metal = ((y * 6).astype(int) % 2).astype(float)
    return codes(0 * y, np.where(metal > 0, 0.25, 0.8), metal)


def windows():
    x, y = grid(64)
    lit = (np.abs(x * 3 % 1 - 0.5) < 0.3) & (np.abs(y * 3 % 1 - 0.5) < 0.3)
    return codes(np.where(lit, 1.0, 0.0), np.where(lit, 0.75, 0.0), np.where(lit, 0.35, 0.0))


def rainbow():
    x, y = grid(64)
    return codes(
        *(0.5 + 0.5 * np.cos(2 * np.pi * (x + shift)) * (1 - y) for shift in (0, 0.33, 0.67))
    )


def pbr(metallic, roughness, **more):
    return {"metallicFactor": metallic, "roughnessFactor": roughness, **more}


def add_things(glb, rings=32):
    """Add the objects; balls have this number of rings."""

    def made(shape, place, name, surface, turn=(0, 0), **entry):
        material = glb.add("materials", name=name, pbrMetallicRoughness=surface, **entry)
        glb.mesh(shape, material, translation=place, rotation=turned(*turn))

    fine = {"KHR_texture_transform": {"scale": [5, 5], "rotation": 0.3}}
    floor = glb.texture(checks((0.75, 0.72, 0.68), (0.5, 0.48, 0.46)), extensions=fine)
    flat = 0, -np.pi / 2
    made(square(6, 6), [0, 0, 3], "floor", pbr(0, 0.9, baseColorTexture=floor), flat)
    gold = pbr(1, 0.3, baseColorFactor=[1, 0.77, 0.34, 1])
    made(ball(0.35, rings), [-0.95, 0.35, 0.2], "gold", gold)
    banded = pbr(1, 1, baseColorFactor=[0.6, 0.75, 0.9, 1])
    banded["metallicRoughnessTexture"] = glb.texture(metals())
    made(ball(0.35, rings), [-0.1, 0.35, 0.1], "bands", banded)
    red = pbr(0, 0.35, baseColorFactor=[0.75, 0.15, 0.1, 1])
    bumpy = {"normalTexture": glb.texture(bumps(), scale=0.8),
             "occlusionTexture": glb.texture(checks((1, 1, 1), (0.9, 0.9, 0.9)))}  # fmt: skip
    made(ball(0.35, rings), [0.75, 0.35, 0.2], "bumps", red, **bumpy)
    cut = {"doubleSided": True, "alphaMode": "MASK", "alphaCutoff": 0.5}
    green = pbr(0, 0.8, baseColorTexture=glb.texture(leaf()))
    material = glb.add("materials", name="leaf", pbrMetallicRoughness=green, **cut)
    for x, z, turn in ((-1.5, -0.6, 0.3), (-0.9, -0.9, -0.2), (1.35, -0.3, -0.5)):
        glb.mesh(square(0.8, 1.3), material, translation=[x, 0, z], rotation=turned(1, turn))
    soft = pbr(0, 0.9, baseColorTexture=glb.texture(veil()))
    clear = {"doubleSided": True, "alphaMode": "BLEND"}
    made(square(0.9, 0.9), [0.25, 0, -0.75], "veil", soft, **clear)
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 1.5},
                "KHR_materials_clearcoat": {"clearcoatFactor": 1.0}}  # fmt: skip
    dark = pbr(0, 0.6, baseColorFactor=[0.1, 0.1, 0.12, 1])
    lamp = {"emissiveFactor": [1, 1, 1], "emissiveTexture": glb.texture(windows())}
    made(square(0.7, 1.1), [1.1, 0, -1.1], "lamp", dark, extensions=strength, **lamp)
    sign, unlit = {"baseColorTexture": glb.texture(rainbow())}, {"KHR_materials_unlit": {}}
    made(square(3.2, 0.5), [0, 1.0, -1.6], "sign", sign, extensions=unlit)
    tent = np.array([[-0.2, 0, 0.2], [0.2, 0, 0.2], [0, 0, -0.15], [0, 0.35, 0.05]])
    paint = np.array([[1, 0.1, 0.1, 1], [0.1, 1, 0.1, 1], [0.1, 0.1, 1, 1], [1, 1, 0.6, 1]])
    shape = {"POSITION": tent, "indices": [0, 1, 3, 1, 2, 3, 2, 0, 3], "COLOR_0": paint}
    made(shape, [0.3, 0, 0.75], "tent", pbr(0, 1))


def add_staging(glb):
    """Add lights, a camera, and features that lfcore leaves out."""
    lights = [
        {"type": "spot", "name": "lamp above", "color": [1, 0.95, 0.85], "intensity": 40,
         "spot": {"innerConeAngle": 0.3, "outerConeAngle": 0.45}},
        {"type": "directional", "name": "moon", "color": [0.7, 0.8, 1], "intensity": 1.6},
        {"type": "point", "name": "candle", "color": [1, 0.6, 0.3], "intensity": 1.2},
    ]  # fmt: skip
    glb.tree["extensions"] = {"KHR_lights_punctual": {"lights": lights}}

    def aimed(eye, at):
        """A node at ``eye`` whose -z points to ``at``."""
        back = np.subtract(eye, at) / np.linalg.norm(np.subtract(eye, at))
        right = np.cross([0, 1, 0], back) / np.linalg.norm(np.cross([0, 1, 0], back))
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.stack([right, np.cross(back, right), back], 1), eye
        return {"matrix": pose.T.ravel().tolist()}

    poses = [aimed([-1.3, 2.6, -2.6], [0, 0, 0.3]), aimed([1.2, 2, 3], [0, 0, 0])]
    for number, pose in enumerate([*poses, {"translation": [1.0, 0.9, 0.9]}]):
        glb.add("nodes", extensions={"KHR_lights_punctual": {"light": number}}, **pose)
    lens = {"yfov": 0.62, "aspectRatio": 1.0, "znear": 0.1}
    glb.add("cameras", type="perspective", perspective=lens)
    glb.add("nodes", camera=0, **aimed([0.4, 2.6, 4.2], [0, 0.4, -0.1]))
    place = np.float32(glb.tree["nodes"][1]["translation"])
    end = glb.accessor(np.float32([0, 1])), glb.accessor(np.stack([place, place + [0, 1, 0]]))
    glb.tree["animations"] = [{
        "name": "bounce", "samplers": [{"input": end[0], "output": end[1]}],
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
    }]  # fmt: skip
    glb.tree["extensionsUsed"] = [
        "KHR_lights_punctual", "KHR_texture_transform", "KHR_materials_unlit",
        "KHR_materials_emissive_strength", "KHR_materials_clearcoat",
    ]  # fmt: skip


def main(arguments: list[str]) -> None:
    if len(arguments) != 1:
        sys.exit(__doc__)
    glb = Glb()
    add_things(glb)
    add_staging(glb)
    glb.write(arguments[0])


if __name__ == "__main__":
    main(sys.argv[1:])

"""3MF files: triangles of the objects that are built, with their colours, in metres, y up.

Source: 3MF Consortium, "3D Manufacturing Format Core Specification 1.3", "Materials and Properties
Extension 1.2", "Production Extension 1.1".
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.readers.account import Account
from lfcore.readers.xml import parse
from lfcore.readers.zips import opened, unpacked
from lfcore.reading import Where
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh
from lfcore.scene.transforms import affine, rotate, scale

SUFFIXES = (".3mf",)
UNITS = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip
"""Metres of the units."""
COLOURS = {"basematerials": "displaycolor", "colorgroup": "color"}
"""The groups that have colours, and the attribute of their members."""
LOST = {
    "texture2dgroup": "groups of textures", "compositematerials": "mixed materials",
    "multiproperties": "groups of several properties", "beamlattice": "lattices",
    "slicestack": "stacks of slices",
}  # fmt: skip
"""The elements that are not read, and what they are."""
MOST_PARTS = 1 << 16
"""The most placed objects, components that are shown again counted."""
DEEPEST = 100
"""The deepest nesting of components."""


def read_3mf(data: bytes, path: Path, notebook: Notebook, account: Account) -> list[SurfaceMesh]:
    """Read the parts of a file, one per placed object with triangles."""
    archive = opened(path, data)
    names = [name for name in archive.namelist() if name.lower().endswith(".model")]
    models = {f"/{name}": parse(unpacked(path, archive, name)) for name in names}
    if not models:
        raise ValueError("its archive has no model")
    for element, noun in LOST.items():
        number = sum(1 for model in models.values() for _ in model.iter(element))
        account.hold(noun, number)
        if number:
            account.lose(noun, LEFT_OUT, noun, number)
    roots = [name for name, model in models.items() if model.find("build/item") is not None]
    if not roots:
        raise ValueError("it builds no object")
    root = roots[0]
    unit = models[root].get("unit", "millimeter")
    if unit not in UNITS:
        raise Where(path).error(f"unit {unit!r} is not known", f"Give {', '.join(UNITS)}")
    return list(_Models(models, account).parts(root, rotate("x", -90) @ scale(UNITS[unit])))


class _Models:
    """The objects and colours of all models of an archive, by model and id."""

    def __init__(self, models: dict[str, ET.Element], account: Account):
        self.models, self.account = models, account
        self.objects = {
            (name, each.get("id")): each
            for name, model in models.items() for each in model.iterfind("resources/object")
        }  # fmt: skip
        self.colours = {
            (name, each.get("id")): np.array([_rgb(member.get(key, "")) for member in each])
            for name, model in models.items() for tag, key in COLOURS.items()
            for each in model.iterfind(f"resources/{tag}")
        }  # fmt: skip
        self._meshes: dict[tuple, SurfaceMesh] = {}

    def parts(self, root: str, to_metres: np.ndarray) -> Iterator[SurfaceMesh]:
        """Yield the placed objects of the root model."""
        items = self.models[root].findall("build/item")
        waiting = [(root, item, to_metres, 1) for item in reversed(items)]
        shown = 0
        while waiting:
            model, reference, above, depth = waiting.pop()
            shown += 1
            if shown > MOST_PARTS or depth > DEEPEST:
                raise ValueError("its objects go round in circles")
            model = next((v for k, v in reference.items() if k.endswith("}path")), model)
            key, here = (model, reference.get("objectid")), above @ _matrix(reference)
            self.account.hold("placed objects")
            if key not in self.objects:
                what = f"object {str(key[1])[:40]!r}, which is not in the file"
                self.account.lose("placed objects", LEFT_OUT, what)
                continue
            self.account.use("placed objects")
            components = self.objects[key].findall("components/component")
            waiting += [(model, each, here, depth + 1) for each in reversed(components)]
            if self.objects[key].find("mesh") is not None:
                if key not in self._meshes:
                    self._meshes[key] = self._mesh(model, self.objects[key])
                yield self._meshes[key].transformed(here)

    def _mesh(self, model: str, element: ET.Element) -> SurfaceMesh:
        vertices = [
            [each.get(axis, "nan") for axis in "xyz"]
            for each in element.iterfind("mesh/vertices/vertex")
        ]
        triangles = element.findall("mesh/triangles/triangle")
        corners = [[each.get(name, "-1") for name in ("v1", "v2", "v3")] for each in triangles]
        points = np.array(vertices, np.float64).reshape(-1, 3)
        index = np.array(corners, np.int64).reshape(-1, 3)
        if len(index) and not 0 <= index.min() <= index.max() < len(points):
            raise ValueError(f"a triangle names vertex {index.max()} of {len(points)}")
        self.account.hold("triangles", len(index))
        self.account.use("triangles", len(index))
        name, colours = element.get("name", ""), self._colours(model, element, triangles)
        surface = Surface(name or "3mf", (0.8 if colours is None else 1.0,) * 3)
        return SurfaceMesh(points[index], surface, colours=colours)

    def _colours(
        self, model: str, element: ET.Element, triangles: list[ET.Element]
    ) -> np.ndarray | None:
        """Return (T, 3, 3) linear colours of corners; None without any."""
        colours, has_any = np.full((len(triangles), 3, 3), 0.8), False
        group, first = element.get("pid"), element.get("pindex", "0")
        for number, triangle in enumerate(triangles):
            table = self.colours.get((model, triangle.get("pid", group)))
            if table is None:
                continue
            own = triangle.get("p1", first)
            picks = [int(triangle.get(name, own)) for name in ("p1", "p2", "p3")]
            if not 0 <= min(picks) <= max(picks) < len(table):
                raise ValueError(f"a triangle names colour {max(picks)} of {len(table)}")
            colours[number], has_any = table[picks], True
        return colours if has_any else None


def _matrix(element: ET.Element) -> np.ndarray:
    """Return (4, 4) of an attribute ``transform``, three rows of axes and one of the offset."""
    words = element.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0").split()
    rows = np.array(words, np.float64).reshape(4, 3)
    return affine(rows[:3].T, rows[3])


def _rgb(text: str) -> np.ndarray:
    """Return the linear colour of ``#RRGGBB`` or ``#RRGGBBAA``."""
    codes = bytes.fromhex(text.removeprefix("#"))
    if len(codes) not in (3, 4):
        raise ValueError(f"{text[:40]!r} is no colour")
    return srgb_decode(np.array([*codes[:3]]) / 255.0)

"""COLLADA files and their archives: polygons of the visual scene, in metres, y up.

Source: Khronos, "COLLADA 1.4.1" and "1.5.0 Digital Asset Schema Release Specification".
"""

import xml.etree.ElementTree as ET
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.readers.account import Account
from lfcore.readers.collada_materials import Materials, below, floats
from lfcore.readers.polygons import fan_faces, strip_faces, triangulate
from lfcore.readers.text import whole
from lfcore.readers.xml import parse
from lfcore.readers.zips import opened, unpacked
from lfcore.reading import Where
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import SurfaceMesh, normalise
from lfcore.scene.transforms import affine, rotate, scale, translate

SUFFIXES = (".dae", ".zae")
STRIPS = {"tristrips": strip_faces, "trifans": fan_faces}
NUMBERS = {"POSITION": 3, "NORMAL": 3, "COLOR": 3, "TEXCOORD": 2}
"""The least numbers per element of an input."""
PRIMITIVES = ("triangles", "polylist", "polygons", *STRIPS)
LOST = {
    "instance_camera": "cameras", "instance_light": "lights", "animation": "animations",
    "lines": "lines", "linestrips": "lines", "morph": "morph targets", "spline": "splines",
    "skin": "skins; the pose in which they were bound is shown", "convex_mesh": "convex hulls",
    "bump": "bumps", "h": "holes of polygons", "skew": "skewed nodes",
    "brep": "curved surfaces",
}  # fmt: skip
"""The elements that are not read, and what they are."""
DAMAGED = LookupError, TypeError, ValueError, ArithmeticError, AttributeError, RecursionError
"""What a file raises that is no COLLADA."""
MOST_NODES = 1 << 20
"""The most nodes of a scene, those that are shown again counted."""
DEEPEST = 1000
"""The deepest nesting of nodes."""


def read_collada(
    data: bytes, path: Path, notebook: Notebook, account: Account
) -> list[SurfaceMesh]:
    """The parts of a file, one per list of polygons and place; normals are those of the file."""
    try:
        with np.errstate(all="ignore"):  # bad vertices are dropped later
            return _File(data, path, account).parts()
    except DAMAGED as error:
        reason = " ".join(str(error).split())[:120]
        raise ValueError(reason or type(error).__name__) from error


@dataclass
class _Polygons:
    """Triangles of a list of polygons, with the symbol of its material; ``uvs`` by their set."""

    symbol: str
    part: SurfaceMesh
    uvs: dict[int, np.ndarray]


class _File:
    def __init__(self, data: bytes, path: Path, account: Account):
        self.path, self.account = path, account
        self.archive: zipfile.ZipFile | None = None
        if data[:2] == b"PK":
            self.archive = opened(path, data)
            inner = [name for name in self.archive.namelist() if name.lower().endswith(".dae")]
            if not inner:
                raise ValueError("its archive has no COLLADA file")
            data = unpacked(path, self.archive, inner[0])
        self.root = parse(data)
        self.known = {e.get("id", ""): e for e in self.root.iter()}
        self.materials = Materials(path, self.known, account, self.archive)
        self._read: dict[int, list[_Polygons]] = {}

    def parts(self) -> list[SurfaceMesh]:
        """All parts that the scene shows."""
        count = self.account
        for tag, noun in LOST.items():
            number = sum(1 for _ in self.root.iter(tag))
            count.hold(noun, number)
            if number:
                count.lose(noun, LEFT_OUT, noun, number)
        scene = self.target(below(self.root, "scene/instance_visual_scene"))
        parts, nodes = (
            [],
            [(node, self._to_metres(), 1) for node in reversed(scene.findall("node"))],
        )
        shown = 0
        while nodes:
            node, above, depth = nodes.pop()
            shown += 1
            if shown > MOST_NODES or depth > DEEPEST:
                raise ValueError("its nodes go round in circles")
            here = above @ self._pose(node)
            for child in node:
                if child.tag in ("instance_geometry", "instance_controller"):
                    parts += [part.transformed(here) for part in self._instance(child)]
            more = [self.target(child) for child in node.findall("instance_node")]
            nodes += [(child, here, depth + 1) for child in [*node.findall("node"), *more]]
        for noun in ("geometry", "material"):
            count.hold(f"elements {noun!r}", sum(1 for _ in self.root.iter(noun)))
        count.use("elements 'geometry'", len(self._read))
        count.use("elements 'material'", self.materials.used)
        return parts

    def target(self, element: ET.Element | None, key: str = "url") -> ET.Element:
        """The element that another names."""
        if element is None:
            raise ValueError("it has no scene")
        name = element.get(key, "")
        if not name.startswith("#") or name[1:] not in self.known:
            raise ValueError(f"it names {name[:40]!r}, which is not in the file")
        return self.known[name[1:]]

    def _to_metres(self) -> np.ndarray:
        """(4, 4) from the file's unit and axes to metres, y up."""
        unit, metres = self.root.find("asset/unit"), 1.0
        if unit is not None:
            try:
                metres = float(unit.get("meter", "1").replace(",", "."))
            except ValueError:
                metres = 0.0
        if not 1e-12 < metres < 1e12:
            raise Where(self.path).error("its unit makes no sense", "Mend <unit meter=...>")
        axis = (self.root.findtext("asset/up_axis") or "Y_UP").strip()
        turned = {"X_UP": rotate("z", 90), "Z_UP": rotate("x", -90)}
        return turned.get(axis, np.eye(4)) @ scale(metres)

    def _pose(self, node: ET.Element) -> np.ndarray:
        """(4, 4) of a node to the one above, its steps multiplied in their order."""
        matrix = np.eye(4)
        for step in node:
            if step.tag not in ("matrix", "translate", "rotate", "scale", "lookat"):
                continue
            values = floats(step)
            if step.tag == "matrix":
                matrix = matrix @ values.reshape(4, 4)
            elif step.tag == "translate":
                matrix = matrix @ translate(*values)
            elif step.tag == "scale":
                matrix = matrix @ np.diag([*values, 1.0])
            elif step.tag == "rotate":
                if values[:3].any():
                    matrix = matrix @ rotate(values[:3].tolist(), values[3])
            else:
                eye, interest, up = values.reshape(3, 3)
                back = normalise(eye - interest)
                right = normalise(np.cross(up, back))
                matrix = matrix @ affine(np.stack([right, np.cross(back, right), back], -1), eye)
        return matrix

    # -- geometry -----------------------------------------------------------------------------

    def _instance(self, instance: ET.Element) -> Iterator[SurfaceMesh]:
        """The parts of a geometry, or of the one below a skin or morph, with their materials."""
        bound, matrix = self.target(instance), np.eye(4)
        for _ in range(8):  # skins of morphs
            if bound.tag != "controller":
                break
            (inner,) = [each for each in bound if each.tag in ("skin", "morph")]
            shape = inner.find("bind_shape_matrix")
            matrix = matrix if shape is None else matrix @ floats(shape).reshape(4, 4)
            bound = self.target(inner, "source")
        if id(bound) not in self._read:
            self._read[id(bound)] = list(self._geometry(bound))
        bindings = {each.get("symbol"): each for each in instance.iter("instance_material")}
        for polygons in self._read[id(bound)]:
            binding = bindings.get(polygons.symbol)
            if binding is None and polygons.symbol:
                what = f"material {polygons.symbol!r}, bound to nothing; the default is used"
                self.account.lose("materials", LEFT_OUT, what, 0)
            if binding is None and not polygons.symbol and len(bindings) == 1:
                (binding,) = bindings.values()  # exporters leave out the name of the only one
            part = self.materials.placed(polygons.part, polygons.uvs, binding)
            yield part.transformed(matrix)

    def _geometry(self, geometry: ET.Element) -> Iterator[_Polygons]:
        for primitive in geometry.iterfind("mesh/*"):
            if primitive.tag in PRIMITIVES:
                polygons = self._polygons(primitive)
                if polygons.part.count:
                    yield polygons

    def _polygons(self, primitive: ET.Element) -> _Polygons:
        inputs = primitive.findall("input")
        places = [int(each.get("offset", 0)) for each in inputs]
        width = max(places, default=0) + 1
        lists = [whole(floats(p)) for p in primitive.iter("p")]
        index = np.concatenate([np.zeros(0, np.int64), *lists])
        if len(index) % width:
            raise ValueError(f"a list of {primitive.tag} is cut short")
        index = index.reshape(-1, width)
        columns: dict[tuple[str, int], tuple[np.ndarray, np.ndarray]] = {}
        for each, place in zip(inputs, places, strict=True):
            self._column(each, index[:, place], int(each.get("set", 0)), columns)
        if ("POSITION", 0) not in columns:
            raise ValueError("polygons have no positions")
        points, of_points = columns["POSITION", 0]
        for name, (values, of_values) in columns.items():
            if len(of_values) and not 0 <= of_values.min() <= of_values.max() < len(values):
                raise ValueError(f"a face names element {of_values.max()} of {len(values)} {name}")
            if values.shape[1] < (least := NUMBERS.get(name[0], 0)):
                raise ValueError(f"{name[0]} has {values.shape[1]} of {least} numbers per element")
        if primitive.tag in STRIPS:
            ends = np.cumsum([0, *(len(each) // width for each in lists)])
            make = STRIPS[primitive.tag]
            pieces = [a + make(np.arange(b - a)) for a, b in pairwise(ends)]
            corners = np.concatenate([np.zeros((0, 3), np.int64), *pieces])
        else:
            counts = np.full(len(index) // 3, 3)
            if primitive.tag == "polylist":
                counts = whole(floats(primitive.find("vcount")))
            elif primitive.tag == "polygons":
                counts = np.array([len(each) // width for each in lists], np.int64)
            if counts.sum() != len(index):
                raise ValueError(f"a list of {primitive.tag} has not as many corners as it says")
            corners, _ = triangulate(points[:, :3], of_points, counts, self.account)
        values_of = {name: values[at[corners]] for name, (values, at) in columns.items()}
        sets = {
            number: uv[..., :2] for (name, number), uv in values_of.items() if name == "TEXCOORD"
        }
        normals = values_of.get(("NORMAL", 0))
        colours = next((rgb for (name, _), rgb in values_of.items() if name == "COLOR"), None)
        part = SurfaceMesh(
            values_of["POSITION", 0][..., :3],
            normals=None if normals is None else normals[..., :3],
            colours=None if colours is None else srgb_decode(np.clip(colours[..., :3], 0, 1)),
        )  # fmt: skip
        return _Polygons(primitive.get("material", ""), part, sets)

    def _column(
        self, declared: ET.Element, at: np.ndarray, number: int,
        columns: dict[tuple[str, int], tuple[np.ndarray, np.ndarray]],
    ) -> None:  # fmt: skip
        """Put the values of an input, and which of them each corner has, among the columns."""
        semantic, source = declared.get("semantic", ""), self.target(declared, "source")
        if semantic == "VERTEX":
            for each in source.findall("input"):
                self._column(each, at, int(each.get("set", 0)), columns)
            return
        name = f"inputs {semantic[:16]!r}"
        self.account.hold(name)
        if semantic in ("POSITION", "NORMAL", "TEXCOORD", "COLOR"):
            self.account.use(name)
            key = semantic, number if semantic == "TEXCOORD" else 0
            columns.setdefault(key, (self._values(source), at))

    def _values(self, source: ET.Element) -> np.ndarray:
        """(count, width) float64 of a source, by its accessor."""
        access = below(source, "technique_common/accessor")
        array = floats(self.target(access, "source"))
        stride, start = int(access.get("stride", 1)), int(access.get("offset", 0))
        count = int(access.get("count", 0))
        if not (0 < stride and 0 <= start and 0 <= count and start + count * stride <= len(array)):
            raise ValueError("a source ends early")
        return array[start : start + count * stride].reshape(count, stride)

"""The triangles of a glTF file: packed, morphed, with skins, and many times.

Source: Khronos, "glTF 2.0 Specification", section 3.7, and the extensions
KHR_draco_mesh_compression and EXT_mesh_gpu_instancing.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.readers.account import Account
from lfcore.readers.content import Content, Played
from lfcore.readers.gltf.animations import Animation
from lfcore.readers.gltf.document import Document, extension
from lfcore.readers.gltf.extensions import DRACO, note_extensions
from lfcore.readers.gltf.materials import Surfaces
from lfcore.readers.gltf.nodes import Nodes
from lfcore.readers.polygons import fan_faces, strip_faces
from lfcore.reading import Where
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import SurfaceMesh, join, shaded

NOT_FACES = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
"""The modes of primitives without triangles."""
LIST, STRIP, FAN = 4, 5, 6
VALUES = {"POSITION": {3}, "NORMAL": {3}, "TEXCOORD": {2}, "COLOR": {3, 4}, "JOINTS": {4},
          "WEIGHTS": {4}}  # fmt: skip
"""The numbers per vertex of each attribute."""
MOST_TRIANGLES = 1 << 28
"""The largest number of triangles of a file, its instances counted."""


def read_gltf(
    path: Path,
    notebook: Notebook,
    *,
    shading: str = "auto",
    crease_deg: float = 40.0,
    animation: str | None = None,
) -> Content:
    """Read a glTF or GLB file.

    ``shading`` is ``auto`` (the file's normals, else flat, as glTF has it), ``smooth`` (but for
    edges beyond ``crease_deg``) or ``flat``; ``animation`` is the name of the one that is played.

    Raises :class:`SceneError` for what is damaged, and for what needs an unknown extension.
    """
    document, account = Document(path), Account(notebook, path)
    with _named(document):
        document.check_version()
        note_extensions(document, account)
        played = Animation(document, account, animation)
        start, end = played.span or (0.0, 0.0)
        nodes = Nodes(document, account, played.at(start))
        meshes = Meshes(document, nodes, account, shading, crease_deg)
        content = Content(meshes.parts(), nodes.lights(), nodes.camera())
        meshes.close()
    account.close()
    if not played.curves:
        return content

    def at(time_s: float) -> Content:
        unheard = Account(Notebook(), path)
        with _named(document):
            nodes = Nodes(document, unheard, played.at(time_s))
            meshes.move(nodes, unheard)
            return Content(meshes.parts(), nodes.lights(), nodes.camera())

    return content._replace(animation=Played(start, end, at))


@contextmanager
def _named(document: Document) -> Iterator[None]:
    """Errors in the block, of a tree that makes no sense, name the file."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError) as error:
        reason = " ".join(str(error).split())[:120]
        problem = f"its JSON makes no sense: {type(error).__name__}: {reason}"
        raise document.broken(problem) from error
    except MemoryError:
        remedy = "Split it, or use a machine with more memory"
        raise document.broken("there is not enough memory for it", remedy) from None


class Meshes:
    """The parts of the nodes that are shown."""

    def __init__(
        self, document: Document, nodes: Nodes, account: Account, shading: str, crease_deg: float
    ):
        self.document, self.nodes, self.account = document, nodes, account
        self.shading, self.crease_deg = shading, crease_deg
        self.surfaces = Surfaces(document, account)
        self._plain: dict[tuple[int, int], SurfaceMesh | None] = {}
        self._counted: set[tuple[int, int]] = set()
        self._triangles, self._drawn = False, 0

    def parts(self) -> list[SurfaceMesh]:
        """The parts of all nodes, in the world."""
        parts: list[SurfaceMesh] = []
        self._drawn = 0
        for index, matrix in self.nodes.shown:
            node = self.nodes.entries[index]
            if "mesh" in node:
                parts += self._of_node(index, node, self.nodes.instances(node, matrix))
        if not self._triangles:
            remedy = "Export triangles, not only points or lines"
            raise Where(self.document.path).error("mesh holds no triangles", remedy)
        return parts

    def close(self) -> None:
        """Count what is used."""
        shown = [self.nodes.entries[index] for index, _ in self.nodes.shown]
        for what, key in (("meshes", "mesh"), ("skins", "skin")):
            self.account.hold(what, len(self.document.entries(what)))
            self.account.use(what, len({node[key] for node in shown if key in node}))
        self.surfaces.close()

    def move(self, nodes: Nodes, account: Account) -> None:
        """Take another pose of the nodes."""
        self.nodes, self.account, self.surfaces.account = nodes, account, account

    def _of_node(self, index: int, node: dict, matrices: list[np.ndarray]) -> list[SurfaceMesh]:
        mesh, parts = self.document.entry("meshes", node["mesh"]), []
        weights = self.nodes.pose.get((index, "weights"), node.get("weights"))
        for number, primitive in enumerate(mesh["primitives"]):
            key = node["mesh"], number
            skinned = "skin" in node and {"JOINTS_0", "WEIGHTS_0"} <= set(primitive["attributes"])
            if skinned or weights is not None:
                part = self._part(key, node, mesh, primitive, skinned, weights)
            else:
                if key not in self._plain:
                    self._plain[key] = self._part(key, node, mesh, primitive, skinned, weights)
                part = self._plain[key]
            if part is None:
                continue
            poses = [np.eye(4)] if skinned else matrices  # a skinned mesh is where its joints are
            self._drawn += len(poses) * part.count
            if self._drawn > MOST_TRIANGLES:
                raise self.document.broken(f"it has more than {MOST_TRIANGLES} triangles")
            still = len(poses) == 1 and np.array_equal(poses[0], np.eye(4))
            if poses:
                parts.append(part if still else join([part.transformed(pose) for pose in poses]))
        return parts

    def _part(
        self,
        key: tuple[int, int],
        node: dict,
        mesh: dict,
        primitive: dict,
        skinned: bool,
        weights: Any,
    ) -> SurfaceMesh | None:
        """A primitive in its mesh's coordinates, or in the world if it is ``skinned``.

        None for a primitive without triangles, and for one that alpha removes wholly.
        """
        count = self.account
        if key in self._counted:  # for another node
            count = Account(Notebook(), self.document.path)
        self._counted.add(key)
        count.hold("primitives")
        mode, name = primitive.get("mode", LIST), mesh.get("name", node["mesh"])
        if mode in NOT_FACES or "POSITION" not in primitive["attributes"]:
            words = NOT_FACES.get(mode, "triangles without positions")
            count.lose("primitives", LEFT_OUT, f"{words} of mesh {name!r}")
            return None
        if weights is None:
            weights = mesh.get("weights", ())
        data = Primitive(self.document, primitive, weights)
        faces = data.faces(mode)
        self._triangles |= len(faces) > 0
        look = self.surfaces.look(primitive.get("material"))
        if look.surface is None:
            count.lose("primitives", LEFT_OUT, "")
            return None
        positions = data.array("POSITION")
        normals = data.attribute("NORMAL") if self.shading == "auto" else None
        shading = "flat" if self.shading == "auto" and normals is None else self.shading
        if skinned:
            bones = self._bones(node["skin"], data)
            positions, normals = _posed(bones, positions, normals)
        if len(faces) and not 0 <= faces.min() <= faces.max() < len(positions):
            problem = f"face names vertex {int(faces.max())} of {len(positions)}"
            raise self.document.broken(problem)
        triangles = positions[faces].astype(np.float64)
        if normals is not None:
            normals = normals[faces].astype(np.float64)
        coordinates = data.attribute(f"TEXCOORD_{look.texture_set}")
        uvs = None
        if coordinates is not None:
            uvs = self.surfaces.uvs(look, coordinates[faces].astype(np.float64))
        elif look.surface.has_textures:
            words = f"textures of material {look.name!r}: mesh {name!r} has no coordinates for them"
            count.lose("primitives", LEFT_OUT, words, 0)
        colours = data.attribute("COLOR_0")
        if colours is not None:
            self.surfaces.note_colours(look, colours)
            colours = np.clip(colours[faces][..., :3].astype(np.float64), 0, 1)
        count.use("primitives")
        moved = any(path == "weights" for _, path in self.nodes.pose)
        data.count(count, bent=look.surface.normal_texture is not None, moved=moved)
        part = SurfaceMesh(triangles, look.surface, normals, uvs, colours)
        return shaded(part, shading, self.crease_deg)

    def _bones(self, skin: Any, data: "Primitive") -> np.ndarray:
        """(V, 3, 4) from each vertex to the world, of a skin's pose."""
        entry = self.document.entry("skins", skin)
        if not entry.get("joints"):
            raise self.document.broken(f"skin {skin} has no joints")
        to_world = np.stack([self.nodes.world(joint) for joint in entry["joints"]])
        if "inverseBindMatrices" in entry:
            inverse = self.document.accessor(entry["inverseBindMatrices"]).astype(np.float64)
            if len(inverse) < len(to_world):
                problem = f"skin {skin} has {len(inverse)} bind matrices for {len(to_world)} joints"
                raise self.document.broken(problem)
            to_world = to_world @ inverse[: len(to_world)].reshape(-1, 4, 4).swapaxes(1, 2)
        bones: Any = 0.0
        total: Any = 0.0
        number = 0
        while (joints := data.attribute(f"JOINTS_{number}")) is not None:
            shares = data.array(f"WEIGHTS_{number}")
            if not 0 <= joints.min(initial=0) <= joints.max(initial=0) < len(to_world):
                raise self.document.broken(f"skin {skin} has no joint {joints.max()}")
            for joint, share in zip(joints.T, shares.T, strict=True):
                bones = bones + share[:, None, None] * to_world[joint.astype(np.int64), :3]
                total = total + share
            number += 1
        return bones / np.where(total == 0, 1.0, total)[:, None, None]


def _posed(
    bones: np.ndarray, positions: np.ndarray, normals: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Vertices and normals (V, 3), each moved by its own (3, 4) matrix."""
    turn = bones[:, :, :3]
    moved = np.einsum("vij,vj->vi", turn, positions) + bones[:, :, 3]
    if normals is None:
        return moved, None
    a, b, c = turn.swapaxes(0, 1)
    cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    mirrored = np.sign(np.einsum("vi,vi->v", a, cofactor[:, 0]))[:, None]
    return moved, mirrored * np.einsum("vij,vj->vi", cofactor, normals)


class Primitive:
    """The arrays of a primitive, its morph targets added by their ``weights``.

    ``names`` are the attributes that were asked for.
    """

    def __init__(self, document: Document, entry: dict, weights: Any):
        self.document, self.entry = document, entry
        self.targets = list(zip(entry.get("targets", ()), weights, strict=False))
        self.names: set[str] = set()
        packed = extension(entry, DRACO)
        self._packed: dict[str, np.ndarray] = {}
        self._faces: np.ndarray | None = None
        if packed is not None:
            self._packed, self._faces = self._unpack(packed)

    def array(self, name: str) -> np.ndarray:
        """(V, width) of an attribute that there must be."""
        values = self.attribute(name)
        if values is None:
            raise self.document.broken(f"a primitive has no {name}")
        return values

    def attribute(self, name: str) -> np.ndarray | None:
        """(V, width) of an attribute; None where it has none."""
        if name not in self.entry["attributes"]:
            return None
        self.names.add(name)
        document, unit = self.document, name.startswith(("COLOR_", "WEIGHTS_"))
        index = self.entry["attributes"][name]
        values = document.accessor(index, unit=unit) if name not in self._packed else (
            document.normalized(document.entry("accessors", index), self._packed[name], unit=unit)
        )  # fmt: skip
        for target, weight in self.targets:
            if weight and name in target:
                added = document.accessor(target[name], unit=unit).astype(np.float64)
                values = values + weight * added
        if values.shape[1] not in VALUES[name.partition("_")[0]]:
            raise document.broken(f"{name} has {values.shape[1]} numbers per vertex")
        return values

    def faces(self, mode: int) -> np.ndarray:
        """(T, 3) int64 indices of corners."""
        if self._faces is not None:
            return self._faces
        if "indices" in self.entry:
            indices = self.document.accessor(self.entry["indices"])[:, 0].astype(np.int64)
        else:
            index = self.entry["attributes"]["POSITION"]
            indices = np.arange(self.document.entry("accessors", index)["count"])
        if mode == LIST:
            return indices[: len(indices) // 3 * 3].reshape(-1, 3)
        if mode not in (STRIP, FAN):
            raise self.document.broken(f"a primitive of mode {mode!r}")
        return (strip_faces if mode == STRIP else fan_faces)(indices)

    def count(self, account: Account, *, bent: bool, moved: bool) -> None:
        """Count the attributes and morph targets, and those that are used.

        Tangents matter only if a texture bends the normals (``bent``); all targets may be used if
        weights are ``moved`` by an animation."""
        for name in self.entry["attributes"]:
            account.hold(f"attributes {name}")
            used = name in self.names or (name == "TANGENT" and not bent)
            account.use(f"attributes {name}", int(used))
        account.hold("morph targets", len(self.entry.get("targets", ())))
        account.use("morph targets", sum(moved or bool(weight) for _, weight in self.targets))

    def _unpack(self, packed: dict) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """The attributes and faces of a mesh that Draco compressed."""
        try:
            import DracoPy
        except ImportError:
            remedy = "Install the package DracoPy, or export the file without compression"
            raise self.document.broken("its meshes are compressed by Draco", remedy) from None
        data = bytes(self.document.view(packed["bufferView"]))
        try:
            mesh = DracoPy.decode(data)
        except Exception as error:  # it raises many kinds
            raise self.document.broken(f"Draco's data: {error}") from None
        data_of = {attribute["unique_id"]: attribute["data"] for attribute in mesh.attributes}
        return (
            {name: data_of[number] for name, number in packed["attributes"].items()},
            np.asarray(mesh.faces, np.int64).reshape(-1, 3),
        )

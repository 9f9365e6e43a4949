"""3MF and 3DXML through trimesh, which needs packages of theirs.

The unit and upward axis of 3MF are applied.  Source: 3MF Consortium, "3D Manufacturing Format Core
Specification 1.3".
"""

import io
import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.readers.account import Account
from lfcore.readers.zips import opened, unpacked
from lfcore.reading import LARGEST_MESH, LARGEST_TEXT, Where, read_bytes
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import SurfaceMesh, transform_all
from lfcore.scene.transforms import rotate, scale
from lfcore.scene.trimesh_parts import parts_of

MANUFACTURING = (".3mf",)
PACKAGES = dict.fromkeys((*MANUFACTURING, ".3dxml"), "lxml and networkx")
"""The packages with which trimesh reads a format."""
UNITS = {
    "micron": 1e-6, "millimeter": 1e-3, "centimeter": 1e-2, "inch": 0.0254, "foot": 0.3048,
    "meter": 1.0,
}  # fmt: skip
"""Metres of 3MF's units."""
LOST = {
    "basematerials": "groups of materials", "colorgroup": "groups of colours",
    "texture2dgroup": "groups of textures", "compositematerials": "groups of materials",
    "beamlattice": "lattices", "slicestack": "stacks of slices",
}  # fmt: skip
"""The elements of 3MF that trimesh does not read."""


def read_other(
    path: Path, notebook: Notebook, shading: str, crease_deg: float
) -> list[SurfaceMesh]:
    """The parts of a file, metres, y up; parts that trimesh ignores are counted and noted.

    Raises :class:`SceneError` for a damaged file, or names the missing package.
    """
    kind, account = path.suffix.lower(), Account(notebook, path)
    data = read_bytes(path, LARGEST_MESH, "mesh file")
    text = _text(path, data)
    remedies = {}
    for element, what in LOST.items():
        number = len(re.findall(rb"<(?:\w+:)?%s\b" % element.encode(), text))
        account.hold(what, number)
        if number:
            account.lose(what, LEFT_OUT, what, number)
            remedies["remedy"] = f"Export triangles: its {what} are not read"
    with without_ghostscript():
        scene = _load(path, data, account)
        parts = parts_of(scene, path, shading=shading, crease_deg=crease_deg, **remedies)
    for what, number in (("parts", len(parts)), ("triangles", sum(part.count for part in parts))):
        account.hold(what, number)
        account.use(what, number)
    account.close()
    return transform_all(parts, _to_metres(path, kind, text))


@contextmanager
def without_ghostscript() -> Iterator[None]:
    """Within the block, Pillow starts no program on a texture that holds PostScript."""
    from PIL import EpsImagePlugin

    before, EpsImagePlugin.gs_binary = EpsImagePlugin.gs_binary, False
    try:
        yield
    finally:
        EpsImagePlugin.gs_binary = before


def _text(path: Path, data: bytes) -> bytes:
    """The XML of a 3MF file; nothing of another."""
    if data[:2] != b"PK":
        return b""
    with opened(path, data) as archive:
        names = [name for name in archive.namelist() if name.lower().endswith(".model")]
        return b"\n".join(unpacked(path, archive, name) for name in names)


def _to_metres(path: Path, kind: str, text: bytes) -> np.ndarray:
    """(4, 4) from a file's unit and axes to metres, y up."""
    if kind not in MANUFACTURING:
        return np.eye(4)
    unit = re.search(rb"<(?:\w+:)?model\b[^>]*\bunit\s*=\s*[\"'](\w+)", text)
    name = unit[1].decode() if unit else "millimeter"
    if name not in UNITS:
        raise Where(path).error(f"unit {name!r} is not known", f"Give {', '.join(UNITS)}")
    return rotate("x", -90) @ scale(UNITS[name])


class Warnings(logging.Handler):
    """Notes what trimesh only warns of."""

    def __init__(self, account: Account):
        super().__init__(logging.WARNING)
        self.account, self.logger = account, logging.getLogger("trimesh")

    def emit(self, record: logging.LogRecord) -> None:
        self.account.lose("warnings", LEFT_OUT, record.getMessage())

    def __enter__(self) -> None:
        self.logger.addHandler(self)
        self.logger.propagate = False

    def __exit__(self, *_: object) -> None:
        self.logger.removeHandler(self)
        self.logger.propagate = True


def _load(path: Path, data: bytes, account: Account) -> Any:
    import trimesh  # the heaviest import of the package
    from trimesh.resolvers import FilePathResolver

    class Resolver(FilePathResolver):
        """Reads side files within bounds of size; trimesh goes on without them."""

        def get(self, name: str) -> bytes:
            account.hold("side files")
            try:
                content = read_bytes(path.parent / name.strip(), LARGEST_TEXT)
            except SceneError:
                account.lose("side files", LEFT_OUT, f"file {name!r}, which cannot be read")
                raise
            account.use("side files")
            return content

    suffix = path.suffix.lower()
    kind = suffix[1:]
    if kind not in trimesh.available_formats():
        remedy = "Convert it to GLB, e.g. with Blender"
        if package := PACKAGES.get(suffix):
            remedy = f"Install {package}, or export the mesh as GLB"
        raise Where(path).error(f"no reader for mesh files named *{path.suffix}", remedy)
    try:
        resolver = Resolver(str(path), allow_anywhere=True)
        with io.BytesIO(data) as stream, Warnings(account):
            return trimesh.load_scene(stream, file_type=kind, resolver=resolver, process=False)
    except SceneError:
        raise
    except ImportError as error:
        remedy = f"Install {PACKAGES.get(suffix, error.name)}, or export the mesh as GLB"
        raise Where(path).error(f"a package is missing: {error.name}", remedy) from None
    except Exception as error:  # trimesh's readers raise many kinds of errors
        reason = f"it is damaged, or no {suffix.lstrip('.').upper()} file"
        remedy = "Export it again, or open it in a mesh viewer to see what is damaged"
        raise Where(path).error(f"mesh cannot be read: {reason}", remedy) from error

"""Mesh files of the common formats: OBJ with MTL, PLY, STL, OFF, COLLADA, 3MF, GLB."""

import io
import runpy
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from zipfile import ZipFile

import trimesh
from hypothesis import strategies as st

from lfcore.readers.load import load_scene
from robustness.inputs import Inputs, damaged_bytes, damaged_text
from robustness.outcome import SEEDS, Outcome, outcome_of
from robustness.scene_checks import check_scene
from robustness.targets import Target
from robustness.targets.scenes import MTL, OBJ, PLY, write_sides

FEATURES = Path(__file__).parents[2] / "docs/examples/gltf_features.py"
MATERIALS = b"\n#### material library\n"
"""The line before the MTL in an input of the target ``obj``."""


def seeds_of(kind: str, folder: Path) -> list[bytes]:
    box = trimesh.creation.icosphere(subdivisions=1)
    if kind == "obj":
        return [OBJ.encode() + MATERIALS + MTL.encode(), OBJ.encode().replace(b"mtllib", b"#")]
    if kind == "ply":
        return [PLY.encode(), box.export(file_type="ply")]
    if kind == "off":
        colours = b"COFF\n3 1 0\n0 0 1 255 0 0\n1 0 1 0 255 0\n0 1 1 0 0 9\n3 0 1 2\n"
        return [colours, box.export(file_type="off").encode()]
    if kind == "stl":
        return [(SEEDS / "one.stl").read_bytes(), box.export(file_type="stl")]
    if kind == "dae":
        return [(SEEDS / "one.dae").read_bytes()]
    if kind == "3mf":
        with ZipFile(folder / "one.3mf", "w") as archive:
            archive.write(SEEDS / "one.model", "3D/3dmodel.model")
        return [(folder / "one.3mf").read_bytes()]
    write_sides(folder)
    textured = trimesh.load_scene(folder / "mesh.obj").export(file_type="glb")
    return [box.export(file_type="glb"), textured, every_feature(folder / "features.glb")]


def every_feature(file: Path) -> bytes:
    """Return the manual's scene with every glTF feature that we read, with coarse balls."""
    module = runpy.run_path(str(FEATURES))
    glb = module["Glb"]()
    module["add_things"](glb, rings=3)
    module["add_staging"](glb)
    glb.write(file)
    return file.read_bytes()


def judge(kind: str, data: bytes, folder: Path) -> Outcome:
    file = folder / f"input.{kind}"
    if kind == "obj":
        data, _, materials = data.partition(MATERIALS)
        (folder / "mesh.mtl").write_bytes(materials)
    file.write_bytes(data)
    return outcome_of(lambda: check_scene(load_scene(file, bare=True)), names=str(folder))


def damaged_3mf(seeds: Sequence[bytes]) -> Inputs:
    """Return archives with damaged bytes, or with a damaged model."""

    def packed(model: bytes) -> bytes:
        with ZipFile(file := io.BytesIO(), "w") as archive:
            archive.writestr("3D/3dmodel.model", model)
        return file.getvalue()

    return damaged_bytes(seeds) | damaged_text([(SEEDS / "one.model").read_bytes()]).map(packed)


def damaged_glb(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds with damaged bytes, or a damaged JSON part, whose length is corrected."""
    texts = [damaged_text([_json(seed)]).map(partial(_with_json, seed)) for seed in seeds]
    return damaged_bytes(seeds) | st.one_of(texts)


def _json(glb: bytes) -> bytes:
    return glb[20 : 20 + int.from_bytes(glb[12:16], "little")]


def _with_json(glb: bytes, text: bytes) -> bytes:
    rest = glb[20 + len(_json(glb)) :]
    text += b" " * (-len(text) % 4)
    total = 20 + len(text) + len(rest)
    sizes = total.to_bytes(4, "little") + len(text).to_bytes(4, "little")
    return glb[:8] + sizes + glb[16:20] + text + rest


def targets() -> list[Target]:
    inputs = {
        "obj": damaged_text, "ply": damaged_text, "stl": damaged_text, "off": damaged_text,
        "dae": damaged_text, "3mf": damaged_3mf, "glb": damaged_glb,
    }  # fmt: skip
    return [
        Target(kind, partial(seeds_of, kind), damaged, partial(judge, kind), write_sides)
        for kind, damaged in inputs.items()
    ]

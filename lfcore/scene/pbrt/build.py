"""From a .pbrt file to a :class:`~lfcore.scene.model.Scene`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lfcore.scene.assemble import assemble
from lfcore.scene.model import Scene
from lfcore.scene.motion import Moving, is_rigid, motions
from lfcore.scene.notes import LEFT_OUT, Notebook
from lfcore.scene.parts import Part, merge
from lfcore.scene.pbrt.interpreter import Interpreter, Item
from lfcore.scene.pbrt.lights import AREA_LIGHT_POINTS
from lfcore.scene.pbrt.parser import read_directives
from lfcore.scene.pbrt.shapes import TOLERANCE


def build_pbrt_scene(
    path: str | Path,
    *,
    tolerance: float = TOLERANCE,
    area_light_points: int = AREA_LIGHT_POINTS,
) -> Scene:
    """Read a pbrt scene of version 3, or of version 4 where the same words mean the same.

    Parameters
    ----------
    path : the .pbrt file (``.pbrt.gz`` too).
    tolerance : of curved shapes, as a share of their radius.
    area_light_points : point lights that stand for one area light.

    Raises
    ------
    SceneError : a file that cannot be read or is not a scene; it names file, line and token.
    """
    path = Path(path)
    notebook = Notebook()
    interpreter = Interpreter(path.parent, notebook, tolerance, area_light_points)
    interpreter.run(read_directives(path, notebook))
    parts, moving = _parts(interpreter, notebook)
    static = merge(parts)
    geometry = assemble(static + [part for part, _ in moving], np.eye(4))
    rig = interpreter.rig
    return Scene(
        name=path.name.removesuffix(".gz").removesuffix(".pbrt"),
        camera=interpreter.view.camera,
        triangles=geometry.triangles,
        normals=geometry.normals,
        uvs=geometry.uvs,
        colours=geometry.colours,
        material_ids=geometry.material_ids,
        materials=geometry.materials,
        textures=geometry.textures,
        lights=rig.lights,
        ambient=tuple(rig.ambient.tolist()),
        background=tuple(rig.background.tolist()),
        dropped=geometry.dropped,
        view=interpreter.view,
        notes=notebook.notes(),
        motions=motions(geometry, static, moving),
    )


def _parts(interpreter: Interpreter, notebook: Notebook):
    """Parts in camera space: those at rest, and those that move with their two poses."""
    parts: list[Part] = []
    moving: list[Moving] = []
    for item in interpreter.items:
        poses = tuple(interpreter.world_to_camera @ matrix for matrix in item.matrices)
        part = _place(interpreter, item, poses[0])
        interpreter.light(item, part.triangles)
        if part.surface is None:
            notebook.add(LEFT_OUT, item.place, "a shape whose material is no surface")
        elif np.array_equal(poses[0], poses[1]):
            parts.append(part)
        elif is_rigid(*poses):
            moving.append((part, poses))
        else:
            notebook.add(LEFT_OUT, item.place, "motion that is not rigid: shutter open's pose")
            parts.append(part)
    return parts, moving


def _place(interpreter: Interpreter, item: Item, to_camera: np.ndarray) -> Part:
    """The item's triangles in camera space, front sides counter-clockwise."""
    uvs, surface = interpreter.uvs(item)
    mesh = item.mesh
    part = Part(mesh.triangles, surface, mesh.normals, uvs).transformed(to_camera)
    mirrored = np.linalg.det(to_camera[:3, :3]) < 0
    normals = part.normals
    if item.reversed and normals is not None:
        normals = -normals
    if mirrored == item.reversed:
        return Part(part.triangles, surface, normals, uvs)
    order = [0, 2, 1]
    pick = lambda values: None if values is None else values[:, order]  # noqa: E731
    return Part(part.triangles[:, order], surface, pick(normals), pick(uvs))

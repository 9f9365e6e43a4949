"""From a .pbrt file to a :class:`~lfcore.scene.model.Scene`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.scene.assemble import Geometry, assemble
from lfcore.scene.model import Scene
from lfcore.scene.parts import Part, merge
from lfcore.scene.pbrt.camera import View
from lfcore.scene.pbrt.interpreter import Interpreter, Item
from lfcore.scene.pbrt.lights import AREA_LIGHT_POINTS
from lfcore.scene.pbrt.motion import Motion, is_rigid, scene_at
from lfcore.scene.pbrt.notes import LEFT_OUT, Note, Notebook, summary
from lfcore.scene.pbrt.parser import read_directives
from lfcore.scene.pbrt.shapes import TOLERANCE


@dataclass(frozen=True)
class PbrtScene(Scene):
    """A scene read from pbrt's format.

    Attributes
    ----------
    view : the camera and film: kind, thin lens, camera array, resolution, shutter.
    notes : everything that could not be mapped exactly, with file and line.
    motions : triangles that move while the shutter is open.
    """

    view: View | None = None
    notes: tuple[Note, ...] = ()
    motions: tuple[Motion, ...] = ()

    def summary(self) -> str:
        """The notes as text, one a line, what is missing first."""
        return summary(self.notes)

    def at(self, time: float) -> Scene:
        """The scene at ``time`` of the shutter, 0 open and 1 closed."""
        return scene_at(self, self.motions, time)


def build_pbrt_scene(
    path: str | Path,
    *,
    tolerance: float = TOLERANCE,
    area_light_points: int = AREA_LIGHT_POINTS,
) -> PbrtScene:
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
    motions = _motions(geometry, static, moving)
    rig = interpreter.rig
    return PbrtScene(
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
        motions=motions,
    )


def _parts(interpreter: Interpreter, notebook: Notebook):
    """Parts in camera space: those at rest, and those that move with their two poses."""
    parts: list[Part] = []
    moving: list[tuple[Part, tuple[np.ndarray, np.ndarray]]] = []
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


def _motions(geometry: Geometry, static: list[Part], moving) -> tuple[Motion, ...]:
    """Where the moving parts ended up among the triangles that were kept."""
    if not moving:
        return ()
    from lfcore.scene.assemble import sound

    first = sum(int(sound(part.triangles)[0].sum()) for part in static)
    motions = []
    for part, (start, end) in moving:
        count = int(sound(part.triangles)[0].sum())
        motions.append(Motion(first, count, start, end))
        first += count
    assert first == len(geometry.triangles)
    return tuple(motions)

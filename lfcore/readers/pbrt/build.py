"""Builds a :class:`~lfcore.scene.model.Scene` from a .pbrt file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.readers.pbrt.interpreter import Interpreter, Item
from lfcore.readers.pbrt.parser import read_directives
from lfcore.reading import Where
from lfcore.scene.assemble import LARGEST_COORDINATE, assemble, sound
from lfcore.scene.baked import BakeOptions
from lfcore.scene.emitters import POINTS
from lfcore.scene.model import Scene
from lfcore.scene.motion import Moving, is_rigid, motions
from lfcore.scene.notes import APPROXIMATED, ASSUMED, LEFT_OUT, Notebook, first_instant
from lfcore.scene.sky import under
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, merge

MOST_LIGHT_POINTS = 1024
"""The most point lights per emitting shape and side."""


def build_pbrt_scene(path: str | Path, *, light_points: int = POINTS) -> Scene:
    """Read a pbrt scene of version 3, or of version 4 as far as its words have the same meaning.

    ``light_points`` point lights represent each shape of an area light, per side.
    """
    path = Path(path)
    notebook = Notebook()
    if not 1 <= light_points <= MOST_LIGHT_POINTS:
        problem = f"cannot represent an area light: {light_points} points"
        raise Where("", "light_points").error(problem, f"Give 1 to {MOST_LIGHT_POINTS}")
    interpreter = Interpreter(path.parent, notebook, light_points)
    interpreter.run(read_directives(path, notebook))
    # Overflowing triangles are dropped and counted.
    with np.errstate(over="ignore", invalid="ignore"):
        static, moving, emitters = _parts(interpreter, notebook)
    geometry = assemble(static + [part for part, _ in moving], np.eye(4))
    if geometry.dropped:
        remedy = "Check for zero-area triangles and huge coordinates"
        geometry.refuse_none(Where(path, "Shape"), remedy)
    moves = motions(geometry, static, moving)
    for motion, (part, _), item in zip(moves, moving, emitters, strict=True):
        if item is not None:
            words = "light of a moving shape; it shines from its pose when the shutter opens"
            notebook.add(APPROXIMATED, item.place, words)
            _check_emitter(item, part)
            interpreter.light(item, part.triangles, (motion.first, motion.first + motion.count))
    rig, view = interpreter.rig, interpreter.view
    assert view is not None  # set by WorldBegin
    if moves:
        notebook.add(ASSUMED, path, first_instant(*view.motion_times))
    scene = Scene(
        name=path.name.removesuffix(".gz").removesuffix(".pbrt"),
        camera=view.camera,
        lights=rig.lights,
        ambient=(0.0, 0.0, 0.0),
        view=view,
        notes=notebook.notes(),
        motions=moves,
        **geometry.arrays,
    )
    return replace(under(scene, rig.sky), bake=BakeOptions()) if len(rig.sky) else scene


def _parts(
    interpreter: Interpreter, notebook: Notebook
) -> tuple[list[SurfaceMesh], list[Moving], list[Item | None]]:
    """Parts in camera space: resting parts, moving parts with two poses, and the latter's emitters.

    Resting emitters come first, so that lights can name their triangles.
    """
    emitting: list[SurfaceMesh] = []
    matt: list[SurfaceMesh] = []
    moving: list[Moving] = []
    emitters: list[Item | None] = []
    first = 0
    for item in interpreter.items:
        poses = tuple(interpreter.world_to_camera @ matrix for matrix in item.matrices)
        part, is_surface = _place(interpreter, item, poses[0])
        emits = any(item.emission)
        rests = np.array_equal(poses[0], poses[1])
        if is_surface and not rests and is_rigid(*poses):
            moving.append((part, poses))
            emitters.append(item if emits else None)
            continue
        if not is_surface:
            notebook.add(LEFT_OUT, item.place, "a shape whose material is no surface")
        elif not rests:
            words = "motion that is not rigid; the pose when the shutter opens is shown"
            notebook.add(LEFT_OUT, item.place, words)
        count = 0
        if is_surface:
            (emitting if emits else matt).append(part)
            count = int(sound(part.triangles)[0].sum()) if emits else 0
        if emits:
            _check_emitter(item, part)
            interpreter.light(item, part.triangles, (first, first + count))
            first += count
    return emitting + merge(matt), moving, emitters


def _check_emitter(item: Item, part: SurfaceMesh) -> None:
    if not (np.abs(part.triangles) <= LARGEST_COORDINATE).all():
        problem = f"an emitter reaches farther than {LARGEST_COORDINATE:g} m from the camera"
        raise item.place.error(problem, "Move it nearer, or use a distant light")


def _place(interpreter: Interpreter, item: Item, to_camera: np.ndarray) -> tuple[SurfaceMesh, bool]:
    """The item's triangles in camera space, front sides counter-clockwise, and whether they are
    visible: some materials are no surface."""
    uvs, surface = interpreter.uvs(item)
    part = replace(item.mesh, surface=surface or Surface(), uvs=uvs).transformed(to_camera)
    mirrored = np.linalg.det(to_camera[:3, :3]) < 0
    if item.reversed and part.normals is not None:
        part = replace(part, normals=-part.normals)
    if mirrored != item.reversed:
        part = part.picked((slice(None), [0, 2, 1]))
    return part, surface is not None

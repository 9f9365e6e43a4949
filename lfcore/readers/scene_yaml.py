"""A checked scene.yaml and its files as the scene that the tracer sees."""

import dataclasses
import math
import os
from functools import partial
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.camera import Camera, check_focus
from lfcore.optics.size import Size
from lfcore.readers.content import Content
from lfcore.readers.gltf.document import SUFFIXES
from lfcore.readers.meshes import read_mesh
from lfcore.readers.replay import Objects, Replay
from lfcore.readers.side_files import read_texture
from lfcore.readers.up_axis import z_seems_up
from lfcore.reading import Where
from lfcore.scene import framing, procedural, studio
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.assemble import COLOURS, assemble
from lfcore.scene.baked import ASKS, BakeOptions
from lfcore.scene.limits import within_limits
from lfcore.scene.model import Scene
from lfcore.scene.motion import Animation, is_rigid, motions
from lfcore.scene.notes import ASSUMED, NOT_USED, Note, Notebook, first_instant
from lfcore.scene.reflections import with_reflection_notes
from lfcore.scene.surface_mesh import SurfaceMesh, parse_colour, transform_all, triple
from lfcore.scene.transforms import parse_transform
from lfcore.scene.view import View, lightfield_view

INSTANTS = 5
"""The instants of an animation that a camera frames."""


def build(
    description: dict,
    *,
    file: Path,
    name: str,
    note_up: bool,
    alone: bool,
    lens: Camera | None = None,
    size: Size = framing.SQUARE,
) -> Scene:
    """The scene of a checked and completed description; paths are relative to ``file``, and
    ``lens`` takes the place of the description's.  A mesh that is ``alone`` is given a studio, and
    a camera that frames the scene fits pictures of ``size``."""
    where, notebook = Where(file), Notebook()
    contents = [
        _object(entry, notebook, file.parent, where["objects"][index])
        for index, entry in enumerate(description["objects"])
    ]
    placed = _objects(description, contents, file, notebook, has_lens=lens is not None)
    if note_up and z_seems_up(placed.parts, file.parent / description["objects"][0]["file"]):
        notebook.add(ASSUMED, file, 'y is up, but z seems to be; up="z" turns it')
    own = placed.camera and file.suffix.lower() in SUFFIXES
    if own and "view_from" not in description["camera"]:
        what = 'its own camera; view_from="front" frames all of it'
        notebook.add(ASSUMED, file, what)
    extent = framing.bounds([*placed.parts, *_later(placed, contents)], file=file)
    camera, to_camera = framing.place_camera(
        description["camera"], extent, where, placed.camera, lens, size
    )
    geometry = assemble(placed.parts, to_camera)
    view = _view(description["camera"], where["camera"]["lightfield"])
    if view:
        camera = view.camera
    remedy = "Check the meshes for zero-area triangles, NaN and huge coordinates"
    geometry.refuse_none(where["objects"], remedy)
    moves = placed.moves(to_camera)
    keys = "bounces", "bake_error", "bake_cells", "bake_mib"
    baking = {key.removeprefix("bake_"): description[key] for key in keys if key in description}
    scene = Scene(
        name=name,
        camera=camera,
        view=view,
        motions=motions(geometry, transform_all(placed.still, to_camera), moves) if moves else (),
        lights=_lights(description, placed.lights, to_camera, where["lights"]),
        bake=BakeOptions(**baking) if any(key in description for key in ASKS) else None,
        ambient=parse_colour(description["ambient"]),
        background=parse_colour(description["background"]),
        clip=description["clip"],
        focus_distances_m=_focus_distances(description, camera, where)
        or framing.default_focus_distances(camera, geometry.triangles),
        notes=notebook.notes(),
        account=tuple(count for counts in notebook.counts.values() for count in counts),
        **geometry.arrays,
    )
    if "sky" in description:
        from lfcore.scene.sky import with_sky  # seldom needed

        scene = with_sky(scene, description["sky"], to_camera, file=file)
    alone = alone and not placed.lights and not studio.encloses(extent, to_camera)
    in_studio, floor = description.get("studio", alone), description.get("floor")
    if in_studio:
        scene = studio.lit(scene, to_camera)
    if in_studio if floor is None else floor:
        scene = studio.on_floor(scene, extent, to_camera, apart=not floor)
    scene = with_reflection_notes(scene, file)
    if any(content.animation for content in contents):
        follows = placed.camera is not None and "view_from" not in description["camera"]
        replay = Replay(
            scene, to_camera, partial(_objects_at, description, contents, file, lens is not None),
            geometry.kept, 0 if "lights" in description else len(placed.lights), follows,
            partial(_sky_at, description, file, scene) if len(scene.sky) else None,
        )  # fmt: skip
        played = [content.animation for content in contents if content.animation]
        span = min(each.start_s for each in played), max(each.end_s for each in played)
        scene = dataclasses.replace(scene, animation=Animation(*span, replay))
    if scene.instants:
        note = Note(ASSUMED, file, 0, first_instant(*scene.instants))
        scene = dataclasses.replace(scene, notes=(*scene.notes, note))
    if alone:
        what = "a sky" if floor is False else "a sky and a floor"
        note = Note(ASSUMED, file, 0, f"{what}; bare=True leaves it out")
        scene = dataclasses.replace(scene, notes=(*scene.notes, note))
    return within_limits(scene, file)


def _objects(
    description: dict, contents: list[Content], file: Path, notebook: Notebook, *, has_lens: bool
) -> Objects:
    """All objects, in the world; overridden parts are noted."""
    objects = Objects([], [], [], None)
    for index, entry in enumerate(description["objects"]):
        where = Where(file)["objects"][index]
        parts, lights, camera, _ = contents[index]
        if lights and "lights" in description:
            words = f"{len(lights)} lights: the scene has its own"
            notebook.add(NOT_USED, file.parent / entry["file"], words)
        elif lights:
            objects.lights += lights
        if camera and ("pose" in description["camera"] or has_lens or objects.camera):
            words = "its camera: the scene has another"
            notebook.add(NOT_USED, file.parent / entry["file"], words)
        elif camera:
            objects.camera = camera
        if "motion" in entry:
            names = "transform", "motion"
            start, move = (parse_transform(entry.get(name, []), where[name]) for name in names)
            if not is_rigid(start, start @ move):
                remedy = "Use translate_m and rotate alone"
                raise where["motion"].error("moves an object otherwise than rigidly", remedy)
            objects.moving += [(part, (start, start @ move)) for part in parts]
        else:
            objects.still += parts
    return objects


def _later(placed: Objects, contents: list[Content]) -> list[SurfaceMesh]:
    """What moves, at later instants: a camera frames all of them."""
    parts = [part.transformed(np.linalg.inv(start), end) for part, (start, end) in placed.moving]
    for played in (content.animation for content in contents if content.animation):
        for time in np.linspace(played.start_s, played.end_s, INSTANTS)[1:].tolist():
            parts += played.at(time).parts
    return parts


def _objects_at(
    description: dict, contents: list[Content], file: Path, has_lens: bool, time_s: float
) -> Objects:
    """All objects at an instant."""
    now = [each.animation.at(time_s) if each.animation else each for each in contents]
    return _objects(description, now, file, Notebook(), has_lens=has_lens)


def _sky_at(description: dict, file: Path, scene: Scene, to_camera: np.ndarray) -> np.ndarray:
    """The sky before a camera that has turned."""
    if "sky" not in description:
        return studio.sky(to_camera)
    from lfcore.scene.sky import with_sky  # seldom needed

    return with_sky(scene, description["sky"], to_camera, file=file).sky


def _focus_distances(description: dict, camera: Camera, where: Where) -> tuple[float, ...]:
    """The description's distances, metres; empty without any."""
    distances = description.get("focus_distances_m") or []
    for index, distance in enumerate(distances):
        try:
            check_focus(distance, camera.focal_length_m, key="")
        except OpticsError as error:
            place = where["focus_distances_m"][index]
            raise place.error(error.problem, error.remedy) from None
    return tuple(map(float, distances))


def _view(camera: dict, where: Where) -> View | None:
    """The camera array of a checked ``camera`` mapping, if it has one."""
    entry = camera.get("lightfield")
    if entry is None:
        return None
    opened, closed = map(float, entry["shutter"])
    samples, film, fov = entry["samples_per_pixel"], entry["film_px"], float(entry["fov_deg"])
    bounds, cameras = entry["camera_grid_bounds_m"], entry["cameras_per_dim"]
    try:
        view = lightfield_view(film, fov, cameras, bounds, entry["spacing"])
        return dataclasses.replace(view, shutter=(opened, closed), samples_per_pixel=samples)
    except OpticsError as error:
        ours = {"bounds": "camera_grid_bounds_m", "cameras": "cameras_per_dim"}
        key = ours.get(error.key or "", error.key)
        raise where[key].error(error.problem, error.remedy) from None


def _object(entry: dict, notebook: Notebook, folder: Path, where: Where) -> Content:
    """One entry of ``objects``, in the world; its files are relative to ``folder``."""
    content = Content([])
    if "builder" in entry:
        parts = procedural.build(entry["builder"], entry["parameters"], entry["seed"], where)
        if entry["shading"] == "flat":
            parts = [dataclasses.replace(part, normals=None) for part in parts]
    else:
        mesh = folder / entry["file"]
        if not os.path.isfile(mesh):  # False, too, for a name too long
            remedy = "Give a path relative to the scene file"
            raise where["file"].error(f"mesh file {str(mesh)!r} not found", remedy)
        content = read_mesh(
            mesh, shading=entry["shading"], crease_deg=entry["crease_deg"],
            animation=entry.get("animation"), notebook=notebook,
        )  # fmt: skip
        parts = content.parts
    if "material" in entry:
        parts = _with_material(parts, entry["material"], folder, where["material"])
    names = sorted({part.surface.name for part in parts})
    for name, material in entry["materials"].items():
        place = where["materials"][name]
        if name not in names:
            raise place.error("no material of this name", f"The object has: {', '.join(names)}")
        named = [part for part in parts if part.surface.name == name]
        changed = iter(_with_material(named, material, folder, place))
        parts = [next(changed) if part.surface.name == name else part for part in parts]
    matrix = (
        parse_transform(entry["transform"], where["transform"]) if "transform" in entry else None
    )
    surfaces, played = [part.surface for part in parts], content.animation

    def placed(content: Content, parts: list[SurfaceMesh]) -> Content:
        if matrix is None:
            return content._replace(parts=parts)
        lights = [framing.moved_light(light, matrix) for light in content.lights]
        eye = content.camera and content.camera.moved(matrix)
        return Content(transform_all(parts, matrix), lights, eye)

    def at(time_s: float) -> Content:
        assert played is not None
        now = played.at(time_s)
        parts = [
            dataclasses.replace(part, surface=surface)
            for part, surface in zip(now.parts, surfaces, strict=True)
        ]
        return placed(now, parts)

    return placed(content, parts)._replace(animation=played and played._replace(at=at))


def _with_material(
    parts: list[SurfaceMesh], material: dict, folder: Path, where: Where
) -> list[SurfaceMesh]:
    kinds = dict.fromkeys(COLOURS, parse_colour) | {"thin_walled": bool}
    changes: dict = {
        name: kinds.get(name, float)(value) for name, value in material.items() if name != "texture"
    }
    if "metallic" not in material and ("specular" in material or "shininess" in material):
        changes["metallic"] = -1.0  # these are Blinn-Phong's
    if "texture" in material:
        name = material["texture"]
        changes["texture"] = name and read_texture(folder / name, where["texture"])
    if changes.get("texture") is not None and all(part.uvs is None for part in parts):
        remedy = "Unwrap it and export it with them, or give a colour"
        raise where["texture"].error("the mesh has no texture coordinates", remedy)
    return [
        dataclasses.replace(part, surface=dataclasses.replace(part.surface, **changes))
        for part in parts
    ]


def _lights(
    description: dict, object_lights: list[Light], to_camera: np.ndarray, where: Where
) -> list[Light]:
    if "lights" not in description and object_lights:
        return [framing.moved_light(light, to_camera) for light in object_lights]
    if "lights" not in description:
        return [] if "sky" in description else framing.default_lights()
    lights = []
    for index, entry in enumerate(description["lights"]):
        colour, shadows = parse_colour(entry["colour"]), entry["casts_shadows"]
        if "position_m" in entry:
            place = triple(to_camera[:3, :3] @ entry["position_m"] + to_camera[:3, 3])
            reference = float(entry["reference_distance_m"])
            lights.append(Light(POINT, place, colour, reference, shadows))
            continue
        given = np.asarray(entry["towards_light"], np.float64)
        # Scaled by a power of two: squares of great numbers overflow, those of small ones vanish.
        given = np.ldexp(given, -math.frexp(np.abs(given).max())[1])
        towards = to_camera[:3, :3] @ given
        length = float(np.linalg.norm(towards))
        if not length > 0:
            remedy = "Give the direction from the scene towards the light"
            raise where[index]["towards_light"].error("direction has no length", remedy)
        lights.append(Light(DIRECTIONAL, triple(towards / length), colour, 0.0, shadows))
    return lights

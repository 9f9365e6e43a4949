"""One call from a scene file to the scene that the tracer sees."""

import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import OpticsError, SceneError, check_kind
from lfcore.optics.camera import Camera, check_focus
from lfcore.optics.focus import exclude_twice
from lfcore.optics.size import Pixels, Size
from lfcore.readers.content import Content
from lfcore.readers.gltf.document import SUFFIXES
from lfcore.readers.meshes import read_mesh
from lfcore.readers.side_files import read_texture
from lfcore.reading import DESCRIPTIONS, Where, read_yaml
from lfcore.scene import framing, procedural, studio
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.assemble import assemble
from lfcore.scene.baked import ASKS, BakeOptions
from lfcore.scene.description import check, complete
from lfcore.scene.emitters import POINTS
from lfcore.scene.files import read_scene
from lfcore.scene.framing import FoundCamera, z_seems_up
from lfcore.scene.limits import within_limits
from lfcore.scene.model import Scene
from lfcore.scene.motion import Moving, is_rigid, motions
from lfcore.scene.notes import APPROXIMATED, ASSUMED, FIRST_POSE, NOT_USED, Note, Notebook
from lfcore.scene.surface_mesh import SurfaceMesh, parse_colour, transform_all, triple
from lfcore.scene.transforms import parse_transform
from lfcore.scene.view import View, lightfield_view

PBRT = (".pbrt", ".pbrt.gz")


def load_scene(
    path: str | Path,
    *,
    light_points: int = POINTS,
    up: str | None = None,
    view_from: str | None = None,
    zoom: float | None = None,
    position_m: ArrayLike | None = None,
    look_at_m: ArrayLike | None = None,
    matrix: ArrayLike | None = None,
    camera: Camera | None = None,
    scale: float | None = None,
    light: Mapping[str, Any] | None = None,
    bare: bool = False,
    floor: bool | None = None,
    pixels: Pixels = 1,
) -> Scene:
    """Load a scene from any file that describes one.

    Parameters
    ----------
    path : str or Path
        A ``scene.yaml`` or its folder; a mesh (GLB, OBJ, PLY, STL, ...), which gets a camera, a
        sky and a floor where it has none; a ``.pbrt`` file; or a ``scene.npz`` of the workflow.
    light_points : int
        Point lights that stand for each area light of a pbrt scene.
    up : str, optional
        ``y`` or ``z``: the upward axis of a mesh; glTF's is y.  Default: y, with a note in the
        scene where z seems to be up.
    view_from : str, optional
        The side that a mesh is seen from: ``"front"`` (+z), ``"back"``, ``"left"``, ``"right"``,
        ``"top"``, or azimuth and elevation in degrees such as ``"30,20"``.
    zoom : float, optional
        Above 1, a narrower field of view from the same place.
    position_m, look_at_m : array_like, optional
        (3,) metres in world space, y up: the lens, and a point in the middle of the picture.
    matrix : array_like, optional
        (4, 4) camera to world, instead of the two; see :class:`lfcore.Camera`'s ``pose``.
    camera : Camera, optional
        The lens, and its pose if it has one: see :meth:`lfcore.Camera.from_matrix`.
    scale : float, optional
        Metres per unit of a mesh file, 0.001 of one in millimetres.
    light : mapping, optional
        Keys of a scene.yaml in place of the file's: ``sky``, ``bounces``, ``bake_error``,
        ``bake_cells``, ``bake_mib``.  A file is relative to the scene's.
    bare : bool
        Leave a mesh without sky and floor, lit by two lights.  So it is with ``light``, too, and
        where it has lights of its own or the camera is within it.
    floor : bool, optional
        Put a floor under the scene, as one of its things, or leave out the one under a mesh, which
        is no part of ``materials`` and ``depth_range``; ``floor`` and ``studio`` of a scene.yaml.
    pixels : int or (int, int)
        The width and height of the pictures where they differ, for a camera that frames the scene.

    Returns
    -------
    Scene
        Its ``notes`` say what a foreign format has that could not be mapped exactly.

    Raises
    ------
    SceneError
        The file is missing or damaged, or describes no scene.

    Examples
    --------
    >>> scene = lfcore.load_scene("ball.obj", view_from="30,20", bare=True)
    >>> scene.name, scene.triangle_count
    ('ball', 80)
    """
    path = Path(path)
    check_kind(camera, Camera | None, "camera", "a Camera")
    check_kind(floor, bool | None, "floor", "True or False")
    pose = {"position_m": position_m, "look_at_m": look_at_m, "matrix": matrix}
    view = {**pose, "camera": camera, "view_from": view_from, "zoom": zoom, "scale": scale}
    if path.suffix.lower() == ".npz":
        _refuse_view(path, **view, light=light, up=up, floor=floor)
        return read_scene(path)
    if light is not None:
        check_kind(light, Mapping, "light")
    if not isinstance(light_points, Integral) or light_points < 1:
        raise SceneError(f"must be a whole number, not {light_points!r}", key="light_points")
    if path.is_dir():
        path = path / "scene.yaml"
    _check_up(up, path)
    if path.name.lower().endswith(PBRT):
        _refuse_view(path, **view, light=light, floor=floor)
        return _pbrt(path, int(light_points))
    mesh = path.suffix.lower() not in DESCRIPTIONS
    if mesh:
        if not os.path.isfile(path):
            raise Where(path).error("scene file not found", "Check the path")
        entry: dict = {"file": path.name}
        if up == "z":
            entry["transform"] = [{"rotate": {"axis": "x", "angle_deg": -90}}]
        if scale is not None:
            if not (isinstance(scale, Real) and 0 < scale < math.inf):
                raise SceneError(f"must be a number above 0, not {scale!r}", key="scale")
            entry.setdefault("transform", []).append({"scale": float(scale)})
        description = complete({"objects": [entry]})
        name = path.stem
    else:
        description = complete(check(read_yaml(path), file=path))
        own = path.resolve().parent.name if path.stem == "scene" else path.stem
        name = description.get("name") or own or "scene"
        if scale is not None:
            remedy = "Give the object a transform: [{scale: ...}] in the file"
            raise Where(path, "scale").error("belongs to a mesh file", remedy)
    if floor is not None:
        description["floor"] = floor
    if bare:
        description.pop("studio", None)
    if light:
        description = complete(check({**description, **light}, file=path))
    description = _placed(description, path, pose, camera, view_from, zoom)
    lens = description["camera"]
    if view_from is not None:
        if "pose" in lens:
            _refuse_view(path, view_from=view_from)
        lens["view_from"] = view_from
    if zoom is not None:
        lens["zoom"] *= zoom
    note_up = mesh and up is None and path.suffix.lower() not in SUFFIXES
    alone = mesh and not bare and not light
    return build(
        description, file=path, name=name, note_up=note_up, alone=alone, lens=camera,
        size=Size.of(pixels),
    )  # fmt: skip


def _placed(
    description: dict,
    file: Path,
    pose: dict[str, Any],
    camera: Camera | None,
    view_from: str | None,
    zoom: float | None,
) -> dict:
    """A completed description with the caller's pose of the camera."""
    if camera is not None:
        exclude_twice(camera=camera, zoom=zoom)
        if "lightfield" in description["camera"]:
            _refuse_view(file, camera=camera)
        if camera.pose is not None:
            exclude_twice(camera=camera, **pose, view_from=view_from)
            pose = {"matrix": camera.pose}
    given = {key: _plain(key, value) for key, value in pose.items() if value is not None}
    if not given:
        return description
    for key in given:
        exclude_twice(**{key: given, "view_from": view_from})
    lens = {key: value for key, value in description["camera"].items() if key != "view_from"}
    if "matrix" not in given:
        own = lens.get("pose", {})
        given = {key: own[key] for key in own if key != "matrix"} | given
    return complete(check({**description, "camera": {**lens, "pose": given}}, file=file))


def _plain(key: str, values: ArrayLike) -> list:
    """Numbers of an array as the lists that a scene.yaml has."""
    try:
        return np.asarray(values, np.float64).tolist()
    except (TypeError, ValueError, OverflowError):
        raise SceneError("must be an array of numbers", key=key) from None


def _refuse_view(path: Path, **asked: Any) -> None:
    for key, value in asked.items():
        if value is not None:
            remedy = "Leave it out, or change the camera in the file"
            raise Where(path, key).error("the scene has a camera of its own", remedy)


def _check_up(up: str | None, path: Path) -> None:
    where = Where(path, "up")
    if up not in ("y", "z", None):
        raise where.error(f"{up!r} is no axis", "Give y or z")
    scene = path.name.lower().endswith(PBRT) or path.suffix.lower() in DESCRIPTIONS
    if up == "z" and (scene or path.suffix.lower() in SUFFIXES):
        remedy = "Leave the option out; a scene.yaml may turn an object by its transform"
        raise where.error("the file says by itself where up is", remedy)


def _pbrt(path: Path, light_points: int) -> Scene:
    from lfcore.readers.pbrt.build import build_pbrt_scene  # a package of its own, seldom needed

    scene = build_pbrt_scene(path, light_points=light_points)
    distances = framing.default_focus_distances(scene.camera, scene.triangles)
    return within_limits(dataclasses.replace(scene, focus_distances_m=distances), path)


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
    parts: list[SurfaceMesh] = []
    moving: list[Moving] = []
    lamps: list[Light] = []
    found: FoundCamera | None = None
    for index, entry in enumerate(description["objects"]):
        here = where["objects"][index]
        made, lights, eye = _object(entry, notebook, file.parent, here)
        if lights and "lights" in description:
            what = f"{len(lights)} lights: the scene has its own"
            notebook.add(NOT_USED, file.parent / entry["file"], what)
        elif lights:
            lamps += lights
        if eye and ("pose" in description["camera"] or lens is not None or found):
            what = "its camera: the scene has another"
            notebook.add(NOT_USED, file.parent / entry["file"], what)
        elif eye:
            found = eye
        if "motion" in entry:
            names = "transform", "motion"
            start, move = (parse_transform(entry.get(name, []), here[name]) for name in names)
            if not is_rigid(start, start @ move):
                remedy = "Use translate_m and rotate alone"
                raise here["motion"].error("moves an object otherwise than rigidly", remedy)
            moving += [(part, (start, start @ move)) for part in made]
        else:
            parts += made
    if moving:
        notebook.add(APPROXIMATED, file, FIRST_POSE)
    every = parts + [part for part, _ in moving]
    if note_up and z_seems_up(every, file.parent / description["objects"][0]["file"]):
        notebook.add(ASSUMED, file, 'y is up, but z seems to be; up="z" turns it')
    if found and file.suffix.lower() in SUFFIXES and "view_from" not in description["camera"]:
        what = 'its own camera; view_from="front" frames all of it'
        notebook.add(ASSUMED, file, what)
    extent = framing.bounds(every, file=file)
    camera, to_camera = framing.place_camera(
        description["camera"], extent, where, found, lens, size
    )
    geometry = assemble(every, to_camera)
    placed = [
        (part.transformed(to_camera), (to_camera @ start, to_camera @ end))
        for part, (start, end) in moving
    ]
    view = _view(description["camera"], where["camera"]["lightfield"])
    if view:
        camera = view.camera
    remedy = "Check the meshes for zero-area triangles, NaN and huge coordinates"
    geometry.refuse_none(where["objects"], remedy)
    focus = description.get("focus_distances_m")
    for index, distance in enumerate(focus or []):
        try:
            check_focus(distance, camera.focal_length_m, key="")
        except OpticsError as error:
            here = where["focus_distances_m"][index]
            raise here.error(error.problem, error.remedy) from None
    keys = "bounces", "bake_error", "bake_cells", "bake_mib"
    baking = {key.removeprefix("bake_"): description[key] for key in keys if key in description}
    scene = Scene(
        name=name,
        camera=camera,
        view=view,
        motions=motions(geometry, transform_all(parts, to_camera), placed) if moving else (),
        lights=_lights(description, lamps, to_camera, where["lights"]),
        bake=BakeOptions(**baking) if any(key in description for key in ASKS) else None,
        ambient=parse_colour(description["ambient"]),
        background=parse_colour(description["background"]),
        clip=description["clip"],
        focus_distances_m=tuple(float(d) for d in focus)
        if focus
        else framing.default_focus_distances(camera, geometry.triangles),
        notes=notebook.notes(),
        account=tuple(count for counts in notebook.counts.values() for count in counts),
        **vars(geometry),
    )
    if "sky" in description:
        from lfcore.scene.sky import with_sky  # seldom needed

        scene = with_sky(scene, description["sky"], to_camera, file=file)
    alone = alone and not lamps and not studio.encloses(extent, to_camera)
    in_studio, floor = description.get("studio", alone), description.get("floor")
    if in_studio:
        scene = studio.lit(scene, to_camera)
    if in_studio if floor is None else floor:
        scene = studio.on_floor(scene, extent, to_camera, apart=not floor)
    if alone:
        what = "a sky" if floor is False else "a sky and a floor"
        note = Note(ASSUMED, file, 0, f"{what}; bare=True leaves it out")
        scene = dataclasses.replace(scene, notes=(*scene.notes, note))
    return within_limits(scene, file)


def _view(camera: dict, where: Where) -> View | None:
    """The camera array of a checked ``camera`` mapping, if it asks for one."""
    wanted = camera.get("lightfield")
    if wanted is None:
        return None
    opened, closed = map(float, wanted["shutter"])
    samples, film, fov = wanted["samples_per_pixel"], wanted["film_px"], float(wanted["fov_deg"])
    bounds, cameras = wanted["camera_grid_bounds_m"], wanted["cameras_per_dim"]
    try:
        view = lightfield_view(film, fov, cameras, bounds, wanted["spacing"])
        return dataclasses.replace(view, shutter=(opened, closed), samples_per_pixel=samples)
    except OpticsError as error:
        ours = {"bounds": "camera_grid_bounds_m", "cameras": "cameras_per_dim"}
        key = ours.get(error.key or "", error.key)
        raise where[key].error(error.problem, error.remedy) from None


def _object(entry: dict, notebook: Notebook, folder: Path, where: Where) -> Content:
    """One entry of ``objects``, in the world; its files are relative to ``folder``."""
    lights: Sequence[Light] = ()
    eye: FoundCamera | None = None
    if "builder" in entry:
        parts = procedural.build(entry["builder"], entry["parameters"], entry["seed"], where)
        if entry["shading"] == "flat":
            parts = [dataclasses.replace(part, normals=None) for part in parts]
    else:
        mesh = folder / entry["file"]
        if not os.path.isfile(mesh):  # False, too, for a name too long
            remedy = "Give a path relative to the scene file"
            raise where["file"].error(f"mesh file {str(mesh)!r} not found", remedy)
        parts, lights, eye = read_mesh(
            mesh, shading=entry["shading"], crease_deg=entry["crease_deg"], notebook=notebook
        )
    if "material" in entry:
        parts = _with_material(parts, entry["material"], folder, where["material"])
    known = sorted({part.surface.name for part in parts})
    for name, material in entry["materials"].items():
        here = where["materials"][name]
        if name not in known:
            raise here.error("no material of this name", f"The object has: {', '.join(known)}")
        named = [part for part in parts if part.surface.name == name]
        changed = iter(_with_material(named, material, folder, here))
        parts = [next(changed) if part.surface.name == name else part for part in parts]
    if "transform" in entry:
        matrix = parse_transform(entry["transform"], where["transform"])
        parts = transform_all(parts, matrix)
        lights = [framing.moved_light(light, matrix) for light in lights]
        eye = eye and eye.moved(matrix)
    return Content(parts, lights, eye)


def _with_material(
    parts: list[SurfaceMesh], material: dict, folder: Path, where: Where
) -> list[SurfaceMesh]:
    colours, numbers = ("diffuse", "specular", "emission"), ("shininess", "metallic", "roughness")
    changes: dict = {name: parse_colour(material[name]) for name in colours if name in material}
    changes |= {name: float(material[name]) for name in numbers if name in material}
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
    description: dict, lamps: list[Light], to_camera: np.ndarray, where: Where
) -> list[Light]:
    if "lights" not in description and lamps:
        return [framing.moved_light(light, to_camera) for light in lamps]
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

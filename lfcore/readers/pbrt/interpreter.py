"""Runs the directives of a pbrt scene: they change the state, and create items and lights."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.readers.pbrt.camera import TO_OURS, read_camera, read_film, read_samples
from lfcore.readers.pbrt.lexer import Place
from lfcore.readers.pbrt.lights import LightRig, emitted
from lfcore.readers.pbrt.materials import Definition, MaterialTable
from lfcore.readers.pbrt.parameters import ParameterSet
from lfcore.readers.pbrt.parser import Directive
from lfcore.readers.pbrt.shapes import tessellate, with_uvs
from lfcore.readers.pbrt.textures import TextureTable
from lfcore.scene.emitters import emitter_points
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT, NOT_USED, Notebook
from lfcore.scene.surface_mesh import Surface, SurfaceMesh
from lfcore.scene.transforms import look_at, rotate, scale, translate
from lfcore.scene.view import View

_TRANSFORMS = ("Translate", "Scale", "Rotate", "LookAt", "Transform", "ConcatTransform", "Identity")
_HEADER_ONLY = ("Camera", "Film", "TransformTimes")
_WORLD_ONLY = ("LightSource", "AreaLightSource", "Shape", "ObjectInstance")
_IGNORED = (
    "Sampler", "Integrator", "SurfaceIntegrator", "VolumeIntegrator", "Accelerator",
    "PixelFilter", "Renderer", "Option", "ColorSpace",
)  # fmt: skip
_LEFT_OUT = ("MediumInterface", "MakeNamedMedium", "Attribute")


@dataclass(frozen=True, eq=False)
class Item:
    """A placed shape; ``matrices`` are object-to-world at shutter open and close."""

    mesh: SurfaceMesh
    definition: Definition
    emission: tuple
    two_sided: bool
    matrices: tuple[np.ndarray, np.ndarray]
    place: Place
    reversed: bool


class Interpreter:
    """Runs directives by :meth:`run`; the results are ``items``, ``rig`` and ``view``."""

    def __init__(self, folder: Path, notebook: Notebook, light_points: int):
        self.folder, self.notebook, self.light_points = folder, notebook, light_points
        self.now = Attributes()
        self._stack: list[tuple[str, Attributes, Place]] = []
        self._systems: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        self.textures = TextureTable(folder)
        self.materials = MaterialTable(self.textures)
        self.rig = LightRig(folder)
        self.items: list[Item] = []
        self.view: View | None = None
        self.world_to_camera: np.ndarray | None = None
        self._camera: tuple[str, ParameterSet] | None = None
        self._film: ParameterSet | None = None
        self._sampler: ParameterSet | None = None
        self._motion_times = (0.0, 1.0)
        self._objects: dict[str, list[Item]] = {}
        self._open_object: str | None = None
        self._in_world = self._after_world = False
        start = Place(folder, 1, 1)
        self._default = Definition("matte", ParameterSet("default material", start, notebook))

    def run(self, directives: Iterable[Directive]) -> None:
        """Raises :class:`SceneError` naming file, line and token."""
        for directive in directives:
            if self._after_world:
                problem = f"{directive.name} after WorldEnd"
                raise directive.place.error(problem, "Write one scene per file")
            self.handle(directive)
        if not self._in_world:
            raise Place(self.folder, 1, 1).error("the scene has no WorldBegin")
        if self._stack:
            kind, _, place = self._stack[0]
            raise place.error(f"{kind}Begin is never closed", f"Add {kind}End")

    def handle(self, directive: Directive) -> None:
        name = directive.name
        if name in _HEADER_ONLY and self._in_world:
            raise directive.place.error(f"{name} inside the world block")
        if name in _WORLD_ONLY and not self._in_world:
            raise directive.place.error(f"{name} before WorldBegin", "Move it after WorldBegin")
        if name in _TRANSFORMS:
            self._transform(directive)
        elif name.endswith(("Begin", "End")):
            self._block(directive)
        elif name in _IGNORED:
            words = directive.parameters.owner
            if name == "Sampler":
                self._sampler = directive.parameters
                words += ": its kind, not its rays per pixel"
            self.notebook.add(NOT_USED, directive.place, words)
        elif name in _LEFT_OUT:
            self.notebook.add(LEFT_OUT, directive.place, directive.parameters.owner)
        else:
            snake = re.sub("(?<!^)([A-Z])", r"_\1", name).lower()
            getattr(self, f"_do_{snake}")(directive)

    def _transform(self, directive: Directive) -> None:
        """Multiply or replace the current transformation matrix (CTM) of the active times."""
        name, now = directive.name, self.now
        alone = name in ("Identity", "Transform")
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = transform_matrix(name, directive.numbers, directive.place)
            matrices = tuple(
                (matrix if alone else current @ matrix) if time in now.active else current
                for time, current in enumerate(now.matrices)
            )
        if not np.isfinite(matrices).all():
            problem = f"{name} makes the transformation overflow"
            raise directive.place.error(problem, "Scale or move less")
        self._set(matrices=matrices)

    def _block(self, directive: Directive) -> None:
        name, place = directive.name, directive.place
        if name == "WorldBegin":
            self._world_begin(place)
        elif name == "WorldEnd":
            self._after_world = True
        elif name == "ObjectBegin":
            if self._open_object is not None:
                raise place.error("ObjectBegin inside ObjectBegin")
            self._open_object = directive.strings[0]
            self._objects[self._open_object] = []
        elif name == "ObjectEnd":
            self._open_object = None
        if name.endswith("Begin") and name != "WorldBegin":
            self._stack.append((name.removesuffix("Begin"), self.now, place))
        elif name not in ("WorldBegin", "WorldEnd"):
            self._pop(name.removesuffix("End"), place)

    def _pop(self, kind: str, place: Place) -> None:
        if not self._stack or self._stack[-1][0] != kind:
            opened = f"{self._stack[-1][0]}Begin is open" if self._stack else "no block is open"
            raise place.error(f"{kind}End, but {opened}")
        _, saved, _ = self._stack.pop()
        if kind == "Transform":  # TransformBegin saves only the transformation
            saved = replace(self.now, matrices=saved.matrices, active=saved.active)
        self.now = saved

    def _set(self, **changes: Any) -> None:
        self.now = replace(self.now, **changes)

    def _world_begin(self, place: Place) -> None:
        if self._in_world:
            raise place.error("WorldBegin occurs twice")
        self._in_world = True
        film = read_film(self._film)
        if self._camera is None:
            self.notebook.add(APPROXIMATED, place, "no Camera: pbrt's default perspective")
            defaults = ParameterSet('Camera "perspective"', place, self.notebook)
            self._camera = ("perspective", defaults)
            self.world_to_camera = TO_OURS.copy()
        view = read_camera(*self._camera, film, read_samples(self._sampler))
        self.view = replace(view, motion_times=self._motion_times)
        self._set(matrices=(np.eye(4), np.eye(4)), active=(0, 1))
        self._systems["world"] = (np.eye(4), np.eye(4))

    def _do_active_transform(self, directive: Directive) -> None:
        active = {"StartTime": (0,), "EndTime": (1,), "All": (0, 1)}.get(directive.strings[0])
        if active is None:
            problem = f"ActiveTransform {directive.strings[0]}"
            raise directive.place.error(problem, "Use StartTime, EndTime or All")
        self._set(active=active)

    def _do_transform_times(self, directive: Directive) -> None:
        start, end = directive.numbers.tolist()
        if not end > start:
            raise directive.place.error(f"TransformTimes {start:g} {end:g}", "Give start, then end")
        self._motion_times = (start, end)

    def _do_coordinate_system(self, directive: Directive) -> None:
        self._systems[directive.strings[0]] = self.now.matrices

    def _do_coord_sys_transform(self, directive: Directive) -> None:
        name, systems = directive.strings[0], self._systems
        if name not in systems:
            problem = f'coordinate system "{name}" is not defined'
            raise directive.place.error(problem, "Use CoordinateSystem before")
        self._set(matrices=systems[name])

    def _do_camera(self, directive: Directive) -> None:
        start, end = self.now.matrices
        if not np.array_equal(start, end):
            words = "motion of the camera; its pose when the shutter opens is used"
            self.notebook.add(LEFT_OUT, directive.place, words)
        self._camera = (directive.strings[0], directive.parameters)
        self.world_to_camera = TO_OURS @ start
        self._systems["camera"] = np.linalg.inv(start), np.linalg.inv(end)

    def _do_film(self, directive: Directive) -> None:
        self._film = directive.parameters

    def _do_reverse_orientation(self, directive: Directive) -> None:
        self._set(reversed=not self.now.reversed)

    def _do_material(self, directive: Directive) -> None:
        self._set(material=Definition(directive.strings[0], directive.parameters))

    def _do_make_named_material(self, directive: Directive) -> None:
        parameters, name = directive.parameters, directive.strings[0]
        kind = parameters.string("type")
        if kind is None:
            raise parameters.error("type", "is missing", 'Write "string type" "matte"')
        named = replace(parameters, owner=f'Material "{kind}" named "{name}"')
        self.materials.named[name] = Definition(kind, named)

    def _do_named_material(self, directive: Directive) -> None:
        self._set(material=self.materials.find(directive.strings[0], directive.place))

    def _do_texture(self, directive: Directive) -> None:
        name, value_type, kind = directive.strings
        self.textures.define(name, value_type, kind, directive.parameters)

    def _do_light_source(self, directive: Directive) -> None:
        start, end = self.now.matrices
        if not np.array_equal(start, end):
            words = "motion of a light; its pose when the shutter opens is used"
            self.notebook.add(LEFT_OUT, directive.place, words)
        to_camera = self.world_to_camera @ start
        self.rig.add(directive.strings[0], directive.parameters, to_camera)

    def _do_area_light_source(self, directive: Directive) -> None:
        parameters = directive.parameters
        if directive.strings[0] not in ("diffuse", "area"):
            parameters.approximated("as diffuse")
        # Noted now, once, at this line; shapes follow later.
        parameters.approximated(f"{self.light_points} point lights per shape and side")
        for name in ("samples", "nsamples"):
            parameters.get(name)
        self._set(area_light=parameters)

    def _do_shape(self, directive: Directive) -> None:
        now, parameters = self.now, directive.parameters
        mesh = tessellate(directive.strings[0], parameters, self.folder)
        if mesh is None:
            return
        emission, two_sided = (0.0, 0.0, 0.0), False
        if now.area_light is not None:
            emission = tuple(emitted(now.area_light, "L", self.folder).tolist())
            two_sided = now.area_light.bool("twosided", False)
            now.area_light.note_unused()
        item = Item(
            mesh, now.material or self._default, emission, two_sided, now.matrices,
            directive.place, now.reversed,
        )  # fmt: skip
        if self._open_object is None:
            self.items.append(item)
            return
        if any(emission):
            self.notebook.add(LEFT_OUT, directive.place, "light of an emitter inside an object")
        self._objects[self._open_object].append(item)

    def _do_object_instance(self, directive: Directive) -> None:
        name = directive.strings[0]
        if name not in self._objects:
            raise directive.place.error(f'object "{name}" is not defined')
        if self._open_object is not None:
            raise directive.place.error("ObjectInstance inside ObjectBegin")
        for item in self._objects[name]:
            pair = zip(self.now.matrices, item.matrices, strict=True)
            matrices = tuple(outer @ inner for outer, inner in pair)
            self.items.append(replace(item, matrices=matrices, emission=(0.0, 0.0, 0.0)))

    def light(self, item: Item, triangles: np.ndarray, numbers: tuple[int, int]) -> None:
        """Add the lights of an emitting item with ``triangles`` in camera space.

        ``numbers`` are the first of its triangles in the scene and the one after its last.
        """
        points = emitter_points(triangles, self.light_points, two_sided=item.two_sided)
        if points is not None:
            self.rig.add_area(points, np.array(item.emission), numbers)

    def uvs(self, item: Item) -> tuple[np.ndarray | None, Surface | None]:
        """Return an item's texture coordinates (None without texture) and its surface."""
        surface, texture = self.materials.resolve(item.definition, item.emission) or (None, None)
        if texture is None or texture.image is None:
            return None, surface
        return with_uvs(item.mesh) * texture.uv_scale + texture.uv_offset, surface


@dataclass(frozen=True, eq=False)
class Attributes:
    """The state that AttributeBegin saves; ``matrices`` are the CTM at shutter open and close."""

    matrices: tuple[np.ndarray, np.ndarray] = field(default_factory=lambda: (np.eye(4), np.eye(4)))
    active: tuple[int, ...] = (0, 1)
    material: Definition | None = None
    area_light: ParameterSet | None = None
    reversed: bool = False


def transform_matrix(name: str, numbers: np.ndarray, place: Place) -> np.ndarray:
    """Return the (4, 4) matrix of a transform directive, as pbrt defines it."""
    if name == "Identity":
        return np.eye(4)
    if name == "Translate":
        return translate(*numbers)
    if name == "Scale":
        if not numbers.all():
            raise place.error(f"Scale by {numbers.tolist()} flattens space")
        return scale(*numbers)
    if name == "Rotate":
        if not numbers[1:].any():
            raise place.error("Rotate about an axis of length 0")
        return rotate(numbers[1:].tolist(), numbers[0])
    if name == "LookAt":
        eye, target, up = numbers.reshape(3, 3).tolist()
        if eye == target:
            raise place.error("LookAt: eye and target coincide")
        try:  # pbrt's camera space is left-handed: x right, y up, z forward
            return np.diag([-1.0, -1.0, 1.0, 1.0]) @ look_at(eye, target, up)
        except SceneError:
            raise place.error("LookAt: up is parallel to the view") from None
    matrix = numbers.reshape(4, 4).T  # files list columns
    if np.linalg.matrix_rank(matrix) < 4 or not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-9):
        raise place.error(f"{name} is not an invertible affine matrix")
    return matrix

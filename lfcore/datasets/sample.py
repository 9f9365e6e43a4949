"""Scene ``index`` of a data set, which depends only on the description and the index.

Shapes do not depend on earlier scenes (:mod:`lfcore.datasets.shapes`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lfcore.datasets import room_views, rooms
from lfcore.datasets.draws import Draw
from lfcore.datasets.moving import Movement, Thing, animated, movements
from lfcore.datasets.shapes import Shape
from lfcore.datasets.space import Space
from lfcore.errors import SettingsError
from lfcore.optics.camera import Camera
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.assemble import assemble
from lfcore.scene.baked import BakeOptions
from lfcore.scene.limits import within_limits
from lfcore.scene.model import Scene
from lfcore.scene.procedural.basics import Parts
from lfcore.scene.procedural.primitives import rectangle
from lfcore.scene.sky import with_sky
from lfcore.scene.surface_mesh import triple
from lfcore.scene.transforms import look_at, scale, translate

if TYPE_CHECKING:
    from lfcore.datasets.description import Description

TRIES = 40
"""The positions that are tried before an object is left out."""
CONE = (math.cos(math.radians(8)), math.cos(math.radians(20)))
"""The cosines of the angles at which spots begin to fade and are dark."""
SKY_SIDE = 32
"""The texels per side of a sky's map: skies are smooth, and large maps take a second."""
BAKE = BakeOptions(bounces=1, error=0.05)
"""The bake of scenes with a sky."""


def sample_scene(description: Description | str | Path | Mapping[str, Any], index: int) -> Scene:
    """Draw one scene of a data set.

    Parameters
    ----------
    description : Description, str, Path or mapping
        A description, its YAML file, or its keys.
    index : int
        The scene's number.  The scene depends on the description and this number alone.

    Returns
    -------
    Scene
        The scene, with the description's lens, focused between its focus distances.

    Raises
    ------
    SettingsError
        The description has an unknown key or an impossible value, or names an empty folder.
    SceneError
        None of the meshes, or of the textures, can be read.

    Examples
    --------
    >>> few = {"objects": (1, 2, "even"), "least_seen": 0.01}
    >>> description = {"name": "mine", "kind": "focal_stacks", "placement": few}
    >>> lfcore.sample_scene(description, index=0).triangle_count > 0
    True
    """
    return sample(description, index).scene


class Sample(NamedTuple):
    """A scene, the names of its objects, the files that cannot be read, with the reason, the object
    of each triangle, (T,) int32 from 1; 0 is behind all; what moves; whether it is a room."""

    scene: Scene
    objects: list[str]
    dropped: dict[str, str]
    owners: np.ndarray
    moves: tuple[Movement, ...] = ()
    is_room: bool = False


def sample(source: Description | str | Path | Mapping[str, Any], index: int) -> Sample:
    """Draw scene ``index``; raises the errors of :func:`sample_scene`."""
    description = described(source)
    seeds = np.random.SeedSequence(description.seed, spawn_key=(1 << 30, index))
    rng = np.random.Generator(np.random.Philox(seeds))
    split = description.split(index) if description.split_by == "mesh" else ""
    return SceneDraw(description, rng, split).sample(index)


def described(source: Description | str | Path | Mapping[str, Any]) -> Description:
    """Return a description from any of its forms; raises :class:`SettingsError`."""
    try:  # descriptions need pydantic, which the library does not require
        from lfcore.datasets.description import Description
    except ImportError:
        problem = "data sets need the package pydantic"
        raise SettingsError(problem, remedy="pip install 'lfcore[workflow]'") from None
    if isinstance(source, Description):
        return source
    if isinstance(source, Mapping):
        return Description.check(source)
    assert isinstance(source, str | Path)
    return Description.read(source)


class ItemLens(NamedTuple):
    """The lens of an item, focused in the middle of its focus distances, in dioptres."""

    camera: Camera
    focus_m: tuple[float, ...]


def lens_of(description: Description, index: int) -> ItemLens:
    """Return the lens of an item; its draws change no scene."""
    lens, focus = description.lens, tuple(description.lens.focus_m)
    seeds = np.random.SeedSequence(description.seed, spawn_key=(1 << 31, index))
    draw = Draw(description, np.random.Generator(np.random.Philox(seeds)))
    focal, sensor = draw.span(lens.focal_length_mm) / 1e3, lens.sensor_width_mm / 1e3
    if description.kind == "light_fields":
        diameter = lens.views * lens.baseline_mm / 1e3
        return ItemLens(Camera(focal, sensor, focal / diameter, focus[0]), focus)
    f_number = draw.span(lens.f_number)
    if description.kind == "infinigen_defocus":
        f_number = min(lens.stops)
    if lens.random_focus:
        near, far = 1 / min(focus), 1 / max(focus)
        dioptres = far + (near - far) * draw.rng.random(lens.random_focus)
        focus = tuple(sorted((1 / dioptres).tolist()))
    middle = 2 / (1 / min(focus) + 1 / max(focus))
    return ItemLens(Camera(focal, sensor, f_number, middle), focus)


def _owners(owners: list[int], parts: Parts, kept: np.ndarray) -> np.ndarray:
    """Return the owner of each triangle that is kept, of the owners of parts."""
    return np.repeat(np.array(owners, np.int32), [part.count for part in parts])[kept]


class SceneDraw(Draw):
    """The random draws of a whole scene; the camera is above the world's origin."""

    def sample(self, index: int) -> Sample:
        keys = self.description
        place, (camera, focus_m) = keys.placement, lens_of(keys, index)
        if place.share_rooms and self.chance(place.share_rooms):
            return self._room(index, camera, focus_m)
        resting, wall = self.chance(place.share_resting), self.span(place.wall_m)
        pitch = math.radians(self.span(place.pitch_deg)) if resting else 0.0
        low, high, _ = place.depth_m
        height = self.span((min(2 * low, high), high, "log")) * math.sin(pitch)
        ahead = (0.0, height - math.sin(pitch), -math.cos(pitch))
        to_camera = look_at((0, height, 0), ahead)
        space = Space(to_camera, self.field(camera), low / 2, wall)
        parts = self._backdrop(wall, height, resting)
        names, owners, things = [], [0] * len(parts), list[Thing]()
        for shape, matrix in self._placed(camera.field_width, space, resting):
            parts += [part.transformed(matrix) for part in self.dressed(shape)]
            names.append(shape.name)
            owners += [len(names)] * len(shape.parts)
            things.append(Thing(len(names), shape, matrix))
        made = assemble(parts, to_camera)
        scene = Scene(
            name=f"{keys.name}-{index:06d}", camera=camera, lights=self._lights(to_camera, wall),
            ambient=triple(self.span(keys.lights.ambient) * self.tint()),
            focus_distances_m=focus_m, **made.arrays,
        )  # fmt: skip
        # Metal and glass show the sky also where it is not baked.
        scene = replace(scene, bake=BAKE if self.chance(keys.lights.share_sky) else None)
        horizon = np.array(scene.ambient)
        ends = {"horizon": horizon.tolist(), "zenith": (horizon * (0.8, 1.2, 2)).tolist()}
        scene = with_sky(scene, ends, to_camera, file=scene.name, gradient_side=SKY_SIDE)
        scene = within_limits(scene, scene.name)

        drawn = Sample(scene, names, self.dropped, _owners(owners, parts, made.kept))
        made_of = np.repeat(owners, [part.count for part in parts]), made.kept
        return self._moving(index, drawn, things, made_of, to_camera, resting, space)

    def _room(self, index: int, camera: Camera, focus_m: tuple[float, ...]) -> Sample:
        room = rooms.Room(self)
        room.add_shell()
        room.furnish()
        to_camera = room_views.camera_of(room, self.field(camera))
        lights, sky = room_views.light_of(room, to_camera)
        name = f"{self.description.name}-{index:06d}"
        made = assemble(room.parts, to_camera)
        scene = Scene(
            name=name, camera=camera, lights=lights, ambient=(0.0, 0.0, 0.0), bake=room_views.BAKE,
            focus_distances_m=focus_m, **made.arrays,
        )  # fmt: skip
        scene = with_sky(scene, sky, to_camera, file=name, gradient_side=SKY_SIDE)
        scene = within_limits(scene, name)
        owners = _owners(room.owners, room.parts, made.kept)
        drawn = Sample(scene, room.names, self.dropped, owners, is_room=True)
        made_of = np.repeat(room.owners, [part.count for part in room.parts]), made.kept
        return self._moving(index, drawn, room.things, made_of, to_camera, True, None)

    def _moving(
        self, index: int, drawn: Sample, things: Sequence[Thing],
        made_of: tuple[np.ndarray, np.ndarray], to_camera: np.ndarray, upright: bool,
        space: Space | None,
    ) -> Sample:  # fmt: skip
        """Return the scene with drawn movements, if something moves; ``made_of`` has the
        owner of each triangle of the parts, and which are kept."""
        frames, (all_owners, kept) = self.description.frames, made_of
        if not frames.moving:
            return drawn
        seeds = np.random.SeedSequence(self.description.seed, spawn_key=(1 << 29, index))
        draw = Draw(self.description, np.random.Generator(np.random.Philox(seeds)))
        masks = [kept[all_owners == thing.number] for thing in things]
        moves = movements(
            draw, things, drawn.owners, masks, to_camera, upright=upright, space=space
        )  # fmt: skip
        return drawn._replace(scene=animated(drawn.scene, moves, frames), moves=moves)

    def _placed(
        self, field_width: float, space: Space, resting: bool
    ) -> list[tuple[Shape, np.ndarray]]:
        """Draw shapes and their poses in the world; their spheres are disjoint."""
        from trimesh.transformations import random_rotation_matrix

        place, to_world = self.description.placement, np.linalg.inv(space.to_camera)
        placed: list[tuple[Shape, np.ndarray]] = []
        spheres: list[tuple[np.ndarray, float]] = []
        for _ in range(round(self.span(place.objects))):
            shape = self.shape()
            for _ in range(TRIES):
                depth = self.span(place.depth_m)
                radius = self.span(place.size) * field_width * depth / 2
                x, y = (self.rng.random(2) - 0.5) * space.field * depth
                centre = (to_world @ (x, y, depth, 1))[:3]
                pose = random_rotation_matrix(self.rng.random(3))  # uniform
                if resting:
                    pose = self.pose_at_rest(shape)
                    centre[1] = radius * pose[1, 3]
                    pose = translate(0, -pose[1, 3], 0) @ pose
                if space.fits(centre, radius, spheres):
                    spheres.append((centre, radius))
                    placed.append((shape, translate(*centre) @ scale(radius) @ pose))
                    break
        return placed

    def _lights(self, to_camera: np.ndarray, wall: float) -> list[Light]:
        """Draw lights above the scene; points and spots are twice as far from its middle as the
        wall."""
        keys = self.description.lights
        count, strength = round(self.span(keys.count)), self.span(keys.strength)
        parts = self.rng.random(count) + 0.2
        lights = []
        for part in (strength * parts / parts.sum()).tolist():
            angle = math.radians(160 * (float(self.rng.random()) - 0.5))
            rise = math.radians(self.span(keys.elevation_deg))
            level = math.cos(rise)
            towards = np.array([level * math.sin(angle), math.sin(rise), level * math.cos(angle)])
            vector = to_camera[:3, :3] @ towards
            colour, kind = triple(part * self.tint()), self.pick(keys.kinds)
            if kind == "sun":
                lights.append(Light(DIRECTIONAL, triple(vector), colour))
                continue
            place = to_camera @ (*(2 * wall * towards - (0, 0, wall / 2)), 1)
            light = Light(POINT, triple(place[:3]), colour, reference_distance_m=2 * wall)
            is_spot = kind == "spot"
            lights.append(replace(light, normal=triple(-vector), cone=CONE) if is_spot else light)
        return lights

    def _backdrop(self, wall: float, height: float, resting: bool) -> Parts:
        """Draw a wall behind everything, and the floor if objects are ``resting``."""
        side = 8 * wall
        repeats = 2 * self.span(self.description.materials.repeats) / wall
        at = (-side / 2, height - side / 2, -wall)
        upright = rectangle(at, (side, 0, 0), (0, side, 0), self.surface("wall"), repeat=repeats)
        if not resting:
            return [upright]
        repeats = 2 * self.span(self.description.materials.repeats)
        floor = self.surface("floor")
        start = (-side / 2, 0, side / 2)
        return [upright, rectangle(start, (side, 0, 0), (0, 0, -side), floor, repeat=repeats)]

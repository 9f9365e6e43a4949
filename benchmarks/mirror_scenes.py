"""Scenes of mirrors, glass, a coat and a veil in even light, where surfaces show their own colours.

Camera space: x right, y down, z forward, metres.  Walls face the lens, or what shows them.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import trimesh

from benchmarks.peers.mitsuba import Balls
from lfcore.optics.camera import Camera
from lfcore.scene.assemble import assemble
from lfcore.scene.model import Scene
from lfcore.scene.procedural import textures
from lfcore.scene.surface_mesh import Surface, SurfaceMesh

CAMERA = Camera(focal_length_m=0.1, sensor_width_m=0.08, f_number=1.0, focus_m=3.0)
MIRROR = Surface("mirror", (0.95, 0.95, 0.95), metallic=1.0, roughness=0.0)
CHROME = replace(MIRROR, name="chrome")
GLASS = Surface("glass", (1.0, 1.0, 1.0), transmission=1.0)
PANE = replace(GLASS, name="pane", thin_walled=True)
Tone = tuple[int, int, int]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Case:
    """A scene with the ``special`` material, in focus at ``surface_m`` and at ``image_m``; and the
    centre and radius of its meshes that are balls, by the name of their material."""

    parts: list[SurfaceMesh]
    special: str
    surface_m: float
    image_m: float
    balls: Balls = field(default_factory=dict)

    def scene(self, name: str) -> Scene:
        return Scene(
            name=name, camera=replace(CAMERA, focus_m=self.surface_m), lights=[],
            ambient=(1.0, 1.0, 1.0), **assemble(self.parts, np.eye(4)).arrays,
        )  # fmt: skip


def checked(name: str, seed: int, dark: Tone, bright: Tone, fields: int = 4, **more) -> Surface:
    """A checkerboard of two stained tones."""
    stains = 0.65 + 0.35 * textures.noise(seed)[..., None]
    steps = np.arange(512) * fields // 512
    odd = (steps[:, None] + steps) % 2 == 1
    colours = np.where(odd[..., None], dark, bright) * stains
    return Surface(name, (1.0,) * 3, texture=textures.finish(colours), **more)


def sheet(
    centre: Vector, across: Vector, down: Vector, surface: Surface, to: Vector = (0, 0, 0)
) -> SurfaceMesh:
    """A parallelogram about its centre that faces the place ``to``; texture 1 x 1."""
    c, a, d = (np.array(vector, np.float64) for vector in (centre, across, down))
    corners = c + np.array([-a - d, a - d, a + d, d - a]) / 2
    uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], float)
    order = np.array([[0, 1, 2], [0, 2, 3]])
    if np.cross(a, d) @ (np.array(to) - c) < 0:
        order = order[:, ::-1]
    return SurfaceMesh(corners[order], surface, None, uv[order])


def block(low: Vector, high: Vector, surface: Surface) -> SurfaceMesh:
    """A box whose six faces have places of their own in the texture: where two share one, Mitsuba
    samples the light of one alone."""
    mesh = trimesh.creation.box(bounds=[low, high])
    corners = (mesh.triangles - low) / np.subtract(high, low)
    axis = np.abs(mesh.face_normals).argmax(1)
    kept = np.array([[1, 2], [0, 2], [0, 1]])[axis]
    uv = np.take_along_axis(corners, kept[:, None, :].repeat(3, 1), 2)
    place = np.stack([axis, mesh.face_normals.sum(1) > 0], 1)
    return SurfaceMesh(mesh.triangles, surface, None, (uv + place[:, None]) / (3, 2))


def ball(centre: Vector, radius: float, surface: Surface) -> SurfaceMesh:
    unit = trimesh.creation.icosphere(5).triangles
    unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    return SurfaceMesh(centre + radius * unit, surface, unit, np.zeros((len(unit), 3, 2)))


def room(behind: float = -3.0, end: float = 6.0, floor: float = 1.2, side: float = 2.0) -> list:
    """The walls of a room around the lens, all seen from within."""
    middle, length = (behind + end) / 2, end - behind
    inside = (0.0, 0.0, middle)
    return [
        sheet((0, 0, end), (2 * side, 0, 0), (0, 2 * floor, 0),
              checked("end", 1, (40, 60, 120), (220, 210, 180), 6), inside),
        sheet((0, 0, behind), (2 * side, 0, 0), (0, 2 * floor, 0),
              checked("back", 2, (150, 50, 30), (240, 225, 190), 8), inside),
        sheet((-side, 0, middle), (0, 0, length), (0, 2 * floor, 0),
              checked("left", 3, (60, 110, 60), (200, 205, 190), 8), inside),
        sheet((side, 0, middle), (0, 0, length), (0, 2 * floor, 0),
              checked("right", 4, (120, 80, 130), (215, 200, 210), 8), inside),
        sheet((0, floor, middle), (2 * side, 0, 0), (0, 0, length),
              checked("floor", 5, (90, 70, 50), (190, 170, 140), 16), inside),
        sheet((0, -floor, middle), (2 * side, 0, 0), (0, 0, length),
              Surface("ceiling", (0.7, 0.7, 0.7)), inside),
    ]  # fmt: skip


def plane_mirror() -> Case:
    """A mirror on a wall, turned a little: it shows the room behind the lens and a box."""
    mirror = sheet((0.1, 0, 3.9), (2.0, 0, 0.35), (0, 1.7, 0), MIRROR)
    box = block(
        (-0.9, 0.1, 1.7), (-0.5, 0.5, 2.1), checked("box", 6, (30, 30, 40), (230, 90, 40), 12)
    )
    wall = sheet(
        (0, 0, 4.2), (4, 0, 0), (0, 2.4, 0), checked("wall", 7, (90, 120, 140), (220, 220, 210), 12)
    )
    return Case([*room()[1:], wall, box, mirror], "mirror", 3.9, 10.8)


def chrome_ball() -> Case:
    """A chrome ball on a table, in a room."""
    place = (0.0, 0.1, 2.6), 0.45
    table = sheet(
        (0, 0.55, 2.7),
        (2.4, 0, 0),
        (0, 0, 1.8),
        checked("table", 8, (60, 40, 30), (205, 160, 110), 12),
        (0, -1, 2.7),
    )
    return Case([*room(), table, ball(*place, CHROME)], "chrome", 2.2, 2.4, {"chrome": place})


def glass_ball() -> Case:
    """A ball of glass before a checker: its image, upside down, is before the ball."""
    place = (0.0, 0.0, 2.5), 0.6
    wall = sheet(
        (0, 0, 5.0), (5, 0, 0), (0, 5, 0), checked("wall", 9, (30, 50, 90), (235, 225, 200), 16)
    )
    return Case([wall, ball(*place, GLASS)], "glass", 2.0, 1.15, {"glass": place})


def window() -> Case:
    """A pane, aslant: the room behind it, and faint reflections of the side wall."""
    pane = sheet((0, 0, 2.2), (1.1, 0, 0.9), (0, 1.5, 0), PANE)
    return Case([*room(), pane], "pane", 2.2, 6.0)


def coat() -> Case:
    """A varnished floor that mirrors a wall and boxes."""
    return on_floor(checked("varnish", 10, (50, 30, 20), (170, 110, 60), 14, clearcoat=1.0))


def rough_coat() -> Case:
    """The varnished floor, no longer polished."""
    return on_floor(
        checked("varnish", 10, (50, 30, 20), (170, 110, 60), 14, clearcoat=1.0,
                clearcoat_roughness=0.2)
    )  # fmt: skip


def rough_metal(roughness: float) -> Case:
    """The same floor of brushed metal."""
    return on_floor(Surface("metal", (1.0, 1.0, 1.0), metallic=1.0, roughness=roughness))


def on_floor(surface: Surface) -> Case:
    """A floor before a wall, with a box on it."""
    floor = sheet((0, 0.55, 3.2), (4, 0, 0), (0, 0, 5.2), surface, (0, -1, 3))
    wall = sheet(
        (0, -0.9, 5.8),
        (4, 0, 0),
        (0, 2.9, 0),
        checked("wall", 11, (200, 60, 40), (250, 245, 225), 8),
    )
    box = block(
        (0.3, 0.0, 3.4), (0.8, 0.55, 3.9), checked("box", 12, (40, 90, 150), (235, 235, 235), 12)
    )
    return Case([floor, wall, box], surface.name, 2.5, 5.8)


def leaf() -> Case:
    """A sheet of opacity 0.3 before a wall."""
    veil = checked("leaf", 13, (40, 120, 30), (150, 210, 80), 6, opacity=0.3)
    return Case(
        [*room(), sheet((0.1, 0, 2.0), (0.9, 0, 0.2), (0, 0.9, 0.1), veil)], "leaf", 2.0, 6.0
    )


CASES: dict[str, Callable[[], Case]] = {
    "plane mirror": plane_mirror, "chrome ball": chrome_ball, "glass ball": glass_ball,
    "window pane": window, "coat": coat, "leaf": leaf,
    **{f"metal of roughness {r}": partial(rough_metal, r) for r in (0.1, 0.2, 0.3)},
    "rough coat": rough_coat,
}  # fmt: skip

"""The scene as the tracer sees it: flat arrays in camera space.

Camera space is x right, y down, z forward (as OpenCV and COLMAP), in metres.  Whoever builds
a :class:`Scene` moves the geometry there in float64 and rounds to float32 once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lfcore.optics.camera import Camera
from lfcore.scene.notes import Note, summary
from lfcore.scene.view import View

if TYPE_CHECKING:
    from lfcore.scene.parts import Surface

POINT, DIRECTIONAL = 0, 1


@dataclass(frozen=True)
class Material:
    """Blinn-Phong reflectance, all colours linear RGB in [0, 1].

    ``texture`` indexes :attr:`Scene.textures` (-1: none) and multiplies ``diffuse``.
    ``emission`` is added whatever the light: a lamp shade, a screen, test charts.
    """

    name: str
    diffuse: tuple[float, float, float] = (0.8, 0.8, 0.8)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: float = 32.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: int = -1


@dataclass(frozen=True)
class Light:
    """A point or directional light in camera space.

    ``vector`` is the position in metres (:data:`POINT`) or the unit direction *towards* the
    light (:data:`DIRECTIONAL`).  ``colour`` is linear RGB: for a point light the irradiance at
    ``reference_distance_m`` (inverse-square fall-off; 0 means no fall-off), for a directional
    light the irradiance everywhere.

    A point light may be a point of a surface that glows: with a ``normal`` (unit, camera space;
    zero: shines to all sides) it gives the cosine to it times as much, and nothing behind.  The
    triangles ``own``, from the first to before the second number, never shadow it.
    """

    kind: int
    vector: tuple[float, float, float]
    colour: tuple[float, float, float]
    reference_distance_m: float = 0.0
    casts_shadows: bool = True
    normal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    own: tuple[int, int] = (0, 0)

    @property
    def is_of_emitter(self) -> bool:
        return any(self.normal) or self.own[0] < self.own[1]


@dataclass(frozen=True, eq=False)
class Motion:
    """Triangles ``first .. first + count`` move rigidly.

    ``start`` and ``end`` are their first and last (4, 4) float64 poses in camera space; the scene's
    arrays hold the triangles in the first.
    """

    first: int
    count: int
    start: np.ndarray
    end: np.ndarray

    def pose(self, time: float) -> np.ndarray:
        """(4, 4) that moves the stored triangles to ``time`` in [0, 1]."""
        from scipy.spatial.transform import Rotation, Slerp  # seldom needed, slow to import

        move = self.end @ np.linalg.inv(self.start)
        turn = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([np.eye(3), move[:3, :3]])))(time)
        # Objects turn about their own origin, not about the camera.
        pivot = self.start[:3, 3]
        matrix = np.eye(4)
        matrix[:3, :3] = turn.as_matrix()
        matrix[:3, 3] = pivot + time * (self.end[:3, 3] - pivot) - matrix[:3, :3] @ pivot
        return matrix


@dataclass(frozen=True)
class Scene:
    """Everything a ray can meet.

    Attributes
    ----------
    triangles : (T, 3, 3) float32, corner positions in camera space, metres; finite.
    normals : (T, 3, 3) float32, unit shading normals per corner; (0, 3, 3) when every
        triangle is flat shaded with its geometric normal.
    uvs : (T, 3, 2) float32, texture coordinates (v up, wrapping); (0, 3, 2) without textures.
    colours : (T, 3, 3) float32, linear RGB per corner multiplying the diffuse colour;
        (0, 3, 3) without vertex colours.
    material_ids : (T,) int32 into ``materials``.
    textures : list of (H, W, 3) uint8, sRGB encoded, row 0 on top.
    ambient, background : linear RGB.
    dropped : counts of triangles left out on loading, by reason (``"not finite"``,
        ``"zero area"``, ...).
    focus_distances_m : distances that show the focal stack, near to far, metres.
    view : the film and pinholes that the scene's own camera asks for (pbrt's cameras and
        scene.yaml's ``lightfield``); None where the square picture of ``camera`` is all there is.
    motions : triangles that move while the shutter is open.
    notes : what could not be mapped exactly from another program's format, with file and line.
    """

    name: str
    camera: Camera
    triangles: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    colours: np.ndarray
    material_ids: np.ndarray
    materials: list[Material]
    textures: list[np.ndarray]
    lights: list[Light]
    ambient: tuple[float, float, float] = (0.1, 0.1, 0.1)
    background: tuple[float, float, float] = (0.0, 0.0, 0.0)
    dropped: dict[str, int] = field(default_factory=dict)
    focus_distances_m: tuple[float, ...] = ()
    view: View | None = None
    motions: tuple[Motion, ...] = ()
    notes: tuple[Note, ...] = ()

    @classmethod
    def from_triangles(
        cls,
        triangles: ArrayLike,
        *,
        normals: ArrayLike | None = None,
        uvs: ArrayLike | None = None,
        colours: ArrayLike | None = None,
        surface: Surface | None = None,
        camera: Camera | None = None,
        lights: Sequence[Light] | None = None,
        ambient: tuple[float, float, float] | None = None,
        background: tuple[float, float, float] | None = None,
        name: str = "triangles",
    ) -> Scene:
        """A scene of triangles in memory; what is not given is as for a mesh file.

        Parameters
        ----------
        triangles : (T, 3, 3), corners in metres.  Without ``camera`` they are in world space,
            right-handed, y up, and a camera is placed so that all of them are seen; with one they
            are in its space, x right, y down, z forward.
        normals : (T, 3, 3), shading normals of the corners, of any length; else flat shaded.
        uvs : (T, 3, 2), texture coordinates, v up.
        colours : (T, 3, 3), linear RGB of the corners, which multiplies the surface's.
        surface : material of all of them, with its texture (H, W, 3) uint8 sRGB.
        lights : in camera space; else one over the camera's left shoulder.
        ambient, background : linear RGB.

        Raises
        ------
        SceneError : arrays of other shapes, or no triangle that can be traced.
        """
        from lfcore.scene.arrays import scene_from_triangles

        return scene_from_triangles(
            triangles, normals=normals, uvs=uvs, colours=colours, surface=surface, camera=camera,
            lights=lights, ambient=ambient, background=background, name=name,
        )  # fmt: skip

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)

    def summary(self) -> str:
        """The notes as text, one a line, what is missing first."""
        return summary(self.notes)

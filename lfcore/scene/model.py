"""The model of a scene: flat arrays in camera space.

Camera space is x right, y down, z forward (as OpenCV and COLMAP), in metres.  The builder
of a :class:`Scene` moves the geometry there in float64 and rounds to float32 once.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError, check_kind, printable, suggest_keywords
from lfcore.optics.camera import Camera
from lfcore.optics.focus import DepthRange
from lfcore.optics.lens import Lens
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.scene import lens as scene_lens
from lfcore.scene.appearance import Light, Material
from lfcore.scene.baked import NO_SKY, BakedLight, BakeOptions
from lfcore.scene.checks import check_scene
from lfcore.scene.motion import Animation, Motion, scene_at
from lfcore.scene.notes import KINDS, Count, Note
from lfcore.scene.seen import depth_range
from lfcore.scene.surface_mesh import Surface, SurfaceMesh
from lfcore.scene.view import SHUTTER, View

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True, eq=False)
class Scene:
    """Triangles, materials, lights and the camera.

    Attributes
    ----------
    triangles : (T, 3, 3) float32, corner positions in camera space, metres; finite.
    normals : (T, 3, 3) float32, unit shading normals per corner; (0, 3, 3) when every
        triangle is flat shaded with its geometric normal.
    uvs : (T, 3, 2) float32, texture coordinates (v up, wrapping); (0, 3, 2) without textures.
    colours : (T, 3, 3) float32, linear RGB per corner multiplying the diffuse colour;
        (0, 3, 3) without vertex colours.
    material_ids : (T,) int32 into ``materials``; the next number is the floor's.
    textures : list of (H, W, 3) uint8, sRGB encoded, row 0 on top; (H, W, 4) with alpha, which
        is linear, where materials cut holes by it.  Codes of a material's ``data_textures`` are
        linear, too.
    ambient, background : linear RGB.
    sky : (S, S, 3) float32 octahedral map in camera space (:mod:`lfcore.scene.sky`), shown
        in place of ``background``; (0, 0, 3) without.
    bake : settings for baking the light of sky and surfaces; None: no baking.
    light : the baked light, which replaces ``ambient``.
    clip : whether each ray's light is cut at white, as in the thesis.
    dropped : counts of triangles left out on loading, by reason (``"not finite"``,
        ``"zero area"``, ...).
    focus_distances_m : distances of the scene's focal stack, near to far, metres.
    view : the film and pinholes of the scene's own camera (pbrt's cameras and scene.yaml's
        ``lightfield``); None: a square picture of ``camera``.
    motions : triangles that move while the shutter is open.
    animation : what else moves; None for a scene at rest, and for one that was saved.
    shutter : when the shutter opens and closes, seconds; None: at once.
    floor : the material of the floor under a mesh, numbered after ``materials`` but not one of
        them; ``depth_range`` leaves the floor out.
    notes : differences between the file's scene and this one, with file and line.
    account : numbers of things of each kind in the files, and how many of them are used; empty
        for a scene that was saved.

    Examples
    --------
    >>> scene.triangle_count, len(scene.materials), scene.is_pinhole
    (80, 1, False)
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
    clip: bool = False
    dropped: dict[str, int] = field(default_factory=dict)
    focus_distances_m: tuple[float, ...] = ()
    view: View | None = None
    motions: tuple[Motion, ...] = ()
    animation: Animation | None = None
    shutter: tuple[float, float] | None = None
    notes: tuple[Note, ...] = ()
    account: tuple[Count, ...] = ()
    floor: Material | None = None
    sky: np.ndarray = field(default_factory=lambda: NO_SKY)
    bake: BakeOptions | None = None
    light: BakedLight | None = None

    def __post_init__(self) -> None:
        check_scene(self)

    @classmethod
    @suggest_keywords
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
        """Make a scene of triangles in memory, with the defaults of a mesh file.

        Parameters
        ----------
        triangles : array_like
            (T, 3, 3) corners in metres.  Without ``camera`` in world space, right-handed, y up, and
            a camera is placed that sees all of them; with one in camera space, x right, y down,
            z forward, or in world space where the camera has a pose.
        normals : array_like, optional
            (T, 3, 3) shading normals of the corners, of any length.  Default: flat shaded.
        uvs : array_like, optional
            (T, 3, 2) texture coordinates, v up.
        colours : array_like, optional
            (T, 3, 3) linear RGB of the corners, which multiplies the surface's.
        surface : Surface, optional
            The material, with its texture.
        camera : Camera, optional
            See ``triangles``.
        lights : sequence of Light, optional
            In camera space.  Default: one over the camera's left shoulder.
        ambient, background : (float, float, float), optional
            Linear RGB.
        name : str
            The scene's name.

        Returns
        -------
        Scene
            The scene.

        Raises
        ------
        SceneError
            Arrays of other shapes, or no triangle that can be traced.

        Examples
        --------
        >>> triangle = [[[-1, 0, 0], [1, 0, 0], [0, 1, 0]]]
        >>> lfcore.Scene.from_triangles(triangle).triangles.shape
        (1, 3, 3)
        """
        # Seldom needed, and readers of scene files are slow to import.
        from lfcore.scene.in_memory import corner_values, scene_of_parts

        check_kind(surface, Surface | None, "surface", "a Surface")
        corners = corner_values("triangles", triangles, None, 3)
        if not len(corners):
            raise SceneError("the scene is empty: no triangles were given", key="triangles")
        part = SurfaceMesh(
            corners,
            replace(surface or Surface(), curved=normals is not None),
            corner_values("normals", normals, len(corners), 3) if normals is not None else None,
            corner_values("uvs", uvs, len(corners), 2) if uvs is not None else None,
            corner_values("colours", colours, len(corners), 3) if colours is not None else None,
        )
        return scene_of_parts([part], name, camera, lights, ambient=ambient, background=background)

    @classmethod
    @suggest_keywords
    def from_trimesh(
        cls,
        scene: trimesh.Scene | trimesh.Trimesh,
        *,
        camera: Camera | None = None,
        lights: Sequence[Light] | None = None,
        ambient: tuple[float, float, float] | None = None,
        background: tuple[float, float, float] | None = None,
        name: str = "trimesh",
    ) -> Scene:
        """Make a scene from trimesh's, with its materials, textures and colours.

        Parameters
        ----------
        scene : trimesh.Scene or trimesh.Trimesh
            Its camera and lights are not taken over.
        camera, lights, ambient, background, name
            As in :meth:`from_triangles`.

        Returns
        -------
        Scene
            As :func:`lfcore.load_scene` makes one of a mesh file.

        Raises
        ------
        SceneError
            The scene has no triangle that can be traced, or a damaged material.
        """
        from lfcore.scene.in_memory import scene_of_parts
        from lfcore.scene.trimesh_parts import parts_of

        meshes = scene if hasattr(scene, "geometry") else scene.scene()
        parts = parts_of(meshes)
        return scene_of_parts(parts, name, camera, lights, ambient=ambient, background=background)

    def __repr__(self) -> str:
        materials, lights = len(self.materials), len(self.lights)
        counts = f"{self.triangle_count} triangles, {materials} materials, {lights} lights"
        return f"<Scene {self.name!r}: {counts}>"

    @property
    def triangle_count(self) -> int:
        return len(self.triangles)

    @property
    def every_material(self) -> list[Material]:
        """The materials that ``material_ids`` count, with that of the floor."""
        return [*self.materials, *([self.floor] if self.floor else [])]

    @property
    def motion_times(self) -> tuple[float, float]:
        """The times of the first and the last pose of ``motions``, seconds."""
        return self.view.motion_times if self.view else SHUTTER

    @property
    def instants(self) -> tuple[float, float] | None:
        """When the scene begins and ends to move, seconds; None for a scene at rest."""
        spans = [self.motion_times] if self.motions else []
        if self.animation:
            spans.append((self.animation.start_s, self.animation.end_s))
        return (min(span[0] for span in spans), max(span[1] for span in spans)) if spans else None

    def at(self, time_s: float) -> Scene:
        """The scene at an instant, which moves no more.

        What moves rests before the first instant of :attr:`instants` and after the last.  The
        lens, its focus and baked light stay.

        Parameters
        ----------
        time_s : float
            Seconds.

        Raises
        ------
        SceneError
            The time is no finite number.

        Examples
        --------
        >>> scene.instants, scene.at(0.5).triangle_count
        (None, 80)
        """
        return scene_at(replace(self, shutter=None) if self.shutter else self, time_s)

    def exposed(self, opened_s: float, closed_s: float) -> Scene:
        """The scene while a shutter is open: :func:`lfcore.render` and :func:`lfcore.record`
        spread the lens samples over that time.

        A scene at rest stays as it is.

        Parameters
        ----------
        opened_s, closed_s : float
            Seconds; of a film from each of its times.

        Raises
        ------
        SceneError
            The shutter closes before it opens.
        """
        if not (math.isfinite(opened_s) and opened_s <= closed_s < math.inf):
            problem = f"opens at {opened_s!r} and closes at {closed_s!r} s"
            raise SceneError(problem, key="shutter", remedy="Let it open first")
        if self.instants is None:
            return self
        if opened_s == closed_s:
            return self.at(opened_s)
        return replace(self, shutter=(float(opened_s), float(closed_s)))

    @cached_property
    def depth_range(self) -> DepthRange | None:
        """The nearest and farthest visible depth, metres, without the 2 percent nearest and
        farthest rays; None if no ray has a hit."""
        own_triangles = self.triangles[self.material_ids < len(self.materials)]
        return depth_range(own_triangles, self.camera.field_width)

    @cached_property
    def is_pinhole(self) -> bool:
        """Whether the lens is too small to blur any visible point."""
        return scene_lens.is_pinhole(self)

    def with_lens(self) -> Scene:
        """The scene with a lens fitted to the visible depths, as for a mesh without camera.

        The focus stays if it is within the visible depths, else it is their middle.
        """
        return scene_lens.with_lens(self)

    @suggest_keywords
    def plane(
        self,
        focus_m: float | str | None = None,
        f_number: float | None = None,
        aperture: str = "circle",
        *,
        focus_at: Sequence[float] | None = None,
        blur: float | str | None = None,
        pixels: Pixels = 1,
        blades: int = 6,
        rotation_deg: float = 0.0,
        normalise: str = "aperture",
        keep_magnification: bool = False,
        half: str | None = None,
        lens: Lens | str | Path | None = None,
    ) -> SensorPlane:
        """A picture's focus and aperture, for :func:`lfcore.render`.

        Parameters
        ----------
        focus_m : float or str, optional
            Metres, ``math.inf`` allowed; ``"near"``, ``"middle"``, ``"far"``, or a share such as
            ``"40%"`` of the visible depths, even in dioptres.  Default: the camera's; a pinhole
            with a given aperture has the focus of :meth:`with_lens`.
        f_number : float, optional
            Default: the camera's; a pinhole with a given focus has that of :meth:`with_lens`.
        aperture : str
            ``circle``, ``square``, ``diamond`` or ``polygon``.
        focus_at : (float, float), optional
            Instead of ``focus_m``, the place in the picture to focus on: x and y from 0 to 1,
            from the picture's upper left corner.
        blur : float or str, optional
            Instead of ``f_number``, the diameter of the blur at the more defocused end of the
            visible depths, a share of the picture's shorter side: 0.03 or ``"3%"``.
        pixels : int or (int, int)
            The picture's width and height where they differ, for ``focus_at``.
        blades, rotation_deg, normalise, keep_magnification, half, lens : optional
            As in :class:`lfcore.SensorPlane`; a lens may be its file.

        Raises
        ------
        OpticsError
            A setting is given in two ways, or cannot be met.

        Examples
        --------
        >>> scene.plane("near", 4.0, "polygon", blades=5).f_number
        4.0
        """
        focus_m, f_number = scene_lens.focus_and_aperture(
            self, focus_m, f_number, focus_at, blur, pixels
        )
        return SensorPlane.of(
            self.camera, focus_m, f_number, aperture, blades=blades, rotation_deg=rotation_deg,
            normalise=normalise, keep_magnification=keep_magnification, half=half, lens=lens,
        )  # fmt: skip

    def has_alpha_test(self, material: Material) -> bool:
        """Whether the alpha of its texture cuts holes into the material's surfaces."""
        return material.alpha_cutoff > 0 and self._has_alpha(material)

    def has_alpha_blend(self, material: Material) -> bool:
        """Whether the alpha of its texture makes the material's surfaces transparent."""
        return material.alpha_blend and self._has_alpha(material)

    def _has_alpha(self, material: Material) -> bool:
        if material.texture < 0 or not len(self.uvs):
            return False
        return self.textures[material.texture].shape[2] == 4

    def account_text(self) -> str:
        """The account as text, a line per file."""
        files = dict.fromkeys(count.file for count in self.account)
        return "\n".join(
            printable(
                f"{file}: {', '.join(str(count) for count in self.account if count.file == file)}"
            )
            for file in files
        )

    def summary(self) -> str:
        """The notes as text, one per line, missing things first."""
        ranked = sorted(self.notes, key=lambda note: KINDS.index(note.kind))
        return "\n".join(map(str, ranked))

"""The model of a scene: flat arrays in camera space.

Camera space is x right, y down, z forward (as OpenCV and COLMAP), in metres.  The builder
of a :class:`Scene` moves the geometry there in float64 and rounds to float32 once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import OpticsError, SceneError, check_kind, printable, suggest_keywords
from lfcore.optics.camera import Camera
from lfcore.optics.focus import DepthRange, exclude_twice, f_number_of_blur, focus_distance
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.reading import Where
from lfcore.scene.appearance import Light, Material
from lfcore.scene.arrays import check_array
from lfcore.scene.assemble import assemble
from lfcore.scene.baked import NO_SKY, BakedLight, BakeOptions
from lfcore.scene.checks import check_scene
from lfcore.scene.notes import KINDS, Count, Note
from lfcore.scene.seen import depth_range
from lfcore.scene.seen import focus_at as focus_at_place
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, parse_colour
from lfcore.scene.transforms import affine, pose_from_matrix
from lfcore.scene.view import SHUTTER, View

if TYPE_CHECKING:
    import trimesh

LEAST_PINHOLE = 1000.0
"""The least f-number of a pinhole."""
PINHOLE_BLUR = 1e-5
"""The most blur of the nearest point through a pinhole, as a share of the picture's shorter
side."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A rigid motion of some triangles while the shutter is open.

    Parameters
    ----------
    first, count : int
        The first triangle and the number of triangles.
    start, end : ndarray
        (4, 4) float64: the first and last pose in camera space.  The scene's arrays have the
        triangles in the first pose.
    """

    first: int
    count: int
    start: np.ndarray
    end: np.ndarray

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            check_array(name, getattr(self, name), (4, 4))

    def pose(self, time: float) -> np.ndarray:
        """(4, 4) that moves the stored triangles to ``time`` in [0, 1]."""
        from scipy.spatial.transform import Rotation, Slerp  # seldom needed, slow to import

        move = self.end @ np.linalg.inv(self.start)
        slerp = Slerp([0.0, 1.0], Rotation.from_matrix(np.stack([np.eye(3), move[:3, :3]])))
        turn = slerp(time).as_matrix()
        # Objects turn about their own origin, not about the camera.
        pivot = self.start[:3, 3]
        return affine(turn, pivot + time * (self.end[:3, 3] - pivot) - turn @ pivot)


@dataclass(frozen=True, eq=False)
class Animation:
    """The animation of a scene's files, from ``start_s`` to ``end_s``; it rests before and after.

    ``at(scene, time_s)`` gives the scene at an instant.
    """

    start_s: float
    end_s: float
    at: Callable[[Scene, float], Scene]


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
        check_kind(surface, Surface | None, "surface", "a Surface")
        corners = _checked("triangles", triangles, None, 3)
        if not len(corners):
            raise SceneError("the scene is empty: no triangles were given", key="triangles")
        part = SurfaceMesh(
            corners,
            replace(surface or Surface(), curved=normals is not None),
            _checked("normals", normals, len(corners), 3) if normals is not None else None,
            _checked("uvs", uvs, len(corners), 2) if uvs is not None else None,
            _checked("colours", colours, len(corners), 3) if colours is not None else None,
        )
        return cls._of_parts([part], name, camera, lights, ambient=ambient, background=background)

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
        from lfcore.scene.trimesh_parts import parts_of

        meshes = scene if hasattr(scene, "geometry") else scene.scene()
        parts = parts_of(meshes)
        return cls._of_parts(parts, name, camera, lights, ambient=ambient, background=background)

    @classmethod
    def _of_parts(
        cls,
        parts: list[SurfaceMesh],
        name: str,
        camera: Camera | None,
        lights: Sequence[Light] | None,
        **light: tuple[float, float, float] | None,
    ) -> Scene:
        # Seldom needed, and readers of scene files are slow to import.
        from lfcore.scene import framing
        from lfcore.scene.description import complete
        from lfcore.scene.limits import within_limits

        check_kind(camera, Camera | None, "camera", "a Camera")
        defaults, to_camera = complete({"objects": []}), np.eye(4)
        if camera is None:
            extent = framing.bounds(parts, file=name)
            camera, to_camera = framing.place_camera(defaults["camera"], extent, Where(name))
        elif camera.pose is not None:
            to_camera = pose_from_matrix(camera.pose, Where("", "camera.pose"))
            camera = replace(camera, pose=None)
        geometry = assemble(parts, to_camera)
        geometry.refuse_none(Where("", "triangles"))
        around: dict[str, Any] = {
            key: parse_colour(defaults[key]) if value is None else value
            for key, value in light.items()
        }
        scene = cls(
            name=name,
            camera=camera,
            lights=framing.default_lights() if lights is None else list(lights),
            focus_distances_m=framing.default_focus_distances(camera, geometry.triangles),
            **around,
            **geometry.arrays,
        )
        return within_limits(scene, name)

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
        from lfcore.scene.motion import scene_at  # which imports this module

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
        camera = self.camera
        if camera.f_number < LEAST_PINHOLE or self.depth_range is None:
            return False
        return camera.lens_radius_m < PINHOLE_BLUR * camera.field_width * self.depth_range.near_m

    def with_lens(self) -> Scene:
        """The scene with a lens fitted to the visible depths, as for a mesh without camera.

        The focus stays if it is within the visible depths, else it is their middle.
        """
        from lfcore.scene.framing import fitted_lens

        camera, visible = self.camera, self.depth_range
        if visible is None:
            return self
        inside = visible.near_m <= camera.focus_m <= visible.far_m
        focus = camera.focus_m if inside else visible.middle_m
        return replace(self, camera=fitted_lens(visible, camera.field_width, focus))

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
    ) -> SensorPlane:
        """A picture's focus and aperture, for :func:`lfcore.render`.

        Parameters
        ----------
        focus_m : float or str, optional
            Metres, ``math.inf`` allowed; ``"near"``, ``"middle"``, ``"far"``, or a share such as
            ``"40%"`` of the visible depths, even in dioptres.  Default is the camera's; of a
            pinhole, that of :meth:`with_lens` where an aperture is given.
        f_number : float, optional
            Default is the camera's; of a pinhole, that of :meth:`with_lens` where a focus is given.
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
        blades, rotation_deg, normalise, keep_magnification, half : optional
            As in :class:`lfcore.SensorPlane`.

        Raises
        ------
        OpticsError
            A setting is given in two ways, or cannot be met.

        Examples
        --------
        >>> scene.plane("near", 4.0, "polygon", blades=5).f_number
        4.0
        """
        exclude_twice(focus_m=focus_m, focus_at=focus_at)
        exclude_twice(f_number=f_number, blur=blur)
        camera = self.camera
        settings = focus_m, focus_at, f_number, blur
        if self.is_pinhole and any(value is not None for value in settings):
            lens = self.with_lens().camera
            if f_number is None and blur is None:
                f_number = camera.focal_length_m / (2 * lens.lens_radius_m)
            if focus_m is None and focus_at is None:
                focus_m = lens.focus_m
        if focus_at is not None:
            focus_m = focus_at_place(self.triangles, camera.field_width, focus_at, pixels)
        elif focus_m is not None:
            focus_m = focus_distance(focus_m, self.depth_range)
        if blur is not None:
            f_number = f_number_of_blur(
                blur, camera.focal_length_m, camera.focus_m if focus_m is None else focus_m,
                camera.field_width, self.depth_range,
            )  # fmt: skip
        if focus_m is not None and focus_m <= camera.focal_length_m and self.depth_range:
            near, far = self.depth_range
            raise OpticsError(
                f"{focus_m:.4g} m is nearer than the lens can focus, {camera.focal_length_m:.4g} m",
                key="focus_m", remedy=f"Surfaces are at {near:.4g} to {far:.4g} m: near or far",
            )  # fmt: skip
        return SensorPlane.of(
            camera, focus_m, f_number, aperture, blades=blades, rotation_deg=rotation_deg,
            normalise=normalise, keep_magnification=keep_magnification, half=half,
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


def _checked(key: str, values: ArrayLike, count: int | None, width: int) -> np.ndarray:
    try:
        array = np.asarray(values, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise SceneError(f"are no array of numbers: {error}", key=key) from None
    expected = (len(array) if count is None and array.ndim else count, 3, width)
    if array.shape != expected:
        raise SceneError(f"must be ({count or 'T'}, 3, {width}), not {array.shape}", key=key)
    return array

"""Programs without the features that a scene lacks, against programs with them.

Both trace the same rays in turn; ``identical`` is whether frames and plane sums agree to the last
bit.  The *full* program has the feature compiled in and its buffers filled with neutral data: white
vertex colours, a light of strength 0, black highlights.
"""

import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from lfcore.errors import LfcoreError
from lfcore.opencl.device import Device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.tiles import TileTracing, trace_tile
from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.scene.baked import BakedLight
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.scene.surface_mesh import face_normals
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.timing import measure_in_turn
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.plan import probe
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.tracer import Tracer

IDLE = Light(DIRECTIONAL, (0.0, -1.0, 0.0), (1e-30,) * 3)
"""An additional light, so weak that it adds nothing, but not black."""


@dataclass(frozen=True)
class Feature:
    """A feature that a scene may lack, a ``field`` of :class:`Needs`.

    ``defines`` are macros of the kernels; ``what`` describes the omitted code and data.  ``fill``
    adds neutral data for the full program; ``part`` is the part of the scene that both
    programs trace.
    """

    field: str
    defines: tuple[str, ...]
    what: str
    fill: Callable[[Scene], Scene] = lambda scene: scene
    part: Callable[[Scene], Scene] = lambda scene: scene

    def missing(self, needs: Needs) -> bool:
        """Whether a scene with these needs lacks the feature."""
        return not getattr(needs, self.field)


def _black_light(scene: Scene) -> Scene:
    """Add black baked light, which a sky needs."""
    if scene.light:
        return scene
    grids = np.tile(np.array([0, 0, 1], np.int32), (scene.triangle_count, 1))
    return replace(scene, light=BakedLight(grids, np.zeros((3, 3), np.float32)))


def _flat_normals(scene: Scene) -> Scene:
    if len(scene.normals):
        return scene
    normal = face_normals(scene.triangles.astype(np.float64)).astype(np.float32)
    return replace(scene, normals=np.repeat(normal[:, None], 3, axis=1))


def _unused_texture(scene: Scene) -> Scene:
    uvs = np.zeros((scene.triangle_count, 3, 2), np.float32)
    return replace(scene, uvs=uvs, textures=[np.full((2, 2, 3), 255, np.uint8)])


def _in_the_dark(scene: Scene) -> Scene:
    return replace(scene, ambient=(0.0,) * 3, background=(0.0,) * 3)


FEATURES = (
    Feature("textures", ("TEXTURES",), "texture coordinates, texels, and their lookup",
            _unused_texture),
    Feature("alpha_tests", ("TEXTURES",), "holes, looked up at hits"),
    Feature("physical", ("TEXTURES",), "metal, roughness, and textures that bend and vary them"),
    Feature("smooth_normals", ("SMOOTH",), "corner normals and their interpolation",
            _flat_normals),
    Feature("curved", ("CURVED",), "shadow rays that start beside the hit points",
            _flat_normals),
    Feature("vertex_colours", ("VERTEX_COLOURS",), "corner colours and their interpolation",
            lambda scene: replace(
                scene, colours=np.ones((scene.triangle_count, 3, 3), np.float32))),
    Feature("shadows", ("SHADOWS",),
            "shadow rays, hit points and unshadowed light",
            lambda scene: replace(scene, lights=[*scene.lights, IDLE])),
    Feature("baked", ("BAKED",), "baked light (without background and ambient light)",
            _black_light, _in_the_dark),
    Feature("sky", ("SKY",), "the sky and baked light (without background and ambient light)",
            lambda scene: replace(_black_light(scene), sky=np.zeros((8, 8, 3), np.float32)),
            _in_the_dark),
    # So dim that no ray is brighter than white.
    Feature("stops", (), "sums of light above white (ambient light)",
            part=lambda scene: replace(scene, lights=[], clip=False)),
)  # fmt: skip


def full_needs(filled: Scene, field: str) -> Needs:
    """The needs of a filled scene, with the feature switched on."""
    needs = Needs.of(filled)
    value = getattr(needs, field)
    return replace(needs, **{field: value or type(value)(True)})


class LeftOutError(LfcoreError):
    """A picture changes when an unneeded feature is left out."""


@dataclass(frozen=True)
class Program:
    """A tracer that makes planes, frames or both from all rays of a slab."""

    tracer: Tracer
    slab: Slab
    planes: Sequence[SensorPlane]
    frames: bool

    def tile(self) -> Tile:
        """The whole slab."""
        side = self.slab.pixels
        return FrameLayout("macropixels", self.slab.views, side).tile(0, 0, side, side)

    def tracing(self) -> TileTracing:
        return trace_tile(self.tracer, self.slab, self.tile(), self.planes, frames=self.frames)

    def run(self) -> TileTracing:
        """Trace everything once, to the end."""
        return self.tracing().finished()

    @cached_property
    def made(self) -> tuple[np.ndarray, np.ndarray]:
        """Frames and plane sums."""
        tracing = self.tracing()
        frames = np.concatenate([chunk.frames.copy() for chunk in tracing] or [np.empty(0)])
        assert tracing.plane_sums is not None  # the tracing has ended
        return frames, tracing.plane_sums.sums

    @cached_property
    def bytes(self) -> int:
        """The bytes of the scene's buffers on the device, without the tree, and of all workers."""
        s = pack_surfaces(self.tracer.scene, self.tracer.needs)
        arrays = (s.corners, s.attributes, s.material_ids, s.materials, s.lights, s.levels)
        job = self.tracer.job("IMAGE", probe(self.slab))
        return sum(array.nbytes for array in (*arrays, s.texels)) + job.scratch.size


@dataclass(frozen=True)
class Comparison:
    """Two programs; ``lean`` lacks the feature that ``what`` describes.

    ``saved`` are the bytes saved; default is the difference of ``bytes``.  ``identical``:
    the results agree; default compares the frames and planes of both.
    """

    feature: str
    what: str
    full: Program
    lean: Program
    saved: int | None = None
    identical: bool | None = None

    def row(self, repeats: int) -> dict:
        """The row of the report; the programs take turns, and seconds are core seconds."""
        full, lean, identical = self.full, self.lean, self.identical
        (frames, sums), (lean_frames, lean_sums) = full.made, lean.made
        if identical is None:
            identical = not (full.frames and lean.frames) or np.array_equal(frames, lean_frames)
            identical &= not (full.planes and lean.planes) or np.array_equal(sums, lean_sums)
        saved = full.bytes - lean.bytes if self.saved is None else self.saved
        full_time, lean_time = measure_in_turn(
            (full.run, lean.run), repeats=repeats, clock=time.process_time
        )
        return {
            "feature": self.feature,
            "what": self.what,
            "seconds_full": full_time.median,
            "seconds_left_out": lean_time.median,
            "bytes_saved": int(saved),
            "identical": identical,
        }


def check_identical(rows: Iterable[dict]) -> None:
    """Raises :class:`LeftOutError` that names the rows whose two programs differ in a bit."""
    differ = [f"{row['scene']}, {row['feature']}" for row in rows if not row["identical"]]
    if differ:
        raise LeftOutError(
            f"frames or plane sums change when unneeded features are left out: {'; '.join(differ)}",
            remedy="lfcore/evaluation/left_out.py has the switches of each feature",
        )


def left_out(
    scene: Scene,
    bvh: Bvh,
    device: Device,
    *,
    views: int,
    pixels: int,
    repeats: int = 5,
    features: str | Sequence[str] = "all",
) -> list[dict]:
    """A row per omitted feature of ``scene``.

    ``features`` are fields of :class:`Needs`; default ``all``.
    """
    slab, camera = Slab(scene.camera, views, pixels), scene.camera
    recorded = SensorPlane(camera.focus_m, camera.f_number)

    def program(
        scene: Scene = scene,
        needs: Needs | None = None,
        planes: Sequence[SensorPlane] = (recorded,),
        frames: bool = True,
    ) -> Program:
        return Program(Tracer(scene, bvh, device, needs), slab, planes, frames)

    comparisons = itertools.chain(lacking(scene, program, features), unwanted(program))
    return [{"scene": scene.name, **comparison.row(repeats)} for comparison in comparisons]


def lacking(
    scene: Scene, program: Callable[..., Program], names: str | Sequence[str]
) -> Iterator[Comparison]:
    """Code and buffers of features that the scene lacks."""
    needs = Needs.of(scene)
    whole = program(needs=needs)
    for feature in FEATURES:
        if feature.missing(needs) and (names == "all" or feature.field in names):
            part = feature.part(scene)
            filled = feature.fill(part)
            full = program(filled, needs=full_needs(filled, feature.field))
            lean = whole if part is scene else program(part)
            yield Comparison(feature.field, feature.what, full, lean)


def unwanted(program: Callable[..., Program]) -> Iterator[Comparison]:
    """Omitted frames, omitted planes, and lens blocks outside the aperture."""
    only_frames = program(planes=[])
    slab, tile, camera = only_frames.slab, only_frames.tile(), only_frames.slab.camera
    whole = SensorPlane(camera.focus_m, camera.f_number, aperture="square")
    stopped = SensorPlane(camera.focus_m, 4 * camera.f_number)
    frames_and_planes, planes_alone = program(planes=[whole]), program(planes=[whole], frames=False)
    text = "video frames, if the light field is not stored"
    saved = tile.frame_count * tile.layout.frame_bytes
    yield Comparison("frames", text, frames_and_planes, planes_alone, saved)
    text = "sensor planes and their tables, for a light field alone"
    saved = 32 * slab.pixels**2 * frames_and_planes.tracer.device.threads
    yield Comparison("planes", text, frames_and_planes, only_frames, saved)
    text = "lens blocks outside every aperture (a plane at f/4 of the lens; full: a square plane)"
    narrow = program(planes=[stopped], frames=False)
    beside = program(planes=[whole, stopped], frames=False)
    agree = np.array_equal(beside.made[1][1], narrow.made[1][0])
    yield Comparison("lens_blocks", text, planes_alone, narrow, 0, agree)

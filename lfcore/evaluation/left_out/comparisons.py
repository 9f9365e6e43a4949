"""All that is left out for a scene, measured against the program with it.

Both programs run on the same rays in turn, and ``identical`` says whether frames and plane sums
agree to the last bit.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from lfcore.errors import LfcoreError
from lfcore.evaluation.left_out.features import FEATURES, NO_LIGHT, full_needs
from lfcore.evaluation.left_out.packages import packages
from lfcore.evaluation.timing import measure_in_turn
from lfcore.opencl.device import Device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.direct import finished
from lfcore.rendering.record import record_tile
from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.storage import defaults
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.tracing import reach
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.tile import TileTracing
from lfcore.tracing.tracer import Tracer

Run = Callable[[], object]
COLUMNS = (
    "scene", "feature", "what", "seconds_full", "seconds_left_out", "bytes_saved", "identical",
)  # fmt: skip


class LeftOutError(LfcoreError):
    """What a scene does not need changes its picture when it is left out."""


@dataclass(frozen=True)
class Rays:
    """The rays that all programs trace, and how often under the clock."""

    slab: Slab
    repeats: int

    @property
    def plane(self) -> SensorPlane:
        """The recorded picture through the whole lens."""
        camera = self.slab.camera
        return SensorPlane(camera.focus_distance_m, camera.f_number)

    @property
    def tile(self) -> Tile:
        """The whole slab."""
        layout = FrameLayout("macropixels", self.slab.views, self.slab.pixels)
        return layout.tile(0, 0, self.slab.pixels, self.slab.pixels)

    def row(
        self, feature: str, what: str, full: Run, lean: Run, saved: int, identical: bool
    ) -> dict:
        """A row of the report; ``full()`` and ``lean()`` take turns under the clock.

        Both have run before, to be compared.
        """
        full_time, lean_time = measure_in_turn((full, lean), repeats=self.repeats, warm_up=0)
        return {
            "feature": feature,
            "what": what,
            "seconds_full": full_time.median,
            "seconds_left_out": lean_time.median,
            "bytes_saved": int(saved),
            "identical": identical,
        }


@dataclass(frozen=True)
class Program:
    """A tracer that makes planes, frames or both of the rays."""

    tracer: Tracer
    bvh: Bvh
    rays: Rays
    planes: Sequence[SensorPlane]
    frames: bool = True

    def tracing(self) -> TileTracing:
        rays = self.rays
        return self.tracer.trace_tile(rays.slab, rays.tile, self.planes, frames=self.frames)

    def run(self) -> None:
        finished(self.tracing())

    @cached_property
    def made(self) -> tuple[list[np.ndarray], np.ndarray]:
        """Frames, copied, and plane sums."""
        tracing = self.tracing()
        frames = [chunk.frames.copy() for chunk in tracing]
        assert tracing.plane_sums is not None  # of a tracing that has ended
        return frames, tracing.plane_sums.sums

    @property
    def bytes(self) -> int:
        """Of the scene's buffers on the device, surfaces and hierarchy, and of all workers."""
        s, bvh = pack_surfaces(self.tracer.scene, self.tracer.needs), self.bvh
        arrays = (s.corners, s.attributes, s.material_ids, s.materials, s.lights, s.images)
        tree = (bvh.boxes, bvh.children, bvh.leaves, bvh.leaf_ids)
        rays = self.rays
        return sum(array.nbytes for array in (*arrays, s.texels, *tree)) + (
            self.tracer.scratch_bytes(rays.slab, rays.tile, self.planes, frames=self.frames)
        )


def compared(
    feature: str,
    what: str,
    full: Program,
    lean: Program,
    *,
    saved: int | None = None,
    identical: bool | None = None,
) -> dict:
    """A row of two programs: equal in the frames, and in the planes, that both of them make."""
    (frames, sums), (lean_frames, lean_sums) = full.made, lean.made
    if identical is None:
        identical = not (full.frames and lean.frames) or same(frames, lean_frames)
        identical &= not (full.planes and lean.planes) or np.array_equal(sums, lean_sums)
    saved = full.bytes - lean.bytes if saved is None else saved

    return full.rays.row(feature, what, full.run, lean.run, saved, identical)


def same(one: Iterable[np.ndarray], other: Iterable[np.ndarray]) -> bool:
    """Whether arrays agree to the last bit."""
    one, other = list(one), list(other)
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def check_identical(rows: Iterable[dict]) -> None:
    """Raises :class:`LeftOutError` that names the rows whose two programs differ in a bit."""
    differ = [f"{row['scene']}, {row['feature']}" for row in rows if not row["identical"]]
    if differ:
        raise LeftOutError(
            f"frames or plane sums change when what is not needed is left out: {'; '.join(differ)}",
            remedy="lfcore/evaluation/left_out/features.py says what each feature switches",
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
    """Rows with :data:`COLUMNS` of everything that is left out for ``scene``.

    ``features`` are fields of :class:`Needs`, ``all`` of which are compared unless some are named.
    """
    rays = Rays(Slab(scene.camera, views, pixels), repeats)

    def program(
        scene: Scene = scene,
        bvh: Bvh = bvh,
        needs: Needs | None = None,
        planes: Sequence[SensorPlane] = (rays.plane,),
        frames: bool = True,
    ) -> Program:
        return Program(Tracer(scene, bvh, device, needs), bvh, rays, planes, frames)

    rows = [
        *lacking(scene, program, features),
        *beyond_reach(scene, bvh, program),
        *unwanted(program),
        stored(program(frames=False)),
        *packages(scene),
    ]
    return [{"scene": scene.name, **row} for row in rows]


def lacking(
    scene: Scene, program: Callable[..., Program], names: str | Sequence[str]
) -> Iterator[dict]:
    """Code and buffers of features that the scene lacks."""
    needs = Needs.of(scene)
    whole = program(needs=needs)
    for feature in FEATURES:
        if feature.missing(needs) and (names == "all" or feature.field in names):
            part = feature.part(scene)
            filled = feature.fill(part)
            full = program(filled, needs=full_needs(filled, feature.field))
            lean = whole if part is scene else program(part, needs=Needs.of(part))
            yield compared(feature.field, feature.what, full, lean)


def beyond_reach(scene: Scene, bvh: Bvh, program: Callable[..., Program]) -> Iterator[dict]:
    """Triangles that no ray meets and none of whose shadows is seen; lights that light nothing."""
    met, leaves = reach.lean(scene, bvh, scene.camera)
    what = (
        f"{scene.triangle_count - met.triangle_count} of {scene.triangle_count} triangles and "
        f"{bvh.leaf_count - leaves.leaf_count} of {bvh.leaf_count} leaves beyond the rays and "
        "their shadows"
    )
    yield compared("triangles", what, program(), program(met, leaves))

    def with_light(strength: float) -> Program:
        light = Light(DIRECTIONAL, (0.0, -1.0, 0.0), (strength,) * 3)
        return program(replace(scene, lights=[*scene.lights, light]))

    what = "a light of no strength, its shadow rays, and lights on the far side of all that is seen"
    yield compared("dark_lights", what, with_light(NO_LIGHT), with_light(0.0))


def unwanted(program: Callable[..., Program]) -> Iterator[dict]:
    """Frames that nobody stores, planes that nobody looks at, lens blocks that no ray needs."""
    rays = program().rays
    slab, tile, camera = rays.slab, rays.tile, rays.slab.camera
    whole = SensorPlane(camera.focus_distance_m, camera.f_number, shape="square")
    stopped = SensorPlane(camera.focus_distance_m, 4 * camera.f_number)
    both, alone = program(planes=[whole]), program(planes=[whole], frames=False)
    what = "video frames, where the light field is not stored"
    saved = tile.frame_count * tile.layout.frame_bytes
    yield compared("frames", what, both, alone, saved=saved)
    what = "sensor planes and their tables, where only the light field is wanted"
    stored_alone = program(planes=[])
    saved = 32 * slab.pixels**2 * both.tracer.device.threads + both.bytes - stored_alone.bytes
    yield compared("planes", what, both, stored_alone, saved=saved)
    what = "lens blocks outside every aperture (a plane at f/4 of the lens; full: a square plane)"
    narrow = program(planes=[stopped], frames=False)
    beside = program(planes=[whole, stopped], frames=False)
    agree = np.array_equal(beside.made[1][1], narrow.made[1][0])
    yield compared("lens_blocks", what, alone, narrow, saved=0, identical=agree)


def stored(alone: Program) -> dict:
    """Encoding and joining, against forming planes alone: what ``store: false`` saves."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "lightfield.mkv"
        sums = _store(alone, file)
        return alone.rays.row(
            "stage: store",
            "jobs that encode, join and retrieve, where only pictures are wanted (store: false); "
            "bytes are of the file",
            lambda: _store(alone, file),
            alone.run,
            file.stat().st_size,
            np.array_equal(sums, alone.made[1]),
        )


def _store(program: Program, file: Path) -> np.ndarray:
    """Trace, encode and join; the plane sums that were formed on the way."""
    slab, tracer = program.rays.slab, program.tracer
    spec = defaults.default_spec(slab.views)
    layout = FrameLayout("macropixels", slab.views, slab.pixels, pixel_format=spec.pixel_format)
    tile = layout.tile(0, 0, slab.pixels, slab.pixels)
    segment = file.with_name("0.mp4")
    tracing, _ = record_tile(tracer, slab, tile, segment, spec, program.planes)
    scene = {"name": tracer.scene.name, "digest": "0" * 64}
    join_segments(file, [segment], [tile], layout, geometry=slab, scene=scene, spec=spec)
    assert tracing.plane_sums is not None  # of a tracing that has ended
    return tracing.plane_sums.sums

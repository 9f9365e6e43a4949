"""What scenes do not need, and what leaving it out saves, against the program with it.

The *full* program has the feature compiled in and its buffers filled with what changes nothing:
white vertex colours, a light of no strength, black highlights.  Both run on the same rays,
and ``identical`` says whether frames and plane sums agree to the last bit.  White vertex colours
interpolate to one within rounding only, and may not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from lfcore.evaluation.timing import measure
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.model import DIRECTIONAL, Light, Scene
from lfcore.scene.needs import Needs
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.tracer import Tracer

COLUMNS = (
    "scene", "feature", "what", "seconds_full", "seconds_left_out", "bytes_saved", "identical",
)  # fmt: skip
NO_LIGHT = 1e-30
"""Strength of the light that a full program has too many: not black, and adds nothing."""
REPEATS = 5


@dataclass(frozen=True)
class Feature:
    """A feature that a scene may lack.

    Attributes
    ----------
    field : of :class:`Needs`.
    defines : of the kernels that it switches.
    what : what is left out without it.
    missing : of needs, whether a scene lacks it.
    fill : the same scene with data of the feature that change nothing, to run it in full; None
        where nothing but a number is left out, for the reason in ``what``.
    """

    field: str
    defines: tuple[str, ...]
    what: str
    missing: Callable[[Needs], bool]
    fill: Callable[[Scene], Scene] | None = None


def _lacks(field: str) -> Callable[[Needs], bool]:
    return lambda needs: not getattr(needs, field)


def _white_corners(scene: Scene) -> Scene:
    return replace(scene, colours=np.ones((scene.triangle_count, 3, 3), np.float32))


def _flat_normals(scene: Scene) -> Scene:
    p, q, r = scene.triangles.astype(float).swapaxes(0, 1)
    normal = np.cross(q - p, r - p)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    normals = np.repeat(normal[:, None], 3, axis=1).astype(np.float32)
    return replace(scene, normals=normals)


def _unused_texture(scene: Scene) -> Scene:
    uvs = np.zeros((scene.triangle_count, 3, 2), np.float32)
    return replace(scene, uvs=uvs, textures=[np.full((2, 2, 3), 255, np.uint8)])


def _idle_light(*, shadows: bool) -> Callable[[Scene], Scene]:
    light = Light(DIRECTIONAL, (0.0, -1.0, 0.0), (NO_LIGHT,) * 3, casts_shadows=shadows)
    return lambda scene: replace(scene, lights=[*scene.lights, light])


FEATURES = (
    Feature("textures", ("TEXTURED",), "texture coordinates, texels, and their lookup",
            _lacks("textures"), _unused_texture),
    Feature("smooth_normals", ("SMOOTH",), "corner normals and their interpolation",
            _lacks("smooth_normals"), _flat_normals),
    Feature("vertex_colours", ("VERTEX_COLOURS",), "corner colours and their interpolation",
            _lacks("vertex_colours"), _white_corners),
    Feature("specular", ("SPECULAR",), "highlights: half vector and power", _lacks("specular"),
            lambda scene: scene),
    Feature("emission", ("EMISSION",), "glow of materials", _lacks("emission"),
            lambda scene: scene),
    Feature("shadows", ("SHADOW_LIGHTS",), "shadow rays", _lacks("shadows"),
            _idle_light(shadows=True)),
    Feature("directional_lights", ("OPEN_LIGHTS",), "a directional light without shadows",
            _lacks("directional_lights"), _idle_light(shadows=False)),
    Feature("point_lights", ("OPEN_LIGHTS", "SHADOW_LIGHTS"),
            "nothing but a turn of the loop over lights: kind is data", _lacks("point_lights")),
    Feature("ambient", (), "nothing: one product of a constant argument", _lacks("ambient")),
    Feature("background", (), "nothing: one constant argument", _lacks("background")),
    Feature("falloff", (), "nothing: a distance of 0 in the light's data", _lacks("falloff")),
    Feature("coloured_lights", (), "nothing: three factors either way", _lacks("coloured_lights")),
)  # fmt: skip


def left_out(
    scene: Scene, bvh: Bvh, device, *, views: int, pixels: int, repeats: int = REPEATS
) -> list[dict]:
    """Rows with :data:`COLUMNS` of everything that is left out for ``scene``."""
    bench = Bench(scene, bvh, device, Slab(scene.camera, views, pixels), repeats)
    rows = [*_features(bench), *_program_parts(bench)]
    return [{"scene": scene.name, **row} for row in rows]


@dataclass
class Bench:
    """Runs programs with and without something on the same rays."""

    scene: Scene
    bvh: Bvh
    device: object
    slab: Slab
    repeats: int

    @property
    def plane(self) -> SensorPlane:
        """The recorded picture through the whole lens."""
        camera = self.slab.camera
        return SensorPlane(camera.focus_distance_m, camera.f_number)

    def run(self, tracer: Tracer, planes, *, frames: bool) -> tuple[list[np.ndarray], np.ndarray]:
        """Frames, copied, and plane sums of the whole slab."""
        tracing = tracer.trace_tile(self.slab, self.tile(), planes, frames=frames)
        made = [chunk.frames.copy() for chunk in tracing]
        return made, tracing.plane_sums.sums

    def tile(self):
        layout = FrameLayout("macropixels", self.slab.views, self.slab.pixels)
        return layout.tile(0, 0, self.slab.pixels, self.slab.pixels)

    def seconds(self, tracer: Tracer, planes, *, frames: bool) -> float:
        """Median seconds of tracing."""

        def work():
            for _ in tracer.trace_tile(self.slab, self.tile(), planes, frames=frames):
                pass

        return measure(work, repeats=self.repeats, finish=self.device.queue.finish).median


def _features(bench: Bench) -> Iterator[dict]:
    needs = Needs.of(bench.scene)
    lean = Tracer(bench.scene, bench.bvh, bench.device, needs)
    planes = [bench.plane]
    frames, sums = bench.run(lean, planes, frames=True)
    for feature in FEATURES:
        if feature.fill is None or not feature.missing(needs):
            continue
        filled = feature.fill(bench.scene)
        more = full_needs(needs, filled, feature.field)
        full = Tracer(filled, bench.bvh, bench.device, more)
        full_frames, full_sums = bench.run(full, planes, frames=True)
        yield {
            "feature": feature.field,
            "what": feature.what,
            "seconds_full": bench.seconds(full, planes, frames=True),
            "seconds_left_out": bench.seconds(lean, planes, frames=True),
            "bytes_saved": _scene_bytes(filled, more) - _scene_bytes(bench.scene, needs),
            "identical": same(full_frames, frames) and same([full_sums], [sums]),
        }


def full_needs(needs: Needs, filled: Scene, field: str) -> Needs:
    """``needs`` with the feature of ``field`` switched on, for the scene filled with it."""
    value = getattr(Needs.of(filled), field)
    return replace(needs, **{field: value or type(value)(True)})


def same(one: Iterable[np.ndarray], other: Iterable[np.ndarray]) -> bool:
    """Whether arrays agree to the last bit."""
    one, other = list(one), list(other)
    return len(one) == len(other) and all(map(np.array_equal, one, other))


def _scene_bytes(scene: Scene, needs: Needs) -> int:
    s = pack_surfaces(scene, needs)
    return sum(a.nbytes for a in (s.attributes, s.materials, s.lights, s.images, s.texels))


def _program_parts(bench: Bench) -> Iterator[dict]:
    """Frames that nobody stores, planes that nobody looks at, lens blocks that no ray needs."""
    camera, slab = bench.slab.camera, bench.slab
    tracer = Tracer(bench.scene, bench.bvh, bench.device)
    whole = SensorPlane(camera.focus_distance_m, camera.f_number, shape="square")
    stopped = SensorPlane(camera.focus_distance_m, 4 * camera.f_number)
    tile = bench.tile()
    frame_bytes = tile.frame_count * tile.layout.frame_bytes
    plane_bytes = 32 * slab.pixels**2 * bench.device.threads

    def part(feature, what, full, lean, saved, agree):
        (full_planes, full_frames), (planes, frames) = full, lean
        return {
            "feature": feature,
            "what": what,
            "seconds_full": bench.seconds(tracer, full_planes, frames=full_frames),
            "seconds_left_out": bench.seconds(tracer, planes, frames=frames),
            "bytes_saved": saved,
            "identical": agree,
        }

    both, with_planes = [whole, stopped], bench.run(tracer, [whole], frames=True)
    agree = same([with_planes[1]], [bench.run(tracer, [whole], frames=False)[1]])
    what = "video frames, where the light field is not stored"
    yield part("frames", what, ([whole], True), ([whole], False), frame_bytes, agree)
    agree = same(with_planes[0], bench.run(tracer, [], frames=True)[0])
    what = "sensor planes, where only the light field is wanted"
    yield part("planes", what, ([whole], True), ([], True), plane_bytes, agree)
    of_all = bench.run(tracer, both, frames=False)[1][1]
    agree = same([of_all], [bench.run(tracer, [stopped], frames=False)[1][0]])
    what = "lens blocks outside every aperture (a plane at f/4 of the lens; full: a square plane)"
    yield part("lens_blocks", what, ([whole], False), ([stopped], False), 0, agree)

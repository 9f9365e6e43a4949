"""The curves of a scene's work-precision diagrams.

``quadrature``: one picture traced at its own focus, by kind and number of lens samples.
``methods``: one refocused picture, sliced while it is traced, by shift-sum, and from video.
``arithmetic``: colours of single rays by the float32 kernels against the float64 oracle.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.evaluation.work_precision import lens_samples
from lfcore.evaluation.work_precision.point import COLUMNS, point, rmse, with_orders
from lfcore.optics.bundles import macropixels
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle import slab as oracle
from lfcore.refocus.direct import focused_camera, trace_picture, trace_planes
from lfcore.refocus.resampling import FILTERS, coverage
from lfcore.refocus.shift_sum import FrameSummer, ViewSummer
from lfcore.refocus.slicing import form_planes
from lfcore.storage import defaults
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.tracer import Tracer

SEEDS, SEEDED_SECONDS = 3, 0.1
LONGEST_SECONDS = 1.5
"""A curve ends before a picture that would take longer, four times the one before it."""
MOST_RAYS = 1 << 26


@dataclass(frozen=True)
class Study:
    """What is measured of a scene.

    Attributes
    ----------
    pixels, views : M; and the values of N, ascending.
    reference_views : N of the reference's grid, which no curve may have; 10 times more accurate.
    f_stops : by how many stops the lens is closed, one diagram each.
    video_views, crfs : N of the light field that is stored, and its encoder's settings.
    oracle_pixels, oracle_views : pixels, and N, whose rays the oracle traces.
    """

    pixels: int
    views: Sequence[int]
    reference_views: int
    f_stops: Sequence[float]
    video_views: int
    crfs: Sequence[float]
    oracle_pixels: int
    oracle_views: int


def scene_rows(
    tracer: Tracer,
    bvh: Bvh,
    study: Study,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict]:
    """All rows of a scene; ``progress`` counts them in steps of one diagram."""
    parts = [
        *(lambda stops=stops: quadrature(tracer, study, stops) for stops in study.f_stops),
        lambda: methods(tracer, study),
        lambda: arithmetic(tracer, bvh, study),
    ]
    rows = []
    for done, part in enumerate(parts, 1):
        rows += [{**row, "scene": tracer.scene.name} for row in part()]
        if progress:
            progress(done, len(parts))
    return rows


def quadrature(tracer: Tracer, study: Study, stops: float) -> Iterator[dict]:
    """The picture in focus, whose rays no refocusing moves: errors are of the lens integral."""
    own = tracer.scene.camera
    plane = SensorPlane(own.focus_distance_m, own.f_number * 2 ** (stops / 2))
    camera = focused_camera(own, plane)
    reference, doubt = _reference(tracer, plane, study)
    context = {"panel": "quadrature", "f_number": plane.f_number}

    def grid(views: int) -> Callable[[int], np.ndarray]:
        return lambda _: trace_picture(tracer, own, study.pixels, plane, views=views)

    def sampled(pattern: str, views: int) -> Callable[[int], np.ndarray]:
        def work(seed: int) -> np.ndarray:
            points = lens_samples.lens_points(pattern, views, seed)
            return lens_samples.picture(tracer, camera, study.pixels, points)

        return work

    def row(method, views, work, rays, seeds):
        more = {"method": method, "knob": f"N = {views}", "rays_per_pixel": int(rays)}
        return point(work, reference, doubt, seeds=seeds, **context, **more)

    for pattern in ("grid", *lens_samples.PATTERNS):
        curve, before = [], 0.0
        for views in study.views:
            if pattern != "grid" and 4 * before > LONGEST_SECONDS:
                break
            if pattern == "grid":
                open_rays = plane.mask(Slab(camera, views, 1)).sum()
                curve.append(row(pattern, views, grid(views), open_rays, 1))
            else:
                seeds = SEEDS if 4 * before <= SEEDED_SECONDS else 1
                curve.append(row(pattern, views, sampled(pattern, views), views**2, seeds))
            before = curve[-1]["seconds"] or 0.0
        yield from with_orders(curve)


def _reference(tracer, plane, study) -> tuple[np.ndarray, float]:
    """The reference and how far it is from a grid of half as many rays."""
    camera, pixels, views = tracer.scene.camera, study.pixels, study.reference_views
    fine = trace_picture(tracer, camera, pixels, plane, views=views)
    coarse = trace_picture(tracer, camera, pixels, plane, views=int(views / 2**0.5))
    return fine.astype(float), rmse([coarse], fine)


def _sliced_reference(tracer, plane, study) -> tuple[np.ndarray, float]:
    """As :func:`_reference`, of what recorded pixels can give: the same slab of more views."""

    def sliced(views: int) -> np.ndarray:
        slab = Slab(tracer.scene.camera, views, study.pixels)
        return trace_planes(tracer, slab, [plane])[0].astype(float)

    fine = sliced(study.reference_views)
    return fine, rmse([sliced(int(study.reference_views / 2**0.5))], fine)


def methods(tracer: Tracer, study: Study) -> Iterator[dict]:
    """One picture refocused to the scene's nearest distance, where all rays are recorded."""
    scene, pixels = tracer.scene, study.pixels
    plane = SensorPlane(min(scene.focus_distances_m), scene.camera.f_number)
    reference, doubt = _sliced_reference(tracer, plane, study)
    context = {"panel": "methods", "f_number": plane.f_number}

    def row(method, knob, slab, work, **more):
        inside = coverage(slab, plane, "bilinear") > plane.mask(slab).sum() * (1 - 1e-6)
        rays = int(plane.mask(slab).sum())
        more |= {"method": method, "knob": knob, "rays_per_pixel": rays}
        return point(work, reference, doubt, inside=inside, **context, **more)

    for views in study.views:
        slab = Slab(scene.camera, views, pixels)
        work = lambda _, slab=slab: trace_planes(tracer, slab, [plane])[0]  # noqa: E731
        yield row("slicing on the fly", f"N = {views}", slab, work)
    for name in FILTERS:
        before = 0.0
        for views in study.views:
            if 4 * before > LONGEST_SECONDS:
                break
            slab = Slab(scene.camera, views, pixels)
            work = lambda _, slab=slab, name=name: _shift_sum(tracer, slab, plane, name)  # noqa: E731
            made = row(f"shift-sum, {name}", f"N = {views}", slab, work)
            before = made["seconds"] or 0.0
            yield made
    slab = Slab(scene.camera, study.video_views, pixels)
    for crf in study.crfs:
        with tempfile.TemporaryDirectory() as folder:
            file, name = Path(folder) / "lightfield.mkv", tracer.device.device.name
            _record(tracer, slab, crf, file)
            bits = 8 * file.stat().st_size / slab.rays
            work = lambda _, file=file, name=name: (  # noqa: E731
                form_planes(file, [plane], threads=1, device=name).sums.pictures()[0]
            )
            knob = f"N = {slab.views}, CRF {crf:g}"
            yield row("from video", knob, slab, work, bits_per_ray=bits)


def _shift_sum(tracer, slab, plane, name) -> np.ndarray:
    """Views are traced to 8-bit frames, as they would be stored, and added; no codec."""
    layout = FrameLayout("views", slab.views, slab.pixels, pixel_format="yuv444p")
    summer = ViewSummer(slab, [plane], filter=name, device=tracer.device)
    frames = FrameSummer(summer, layout)
    for tile in layout.tiles(MOST_RAYS):
        for chunk in tracer.trace_tile(slab, tile):
            frames.add(chunk.frames, tile, chunk.first)
    return summer.pictures()[0]


def _record(tracer: Tracer, slab: Slab, crf: float, file: Path) -> None:
    """Store the light field with the default settings for its N but for CRF."""
    views, pixels = slab.views, slab.pixels
    spec = replace(defaults.default_spec(views), crf=float(crf), threads=1)
    kind, pack = defaults.default_kind(views, pixels), defaults.default_pack(views, pixels)
    layout = FrameLayout(
        kind, views, pixels, pack=min(pack, pixels), pixel_format=spec.pixel_format
    )
    tiles = layout.tiles(MOST_RAYS)
    segments = [file.with_name(f"{tile.index}.mp4") for tile in tiles]
    size = layout.frame_width, layout.frame_height
    for tile, segment in zip(tiles, segments, strict=True):
        with SegmentWriter(segment, spec, *size) as writer:
            for chunk in tracer.trace_tile(slab, tile):
                writer.write(chunk.frames)
    about = {"name": tracer.scene.name, "digest": "0" * 64}
    join_segments(file, segments, tiles, layout, geometry=slab, scene=about, spec=spec)


def arithmetic(tracer: Tracer, bvh: Bvh, study: Study) -> Iterator[dict]:
    """Colours of the rays of some pixels; textures at full size, which is all the oracle knows."""
    scene = tracer.scene
    plain = Tracer(scene, bvh, tracer.device, mipmaps=False)
    slab = Slab(scene.camera, study.oracle_views, study.pixels)
    rng = np.random.default_rng(6)
    places = np.unique(rng.integers(0, slab.pixels, (study.oracle_pixels, 2)), axis=0)
    begun = time.perf_counter()
    truth = oracle.trace(scene, slab, places)
    seconds = time.perf_counter() - begun
    bundles = macropixels(slab, places)
    shape = len(places), slab.views**2, 3
    context = {"panel": "arithmetic", "f_number": scene.camera.f_number}
    context |= {"knob": f"{len(places)} pixels, N = {slab.views}", "rays_per_pixel": slab.views**2}
    yield point(
        lambda _: np.clip(plain.bundle_radiance(bundles, places), 0, 1).reshape(shape),
        truth.reshape(shape),
        None,
        inside=np.ones(shape[:2], bool),
        method="float32 kernels",
        **context,
    )
    exact = {"method": "float64 oracle", "rmse": 0.0, "seconds": seconds, "repeats": 1}
    yield dict.fromkeys(COLUMNS) | context | exact

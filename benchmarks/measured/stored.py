"""Tracing, encoding, decoding and forming planes side by side, on tiles sampled from a picture."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.measured.rows import in_turn, say
from benchmarks.measured.scenes import Loaded
from benchmarks.peers.method import Method, clocked
from lfcore.opencl.device import Device, open_device
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.slicing import CHUNK_BYTES, PlaneFormer
from lfcore.rendering.record import record_tile
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding, default_kind, default_pack
from lfcore.storage.layout import FrameLayout, Tile
from lfcore.storage.segment import SegmentReader, SegmentWriter
from lfcore.tracing.tracer import Tracer

SEED, FRAMES = 2024, 256
ENCODE_LIMIT, DECODE_LIMIT, PLANES_LIMIT = 1.35, 2.0, 3.0


@dataclass(frozen=True)
class SampledStore:
    """Some tiles of a light field, with the default layout and encoder settings.

    ``frames`` holds the traced frames of each tile; ``segments`` are its encoded files.
    """

    slab: Slab
    spec: Encoding
    tiles: list[Tile]
    tracers: list[Tracer]
    frames: list[np.ndarray]
    segments: list[Path]
    folder: Path

    @property
    def devices(self) -> list[Device]:
        return [tracer.device for tracer in self.tracers]

    @property
    def rays(self) -> int:
        return sum(tile.rays for tile in self.tiles)


def sample_store(loaded: Loaded, views: int, pixels: int, folder: Path) -> SampledStore:
    """Four tiles of about FRAMES frames, one at a place drawn from a fixed seed in each
    quarter of the picture, traced and encoded once."""
    spec, slab = chosen_encoding(views), Slab(loaded.scene.camera, views, pixels)
    pack = default_pack(views, pixels)
    layout = FrameLayout(
        default_kind(views, pixels), views, pixels, pack=pack, pixel_format=spec.stored_format
    )
    tiles = sampled_tiles(layout)
    threads = loaded.tracer.device.threads
    tracers = [
        Tracer(loaded.scene, loaded.bvh, open_device(threads=1))
        for _ in range(min(threads, len(tiles)))
    ]
    segments = [folder / f"{views}_{tile.index}.mp4" for tile in tiles]
    made = []
    for tile, segment in zip(tiles, segments, strict=True):
        chunks = [chunk.frames.copy() for chunk in tracers[0].trace_tile(slab, tile)]
        made.append(np.concatenate(chunks))
        encode(made[-1], segment, spec, layout)
    return SampledStore(slab, spec, tiles, tracers, made, segments, folder)


def sampled_tiles(layout: FrameLayout) -> list[Tile]:
    """One tile in each quarter of the outer grid, twice as wide as high, whole blocks."""
    half, pack = layout.outer.width // 2, layout.pack
    high = max(1, min(int(np.sqrt(FRAMES / 2)), half // pack // 2))
    rng, tiles = np.random.default_rng(SEED), []
    for quarter in range(4):
        low = np.array(divmod(quarter, 2)[::-1]) * half
        free = (half - np.array([2 * high, high]) * pack) // pack
        drawn = rng.integers(0, np.maximum(free, 0) + 1)
        column, row = ((low + drawn * pack) // pack * pack).tolist()
        tiles.append(layout.tile(column, row, 2 * high * pack, high * pack, quarter))
    return tiles


def encode(frames: np.ndarray, path: Path, spec: Encoding, layout: FrameLayout) -> None:
    with SegmentWriter(path, spec, layout.frame_width, layout.frame_height) as writer:
        writer.write(frames)


def side_by_side(count: int, jobs: Sequence, work: Callable) -> None:
    """Run ``work(worker, job)`` for every job in each of ``count`` workers; every second worker
    begins with the last job, so that all end at about the same time."""

    def all_of(worker: int) -> None:
        for job in jobs[:: -1 if worker % 2 else 1]:
            work(worker, job)

    with ThreadPoolExecutor(count) as pool:
        list(pool.map(all_of, range(count)))


def together(loaded: Loaded, store: SampledStore, repeats: int) -> list[dict]:
    """Tracing and encoding against the encoder alone, fed the same frames from memory; both
    encode as many segments at a time as there are threads."""
    count, layout = len(store.tracers), store.tiles[0].layout
    scratch = [store.folder / f"again_{worker}.mp4" for worker in range(count)]

    def encoding(worker: int, k: int) -> None:
        encode(store.frames[k], scratch[worker], store.spec, layout)

    def tracing(worker: int, k: int) -> None:
        for _ in store.tracers[worker].trace_tile(store.slab, store.tiles[k]):
            pass

    def both(worker: int, k: int) -> None:
        tracer = store.tracers[worker]
        record_tile(tracer, store.slab, store.tiles[k], scratch[worker], store.spec)

    every = range(len(store.tiles))
    methods = [
        _method(name, count * store.rays, lambda work=work: side_by_side(count, every, work))
        for name, work in (("encode", encoding), ("trace", tracing), ("trace and encode", both))
    ]
    runs, limits = in_turn(methods, repeats), {"trace and encode": ENCODE_LIMIT}
    rows = _rows(loaded, store, runs, dict.fromkeys(runs, "encode"), limits)
    video = sum(path.stat().st_size for path in store.segments)
    rows[0]["bits_per_ray"] = 8 * video / store.rays
    return rows


def retrieval(loaded: Loaded, store: SampledStore, repeats: int) -> list[dict]:
    """Decoding alone, with 10 planes and with 100 planes formed of the frames."""
    count, camera = len(store.tracers), store.slab.camera
    distances = loaded.scene.focus_distances_m
    stack = {n: _planes(camera, distances, n) for n in (10, 100)}
    chunk = max(1, CHUNK_BYTES // store.tiles[0].layout.frame_bytes)

    def decoding(worker: int, k: int) -> None:
        for _ in SegmentReader(store.segments[k]).frames(chunk=chunk, reuse=True):
            pass

    def forming(planes: list[SensorPlane], worker: int, k: int):
        former, first = PlaneFormer(store.slab, store.tiles[k], planes, store.devices[worker]), 0
        for frames in SegmentReader(store.segments[k]).frames(chunk=chunk, reuse=True):
            former.add(frames, first)
            first += len(frames)
        return former.plane_sums()

    every = range(len(store.tiles))
    methods = [_method("decode", count * store.rays, lambda: side_by_side(count, every, decoding))]
    for n, planes in stack.items():
        # Adding the parts of all tiles to whole pictures is left out: it costs the same for these
        # few as for all.
        methods.append(_method(f"decode and {n} planes", count * store.rays, lambda planes=planes:
            side_by_side(count, every, lambda worker, k: forming(planes, worker, k))
        ))  # fmt: skip
    alone, ten, hundred = (method.name for method in methods)
    bases = {alone: alone, ten: alone, hundred: ten}
    limits = {ten: DECODE_LIMIT, hundred: PLANES_LIMIT}
    return _rows(loaded, store, in_turn(methods, repeats), bases, limits)


def _planes(camera, distances: Sequence[float], count: int) -> list[SensorPlane]:
    """The whole lens, focused evenly in dioptres over the scene's focus distances."""
    dioptres = np.linspace(1 / min(distances), 1 / max(distances), count)
    return [SensorPlane(float(1 / d), camera.f_number) for d in dioptres]


def _method(name: str, rays: int, work: Callable) -> Method:
    return Method(name, "store", lambda: clocked(work, rays))


def _rows(
    loaded: Loaded, store: SampledStore, runs: dict, bases: dict[str, str], limits: dict[str, float]
) -> list[dict]:
    """Medians; a ratio is the median over rounds, so that a disturbance meets both sides.

    Limits are held against CPU time, which other programs disturb less.
    """
    rows = []
    for name, found in runs.items():
        pairs = list(zip(found, runs[bases[name]], strict=True))
        core = _median(one.cpu_seconds / other.cpu_seconds for one, other in pairs)
        limit = {"limit": limits[name], "holds": core <= limits[name]} if name in limits else {}
        rows.append({
            "part": "speed",
            "scene": loaded.name,
            "N": store.slab.views,
            "M": store.slab.pixels,
            "what": name,
            "threads": len(store.tracers),
            "mrays_per_second": _median(run.rays / run.seconds / 1e6 for run in found),
            "mrays_per_core_second": _median(run.rays / run.cpu_seconds / 1e6 for run in found),
            "against": bases[name],
            "ratio": _median(one.seconds / other.seconds for one, other in pairs),
            "core_ratio": core,
            **limit,
        })  # fmt: skip
    say(f"{loaded.name} N = {store.slab.views}: " + ", ".join(
        f"{row['what']} {row['mrays_per_core_second']:.0f}" for row in rows
    ) + " million rays per core second")  # fmt: skip
    return rows


def _median(values) -> float:
    return float(np.median(list(values)))

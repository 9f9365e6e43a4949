"""Recording of a film of light fields: a scene at several instants in one file.

Groups of instants are encoded one after another into a folder beside the file.  A record that is
killed leaves the finished ones there, and the same record continues after them.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.files import make_folder
from lfcore.opencl.device import Device
from lfcore.optics.slab import Slab
from lfcore.progress import Progress, part_of
from lfcore.rendering.depth import depth_content, dioptre_range, virtual_range
from lfcore.rendering.prepared import tracers_at
from lfcore.rendering.record import peak_to_store
from lfcore.rendering.record_depth import (
    RANGE_MARGIN,
    TILE_RAYS,
    DepthStore,
    encode,
    frames_by_depth,
)
from lfcore.scene.files import scene_digest
from lfcore.scene.model import Scene
from lfcore.storage.container import DepthSegments, SpecularSegments, join_segments
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.instants import GROUP, Instants
from lfcore.storage.layout import Tile
from lfcore.storage.metadata import Metadata
from lfcore.tracing.tracer import Tracer


@dataclass(frozen=True)
class Ahead:
    """What a few rays of each instant show, before all are traced.

    Attributes
    ----------
    times : the instants, seconds.
    ranges : the least and the greatest inverse depth of all, 1/m: of surfaces, and of specular
        light if there is any.
    content, digests : of each instant, what its file would say.
    peak : as of :func:`lfcore.rendering.record.peak_to_store`, of the brightest instant.
    """

    times: tuple[float, ...]
    ranges: tuple[tuple[float, float], ...]
    content: tuple[dict, ...]
    digests: tuple[str, ...]
    peak: float | None

    @classmethod
    def of(
        cls, scene: Scene, times: Sequence[float], slab: Slab, device: Device, transfer: str | None
    ) -> "Ahead":
        ends: list[list[tuple[float, float]]] = []
        content, digests, peaks = [], [], []
        for tracer in tracers_at(scene, times, device):
            ends.append([dioptre_range(tracer, slab, RANGE_MARGIN)])
            if tracer.needs.specular:
                ends[-1].append(virtual_range(tracer, slab, RANGE_MARGIN))
            content.append(depth_content(tracer, slab))
            digests.append(scene_digest(tracer.scene))
            peaks.append(peak_to_store(tracer, slab, transfer) or 0.0)
        ranges = [
            (min(far for far, _ in part), max(near for _, near in part))
            for part in zip(*ends, strict=True)
        ]
        peak = max(peaks) or None
        return cls(tuple(times), tuple(ranges), tuple(content), tuple(digests), peak)


def check_times(times: Sequence[float]) -> tuple[float, ...]:
    """Raise :class:`OpticsError` for no instants, or for some that do not ascend."""
    seconds = np.asarray(times, np.float64).reshape(-1)
    if not len(seconds) or not np.isfinite(seconds).all() or (np.diff(seconds) <= 0).any():
        raise OpticsError("must be ascending seconds", key="times")
    return tuple(seconds.tolist())


def record_film(
    path: str | Path,
    scene: Scene,
    ahead: Ahead,
    slab: Slab,
    store: DepthStore,
    device: Device,
    *,
    group: int = GROUP,
    bake_each: bool = False,
    content: dict | None = None,
    progress: Progress | None = None,
) -> Metadata:
    """Trace ``slab`` at the instants of ``ahead``, and write the film ``path``.

    ``group`` instants are coded together; light is baked as the scene stands, or for each
    instant.  ``progress`` counts views of all instants.  Other parameters are as of
    :func:`lfcore.rendering.record_depth.record_by_depth`.
    """
    path, layout = Path(path), store.layout
    if layout.kind != "views":
        raise OpticsError("a film has views", key="layout", remedy="Leave it out")
    codes = [
        DepthCodes.of_range(slab, *ends, gaps=bool(part)) for part, ends in enumerate(ahead.ranges)
    ]
    specs = [code.spec(slab, lossless=store.spec.lossless) for code in codes]
    encodings = [each for spec in specs for each in (store.spec, spec)]
    film, tiles = Instants(ahead.times, group, ahead.content), layout.tiles(TILE_RAYS, least=1)
    folder = path.with_name(f"{path.name}.parts")
    make_folder(folder)
    settings = (
        bake_each, scene.shutter, scene_digest(scene), slab.to_json(), layout.to_json(),
        [each.to_json() for each in encodings], ahead.ranges, store.displaced, store.pixels,
    )  # fmt: skip
    # Of each group and tile the files of its streams.
    groups: list[list[list[Path]]] = []
    for first in range(0, len(film.times), group):
        some = slice(first, first + group)
        name = _name(settings, film.times[some], ahead.digests[some])
        groups.append([
            [folder / f"{name}.{tile.index}.{stream}.mp4" for stream in range(len(encodings))]
            for tile in tiles
        ])  # fmt: skip
    missing = [
        number
        for number, of_tiles in enumerate(groups)
        if not all(file.exists() for files in of_tiles for file in files)
    ]
    times = [time for k in missing for time in film.times[k * group : (k + 1) * group]]
    traced = tracers_at(scene, times, device, bake_each=bake_each)
    for number in missing:
        tracers = list(islice(traced, film.counts[number]))
        tell = part_of(progress, number, len(groups))
        for tile, files in zip(tiles, groups[number], strict=True):
            frames = _in_turn(tracers, slab, store, codes, tile, tell)
            encode(frames, layout, list(zip(files, encodings, strict=True)))
    streams = list(zip(*[files for of_tiles in groups for files in of_tiles], strict=True))
    depths = [
        DepthSegments(files, code, store.displaced, store.pixels, spec)
        for files, code, spec in zip(streams[1::2], codes, specs, strict=True)
    ]
    metadata = join_segments(
        path,
        streams[0],
        tiles,
        layout,
        geometry=slab,
        scene={"name": scene.name, "digest": ahead.digests[0]},
        spec=store.spec,
        content=content or {},
        depth=depths[0],
        specular=SpecularSegments(streams[2], store.spec, depths[1]) if codes[1:] else None,
        film=film,
    )
    shutil.rmtree(folder, ignore_errors=True)
    return metadata


def _name(*parts: Any) -> str:
    """Return a name for files: the digest of all that they depend on."""
    text = json.dumps(parts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _in_turn(
    tracers: list[Tracer],
    slab: Slab,
    store: DepthStore,
    codes: list[DepthCodes],
    tile: Tile,
    progress: Progress | None,
) -> Iterator[list[np.ndarray]]:
    """Some frames of a tile at a time, each at every instant, in order: colours and depths of
    each part."""
    runs = [
        frames_by_depth(
            tracer, slab, store, codes, tile, part_of(progress, number, len(tracers))
        )
        for number, tracer in enumerate(tracers)
    ]  # fmt: skip
    for some in zip(*runs, strict=True):
        yield [
            np.stack(stream, axis=1).reshape(-1, stream[0].shape[1])
            for stream in zip(*some, strict=True)
        ]

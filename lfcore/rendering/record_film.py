"""Recording of a film of light fields: a scene at several instants in one file.

Groups of instants are encoded one after another into a folder beside the file.  A record that is
killed leaves the finished ones there, and the same record continues after them.
"""

import hashlib
import json
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
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
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import DepthSegments, SpecularSegments, join_segments
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.instants import GROUP, Instants
from lfcore.storage.layout import Tile
from lfcore.storage.metadata import Metadata
from lfcore.tracing.tracer import Tracer


@dataclass(frozen=True)
class Ahead:
    """Ranges and facts of all instants, from a few rays of each, before all rays are traced.

    Attributes
    ----------
    times : the instants, seconds.
    ranges : the least and the greatest inverse depth of all, 1/m: of surfaces, and of specular
        light if there is any.
    content, digests : per instant, the facts of its file and the scene's digest.
    peak : as :func:`lfcore.rendering.record.peak_to_store` returns for the brightest instant.
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

    def to_json(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Ahead":
        """The inverse of :meth:`to_json`."""
        lists = {name: tuple(data[name]) for name in ("times", "content", "digests")}
        ranges = tuple((far, near) for far, near in data["ranges"])
        return cls(**lists, ranges=ranges, peak=data["peak"])


def check_times(times: Sequence[float]) -> tuple[float, ...]:
    """Raise :class:`OpticsError` for no instants, or for some that do not ascend."""
    seconds = np.asarray(times, np.float64).reshape(-1)
    if not len(seconds) or not np.isfinite(seconds).all() or (np.diff(seconds) <= 0).any():
        raise OpticsError("must be ascending seconds", key="times")
    return tuple(seconds.tolist())


@dataclass(frozen=True)
class Film:
    """A film to record.

    Attributes
    ----------
    scene : Scene
        What moves.
    ahead : Ahead
        What a few rays of its instants show.
    slab, store : Slab, DepthStore
        The rays of an instant, and how they are stored.
    bake_each : bool
        Whether light is baked for each instant, not as the scene stands.
    group : int
        The instants that are coded together.
    """

    scene: Scene
    ahead: Ahead
    slab: Slab
    store: DepthStore
    bake_each: bool = False
    group: int = GROUP

    def __post_init__(self) -> None:
        if self.store.layout.kind != "views":
            raise OpticsError("a film has views", key="layout", remedy="Leave it out")

    @cached_property
    def instants(self) -> Instants:
        """The times, as the file has them."""
        return Instants(self.ahead.times, self.group, self.ahead.content)

    @property
    def groups(self) -> range:
        """The numbers of the groups."""
        return range(len(self.instants.counts))

    @cached_property
    def codes(self) -> list[DepthCodes]:
        """The codes of the depths of surfaces, and of specular light if there is any."""
        ranges = enumerate(self.ahead.ranges)
        return [DepthCodes.of_range(self.slab, *ends, gaps=bool(part)) for part, ends in ranges]

    @cached_property
    def _depth_specs(self) -> list[Encoding]:
        return [code.spec(self.slab, lossless=self.store.spec.lossless) for code in self.codes]

    @property
    def _encodings(self) -> list[Encoding]:
        return [each for spec in self._depth_specs for each in (self.store.spec, spec)]

    @cached_property
    def _tiles(self) -> list[Tile]:
        return self.store.layout.tiles(TILE_RAYS, least=1)

    @cached_property
    def _digest(self) -> str:
        """The digest of all that is common to the groups."""
        store = self.store
        return _name(
            self.bake_each, self.scene.shutter, scene_digest(self.scene), self.slab.to_json(),
            store.layout.to_json(), [each.to_json() for each in self._encodings],
            self.ahead.ranges, store.displaced, store.pixels,
        )  # fmt: skip

    def _instants_of(self, group: int) -> slice:
        return slice(group * self.group, (group + 1) * self.group)

    def files(self, group: int, folder: Path) -> list[list[Path]]:
        """The segments of a group in a folder: of each tile, of each stream.

        Names are digests of all that a group depends on.
        """
        some = self._instants_of(group)
        name = _name(self._digest, self.ahead.times[some], self.ahead.digests[some])
        return [
            [folder / f"{name}.{tile.index}.{stream}.mp4" for stream in range(len(self._encodings))]
            for tile in self._tiles
        ]

    def trace(
        self,
        groups: Sequence[int],
        folder: Path,
        device: Device,
        progress: Progress | None = None,
    ) -> None:
        """Write the segments of ``groups`` into a folder; ``progress`` counts views of all."""
        times = [time for group in groups for time in self.ahead.times[self._instants_of(group)]]
        traced = tracers_at(self.scene, times, device, bake_each=self.bake_each)
        for number, group in enumerate(groups):
            tracers = list(islice(traced, self.instants.counts[group]))
            tell = part_of(progress, number, len(groups))
            for tile, files in zip(self._tiles, self.files(group, folder), strict=True):
                frames = _in_turn(tracers, self.slab, self.store, self.codes, tile, tell)
                encode(
                    frames, self.store.layout, list(zip(files, self._encodings, strict=True))
                )  # fmt: skip

    def join(self, path: str | Path, folders: Sequence[Path], content: dict[str, Any]) -> Metadata:
        """Write the film ``path`` from the segments of each group, in its folder."""
        tiles = [
            files
            for group, folder in zip(self.groups, folders, strict=True)
            for files in self.files(group, folder)
        ]
        streams = list(zip(*tiles, strict=True))
        depths = [
            DepthSegments(files, code, self.store.displaced, self.store.pixels, spec)
            for files, code, spec in zip(
                streams[1::2], self.codes, self._depth_specs, strict=True
            )
        ]  # fmt: skip
        specular = SpecularSegments(streams[2], self.store.spec, depths[1]) if depths[1:] else None
        return join_segments(
            Path(path),
            streams[0],
            self._tiles,
            self.store.layout,
            geometry=self.slab,
            scene={"name": self.scene.name, "digest": self.ahead.digests[0]},
            spec=self.store.spec,
            content=content,
            depth=depths[0],
            specular=specular,
            film=self.instants,
        )


def record_film(
    path: str | Path,
    film: Film,
    device: Device,
    *,
    content: dict[str, Any] | None = None,
    progress: Progress | None = None,
) -> Metadata:
    """Trace a film and write it, or continue one that was killed.

    ``content`` has further facts for the file; ``progress`` counts views of all instants.
    """
    path = Path(path)
    folder = path.with_name(f"{path.name}.parts")
    make_folder(folder)
    missing = [
        group
        for group in film.groups
        if not all(file.exists() for files in film.files(group, folder) for file in files)
    ]
    film.trace(missing, folder, device, progress)
    metadata = film.join(path, [folder] * len(film.groups), content or {})
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

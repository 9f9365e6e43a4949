"""Our tracer against every peer, in turn in one run."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from benchmarks.measured import ours
from benchmarks.measured.rows import in_turn, rates, say
from benchmarks.measured.sample import sample_slab
from benchmarks.measured.scenes import Loaded
from benchmarks.peers.embree_packets import EmbreePackets
from benchmarks.peers.method import Method, SkippedError
from benchmarks.peers.mitsuba_picture import MitsubaPicture
from lfcore.optics.slab import Slab

PEERS: dict[str, Callable] = {"embree": EmbreePackets, "mitsuba": MitsubaPicture}
"""What makes a peer of a scene and the number of threads."""


class Peers:
    """The chosen peers with one scene; one that cannot run is skipped, and a line says so."""

    def __init__(self, loaded: Loaded, wanted: Sequence[str]):
        self._open = dict[str, Any]()
        for name in wanted:
            with self._skipping(name):
                self._open[name] = PEERS[name](loaded.scene, loaded.tracer.device.threads)

    @contextmanager
    def _skipping(self, name: str) -> Iterator[None]:
        try:
            yield
        except SkippedError as error:
            say(f"SKIPPED {name}: {error}")
            self._open.pop(name, None)

    def methods(self, sample) -> list[Method]:
        out: list[Method] = []
        for name, peer in list(self._open.items()):
            with self._skipping(name):
                out += peer.methods(sample)
        return out

    def close(self) -> None:
        for peer in self._open.values():
            peer.close()


def compare(options) -> list[dict]:
    rows = []
    for name in options.scenes:
        loaded = Loaded.open(name)
        peers = Peers(loaded, options.peers)
        for views in options.views:
            say(f"{name}, N = {views}")
            rows += _rows(loaded, views, options, peers)
        peers.close()
    return rows


def _rows(loaded: Loaded, views: int, options, peers: Peers) -> list[dict]:
    scene = loaded.scene
    sample = sample_slab(Slab(scene.camera, views, options.pixels), options.mrays)
    planes = ours.planes_of(scene)
    methods = [ours.visibility(loaded.tracer, sample)]
    methods += [ours.algorithm1(loaded.tracer, sample, planes), *peers.methods(sample)]
    rows = []
    for work in ("visibility", "algorithm1"):
        chosen = [method for method in methods if method.work == work]
        found = {name: rates(runs) for name, runs in in_turn(chosen, options.repeats).items()}
        others = [m for m in chosen if not m.ours]
        for method in chosen:
            row = found[method.name]
            best = max((found[m.name]["mrays_per_second"] for m in others), default=None)
            core = max((found[m.name]["mrays_per_core_second"] for m in others), default=None)
            hits, depth = method.check() or (None, None)
            tiles = method.extra.get("tile_seconds")
            rows.append({
                "scene": loaded.name,
                "triangles": scene.triangle_count,
                "N": views,
                "M": options.pixels,
                "method": method.name,
                "work": work,
                "mrays_per_second": row["mrays_per_second"],
                "ratio_to_best_peer": row["mrays_per_second"] / best if best else None,
                **{key: row[key] for key in row if key != "mrays_per_second"},
                "core_ratio_to_best_peer": row["mrays_per_core_second"] / core if core else None,
                "hit_share": hits,
                "mean_depth_m": depth,
                "tile_seconds": float(np.median(tiles)) if tiles else None,
                "threads": loaded.tracer.device.threads,
                "note": method.note,
            })  # fmt: skip
    return rows

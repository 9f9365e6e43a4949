"""Items of a data set: the files of one scene, all from one tracer, and their record."""

import json
import math
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lfcore.api import record
from lfcore.datasets.description import Description
from lfcore.datasets.item import Item
from lfcore.datasets.kinds import MAKERS
from lfcore.datasets.looks import BACKDROP
from lfcore.datasets.metering import metered
from lfcore.datasets.sample import Sample, sample
from lfcore.datasets.stored import of_instant
from lfcore.errors import SceneError
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import all_samples
from lfcore.rendering.prepared import open_tracer, tracers_at
from lfcore.rendering.quality import Quality
from lfcore.rendering.truth import channels_exr, flow_between, view_truth
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

DEPTH_BINS = np.geomspace(0.03, 30, 41)
"""The edges of the records' histogram of depths, metres."""


def make_item(
    description: Description, index: int, device: Device | str | None = None, made_of: str = "",
    *, encoded: bool = True, drafts: Path | None = None,
) -> Item:  # fmt: skip
    """Sample, trace and encode scene ``index``; its record has ``made_of``, the sources' digest.

    Finished instants of a film are in the folder ``drafts``, from which a killed job continues.

    Raises :class:`SceneError` or :class:`OpticsError` for a scene that makes no item.
    """
    watch, times = Stopwatch(clock=time.process_time), description.frames.times
    with watch.part("scene"):
        drawn = sample(description, index)
        scene, stops = metered(drawn.scene, device) if drawn.is_room else (drawn.scene, 0)
        drawn = drawn._replace(scene=scene)
        tracer = open_tracer(scene, device) if len(times) == 1 else None
    instants, before = list[Item](), None
    for now in [tracer] if tracer else tracers_at(scene, times, device):
        exposed = instants[-1].exposed if instants else 0  # noise differs between instants
        item = Item(description, encoded, watch=watch, exposed=exposed)
        _fill(item, description, now, drawn, index, made_of)
        item.record["exposure_ev"] = stops
        if before:
            _add_flow(instants[-1], description, before, now)
        instants.append(item)
        before = now
    if len(times) > 1:
        item = _joined(instants, drawn, times)
    if description.kind == "films":
        _add_film(item, description, drawn, times, device, drafts)
    if drawn.scene.shutter:
        item.record["shutter_s"] = list(drawn.scene.shutter)
    # The worst picture counts.
    item.record["expected_db"] = round(float(min(item.record["each_db"])), 2)
    item.record["fields"] = list(item.files)
    if encoded:
        item.files["json"] = json.dumps(item.record).encode()
    return item


def _fill(
    item: Item, description: Description, tracer: Tracer, drawn: Sample, index: int, made_of: str
) -> None:  # fmt: skip
    """Add files and facts of one instant."""
    scene, slab = tracer.scene, Slab.of(tracer.scene.camera, 1, description.size)
    hits = tracer.bundle_hits(bundles.views(slab, all_samples(slab)))
    triangle, depth = (array[0] for array in hits)
    finite = depth[np.isfinite(depth)]
    behind = np.array([material.name in BACKDROP for material in scene.every_material])
    seen = float((~behind[scene.material_ids[triangle]] & (triangle >= 0)).mean())
    if seen < description.placement.least_seen:
        problem = f"empty frustum: objects fill {100 * seen:.1f} % of the picture"
        raise SceneError(problem, file=scene.name)
    item.record = {
        "index": index, "made_of": made_of, "objects": drawn.objects, "dropped": drawn.dropped,
        "seen": round(seen, 4), "pictures": description.properties(),
        "camera": scene.camera.to_json() | {"pixels": description.pixels},
        "depth_m": [float(finite.min()), float(finite.max())],
        "depths": np.histogram(finite, DEPTH_BINS)[0].tolist(),
    }  # fmt: skip
    MAKERS[description.kind](item, description, tracer, depth)
    if description.truth:
        _add_truth(item, description, tracer, drawn.owners)


def _joined(instants: list[Item], drawn: Sample, times: tuple[float, ...]) -> Item:
    """Return the item of all instants: arrays with a leading axis of time."""
    first = instants[0]
    whole = Item(first.description, first.encoded, watch=first.watch)
    for number, item in enumerate(instants):
        whole.files |= {of_instant(number, name): data for name, data in item.files.items()}
        for name, array in item.arrays.items():
            whole.arrays.setdefault(name, []).append(array)
    every = {key: [item.record[key] for item in instants] for key in first.record}
    joined: dict[str, Any] = {
        "each_db": [db for each in every["each_db"] for db in each],
        "rays_per_pixel": sum(every["rays_per_pixel"]),
        "seen": min(every["seen"]), "times_s": list(times),
        "motions": [
            {"object": move.number, "animated": move.parts_at is not None,
             "poses": [move.pose(time_s)[:3].tolist() for time_s in times]} for move in drawn.moves
        ],
    }  # fmt: skip
    for key in ("depth_m", "disparity_px"):
        if key in every:
            joined[key] = [min(low for low, _ in every[key]), max(high for _, high in every[key])]
    for key in ("depths", "blurs"):
        if key in every:
            joined[key] = np.sum(every[key], axis=0).tolist()
    whole.record = first.record | joined
    return whole


def _add_flow(item: Item, description: Description, tracer: Tracer, later: Tracer) -> None:
    """Add an EXR of the flow to the next instant, of the middle view or of each view of a light
    field."""
    of_field = description.kind == "light_fields"
    slab = Slab.of(tracer.scene.camera, description.lens.views if of_field else 1, description.size)
    for number, place in enumerate(all_samples(slab)):
        known = flow_between(tracer, later, slab, place)
        with item.watch.part("files"):
            for name, array in known.items():
                item.arrays.setdefault(f"next_{name}", []).append(array)
            if item.encoded:
                name = f"next_Cam{number:03d}.exr" if of_field else "next.exr"
                item.files[name] = channels_exr(known)
    if not of_field:
        item.arrays |= {k: v[0] for k, v in item.arrays.items() if k.startswith("next_")}


def _add_truth(item: Item, description: Description, tracer: Tracer, owners: np.ndarray) -> None:
    """Add an EXR of the truth of the middle view, or of each view of a light field."""
    camera, views = tracer.scene.camera, description.lens.views
    of_field = description.kind == "light_fields"
    slab = Slab.of(camera, views if of_field else 1, description.size)
    planes = [] if of_field else [SensorPlane(m, camera.f_number) for m in item.record["focus_m"]]
    for number, place in enumerate(all_samples(slab)):
        known = view_truth(tracer, slab, place, (slab.views // 2,) * 2, planes)
        known["object"] = np.append(owners, np.int32(-1))[known["triangle"]]
        if not of_field:  # there is no other view
            del known["flow_px"], known["occluded"], known["disparity_px"]
        name = f"truth_Cam{number:03d}.exr" if of_field else "truth.exr"
        with item.watch.part("files"):
            for field, array in known.items():
                item.arrays.setdefault(f"truth_{field}", []).append(array)
            if item.encoded:
                item.files[name] = channels_exr(known)
    if not of_field:
        item.arrays |= {k: v[0] for k, v in item.arrays.items() if k.startswith("truth_")}


def _add_film(
    item: Item, description: Description, drawn: Sample, times: Sequence[float],
    device: Device | str | None, drafts: Path | None,
) -> None:  # fmt: skip
    """Add the film of light fields, and its expected quality."""
    with TemporaryDirectory() as folder:
        path = (drafts or Path(folder)) / f"{item.record['index']:06d}.mkv"
        film = record(
            drawn.scene, path, times=times, pixels=description.size, device=device,
            quality=Quality(description.quality_db),
        )  # fmt: skip
        item.files["film.mkv"] = path.read_bytes()
        path.unlink()
    rays = len(times) * film.require_slab().rays / math.prod(description.size)
    item.record["each_db"] = [*item.record["each_db"], film.content["expected"]["db"]]
    item.record["rays_per_pixel"] += round(rays, 2)

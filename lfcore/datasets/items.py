"""Items of a data set: the files of one scene, all from one tracer, and their record.

Each finished item of a job is a tar file; at the end they become one shard in WebDataset's format.
A killed job finds finished items again by the digest of their sources.
"""

import io
import json
import math
import shutil
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np

from lfcore.api import record
from lfcore.colour import srgb_codes
from lfcore.datasets import views
from lfcore.datasets.description import Description
from lfcore.datasets.looks import BACKDROP
from lfcore.datasets.metering import metered
from lfcore.datasets.sample import Sample, sample
from lfcore.datasets.stored import Finished, members, of_instant, write_tar
from lfcore.errors import OpticsError, SceneError
from lfcore.exchange import arrays, hci
from lfcore.files import make_folder, write_json
from lfcore.opencl.device import Device, open_device
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.dual_pixel import dual_pixel_disparity
from lfcore.optics.grid_geometry import KnownGeometry
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.pictures import picture_bytes
from lfcore.rendering.depth import all_samples, depth_of_views, disparity
from lfcore.rendering.prepared import open_tracer, tracers_at
from lfcore.rendering.quality import Quality, QualitySearch, Rendering
from lfcore.rendering.truth import channels_exr, flow_between, view_truth
from lfcore.sensor import Sensor
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer
from lfcore.versions import version

DEPTH_BINS = np.geomspace(0.03, 30, 41)
"""The edges of the records' histogram of depths, metres."""
BLUR_BINS = np.linspace(0, 10, 41)
"""The edges of the histogram of blur radii, pixels; larger radii count in the last bin."""


HALF_DB = 3.0
"""The dB by which half an aperture is worse than the whole, as it has half the rays."""


@dataclass
class Item:
    """An item.

    Attributes
    ----------
    files : dict
        The files by field, in order; empty unless ``encoded``.
    arrays : dict
        The files' content by field without number: codes, or floats; lists of those with numbers.
    record : dict
        The facts of the item.
    watch : Stopwatch
        Core seconds of parts of the work.
    """

    description: Description | None = None
    encoded: bool = True
    files: dict[str, bytes] = field(default_factory=dict)
    arrays: dict[str, Any] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)
    watch: Stopwatch = field(default_factory=lambda: Stopwatch(clock=time.process_time))
    _exposed: int = 0

    def codes(self, light: np.ndarray, *, noise: bool = True) -> np.ndarray:
        """Return the codes of a picture; noise is that of the description's sensor, if any."""
        description = self.description
        assert description  # refused scenes have no pictures
        if noise and description.sensor:
            sensor, self._exposed = Sensor.of(description.sensor), self._exposed + 1
            raw = sensor.raw(light, (self.record["index"], self._exposed))
            if description.codes == "raw16":
                return raw
            light = sensor.developed(raw)
        if description.codes.startswith("srgb"):
            return srgb_codes(light, bits=int(description.codes[4:]))
        return np.rint(65535 * light.clip(0, 1)).astype(np.uint16)

    def add(
        self, name: str, picture: np.ndarray, *, group: str = "", half: bool = False,
        noise: bool = True,
    ) -> None:  # fmt: skip
        """Add a file: of a picture in linear light or codes, or of numbers in EXR, PFM or NPY.

        ``group`` is the array's field in which files are stacked, by default the name without
        number; ``half`` makes half floats in three channels.
        """
        stem, _, suffix = name.rpartition(".")
        with self.watch.part("files"):
            if suffix not in ("exr", "pfm", "npy") and picture.dtype.kind == "f":
                picture = self.codes(picture, noise=noise)
            elif half:
                picture = picture.astype(np.float16)
            group = group or stem.rstrip("0123456789")
            if group == stem:
                self.arrays[group] = picture
            else:
                self.arrays.setdefault(group, []).append(picture)
            if self.encoded and suffix == "npy":
                np.save(file := io.BytesIO(), picture, allow_pickle=False)
                self.files[name] = file.getvalue()
            elif self.encoded:
                channels = np.repeat(picture[..., None], 3, 2) if half else picture
                self.files[name] = picture_bytes(f".{suffix}", channels, half=half)


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
        exposed = instants[-1]._exposed if instants else 0  # noise differs between instants
        item = Item(description, encoded, watch=watch, _exposed=exposed)
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


def _focal_stack(item: Item, description: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Add files as in FoD500: a TIFF per focus, and depth as half floats in three channels."""
    camera, focus = tracer.scene.camera, list(tracer.scene.focus_distances_m)
    planes = [SensorPlane(distance, camera.f_number) for distance in focus]
    rendering = formed(description, tracer, planes)
    for number, picture in enumerate(rendering.pictures):
        item.add(f"focus{number:02d}.tif", picture)
    _add_sharp(item, "sharp.tif", description, tracer)
    item.add("depth.exr", depth, half=True)
    _note(item, description, camera, depth, focus, rendering)


def _infinigen(item: Item, description: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Add files as in Infinigen Defocus: a PNG per f-number and focus, depth, and the camera's
    matrix.

    Source: github.com/princeton-vl/FOSSA, dataset/infinigen_defocus.py.
    """
    camera, focus = tracer.scene.camera, list(tracer.scene.focus_distances_m)
    planes = [SensorPlane(far, stop) for stop in description.lens.stops for far in focus]
    rendering = formed(description, tracer, planes)
    for plane, picture in zip(planes, rendering.pictures, strict=True):
        name = f"image_ap_{plane.f_number:.2f}_fd_{plane.focus_m:.2f}.png"
        item.add(name, picture, group="focus")
    _add_sharp(item, "image_all_in_focus.png", description, tracer)
    item.add("depth.npy", depth)
    (width, height), pitch = description.size, camera.field_width / description.size.shorter
    matrix = np.array([[1 / pitch, 0, width / 2], [0, 1 / pitch, height / 2], [0, 0, 1]])
    item.arrays |= {"K": matrix, "f_number": [plane.f_number for plane in planes]}
    if item.encoded:
        np.savez(file := io.BytesIO(), K=matrix)
        item.files["cam_all_in_focus.npz"] = file.getvalue()
    distances = [plane.focus_m for plane in planes]
    _note(item, description, camera, depth, distances, rendering)
    item.record["f_numbers"] = [plane.f_number for plane in planes]


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


def _pair_focus(item: Item, tracer: Tracer) -> float:
    distances = tracer.scene.focus_distances_m
    return distances[item.record["index"] % len(distances)]


def _defocus_pair(item: Item, description: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Add a sharp and a defocused picture, depth, and the signed circle of confusion."""
    camera, focus = tracer.scene.camera, _pair_focus(item, tracer)
    rendering = formed(description, tracer, [SensorPlane(focus, camera.f_number)])
    _add_sharp(item, "sharp.png", description, tracer)
    item.add("defocused.png", rendering.pictures[0])
    _add_blur(item, description, camera, depth, focus)
    _note(item, description, camera, depth, [focus], rendering)


def _dual_pixel(item: Item, description: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Add files as in DPDD: pictures of the lens's left and right half and their mean, the sharp
    one, depth, disparity from left to right, and the signed circle of confusion."""
    camera, focus = tracer.scene.camera, _pair_focus(item, tracer)
    plane = SensorPlane(focus, camera.f_number)
    rendering = formed(description, tracer, list(plane.halves()), spare_db=HALF_DB)
    left, right = rendering.pictures
    for name, picture in {"whole": (left + right) / 2, "left": left, "right": right}.items():
        item.add(f"{name}.png", picture)
    _add_sharp(item, "sharp.png", description, tracer)
    _add_blur(item, description, camera, depth, focus)
    slab = Slab.of(camera, 1, description.size)
    item.add("disparity_px.exr", dual_pixel_disparity(slab, plane, depth))
    _note(item, description, camera, depth, [focus], rendering)


def _add_blur(
    item: Item, description: Description, camera: Camera, depth: np.ndarray, focus_m: float
) -> None:  # fmt: skip
    item.add("coc_px.exr", blur_px(camera, description.size.shorter, depth, focus_m))
    item.add("depth_m.exr", depth)


def formed(
    description: Description, tracer: Tracer, planes: list[SensorPlane], spare_db: float = 0.0
) -> Rendering:  # fmt: skip
    """Render these pictures to the description's quality; a wider field is cropped.

    ``spare_db`` are added to the quality, and subtracted from the expected one.
    """
    camera, (width, height) = tracer.scene.camera, description.size
    side = min(width, height)
    reach = max(abs(plane.delta - camera.delta) for plane in planes) * camera.lens_radius_m
    margin = math.ceil(reach * side / camera.field_width) + 1
    wide = replace(camera, sensor_width_m=camera.sensor_width_m * (side + 2 * margin) / side)
    size = width + 2 * margin, height + 2 * margin
    quality = Quality(description.quality_db + spare_db)
    rendering = QualitySearch(tracer, wide, planes, size, quality).pictures()
    window = np.s_[:, margin : height + margin, margin : width + margin]
    expected = rendering.expected_db - spare_db
    return replace(rendering, pictures=rendering.pictures[window], expected_db=expected)


def _add_sharp(item: Item, name: str, description: Description, tracer: Tracer) -> None:
    """Add the picture through the middle of the lens."""
    slab = Slab.of(tracer.scene.camera, 1, description.size)
    pattern, expected_db = views.chosen(tracer, slab, [0], description.quality_db)
    item.add(name, views.view(tracer, slab, 0, pattern), group="sharp", noise=False)
    item.record |= {"each_db": expected_db, "rays_per_pixel": views.rays_per_pixel(pattern)}


def _note(
    item: Item,
    description: Description,
    camera: Camera,
    depth: np.ndarray,
    focus: list[float],
    rendering: Rendering,
) -> None:
    """Add the facts of defocused pictures to the record, which has those of the sharp one."""
    rays, sharp_db = item.record["rays_per_pixel"], item.record["each_db"]
    pixels = description.size.shorter
    radii = np.abs([blur_px(camera, pixels, depth, distance) / 2 for distance in focus])
    item.record |= {
        "focus_m": focus,
        "each_db": [round(float(db), 2) for db in rendering.expected_db] + sharp_db,
        "rays_per_pixel": round(rendering.rays_per_pixel + rays, 2),
        "blurs": np.histogram(np.minimum(radii, BLUR_BINS[-1]), BLUR_BINS)[0].tolist(),
    }


def blur_px(camera: Camera, pixels: int, depth: np.ndarray, focus_m: float) -> np.ndarray:
    """Return the signed diameter of the circle of confusion, pixels, float32; positive behind the
    focus."""
    defocus = 1 / focus_m - 1 / depth.astype(np.float64)  # dioptres
    return (2 * camera.lens_radius_m * defocus * pixels / camera.field_width).astype(np.float32)


# -- films -----------------------------------------------------------------------------------------


def _instant_of_film(
    item: Item, description: Description, tracer: Tracer, depth: np.ndarray
) -> None:
    """Add the middle view of an instant, and its depth; the film itself has all instants."""
    _add_sharp(item, "sharp.png", description, tracer)
    item.add("depth_m.exr", depth)
    item.record["focus_m"] = [tracer.scene.camera.focus_m]


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


# -- light fields -----------------------------------------------------------------------------


def _light_field(item: Item, description: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Add views and their disparities, in the description's layouts."""
    slab = Slab.of(tracer.scene.camera, description.lens.views, description.size)
    count, (width, height) = slab.views**2, slab.size
    checked = (0, count // 2, count - 1)
    pattern, expected_db = views.chosen(tracer, slab, checked, description.quality_db)
    depths = depth_of_views(tracer, slab)
    traced = (item.codes(views.view(tracer, slab, k, pattern)) for k in range(count))
    codes = np.stack(list(traced)).reshape(slab.views, slab.views, height, width, 3)
    reach = float(depths.min()), float(depths.max())
    _add_hci(item, slab, tracer.scene.name, codes, depths)
    with item.watch.part("files"):
        if item.encoded and "mat" in description.also:
            # Values from 0 to 1, as in BasicLFSR's scripts.
            shares = codes / np.float32(np.iinfo(codes.dtype).max)
            arrays.mat_array(file := io.BytesIO(), shares, small=True)
            item.files["mat"] = file.getvalue()
        if item.encoded and "hdf5" in description.also:
            by_view = depths.reshape(codes.shape[:-1])
            arrays.hdf5_arrays(
                file := io.BytesIO(), LF=codes, depth_lowres=by_view,
                disp_lowres=disparity(slab, by_view),
            )  # fmt: skip
            item.files["h5"] = file.getvalue()
    item.record |= {
        "each_db": expected_db, "rays_per_pixel": float(count * views.rays_per_pixel(pattern)),
        "focus_m": [slab.camera.focus_m], "baseline_mm": description.lens.baseline_mm,
        "disparity_px": [float(d) for d in disparity(slab, np.array(reach[::-1]))],
    }  # fmt: skip


def _add_hci(item: Item, slab: Slab, name: str, codes: np.ndarray, depths: np.ndarray) -> None:
    """Add files as in HCI's 4D benchmark, with the disparity of every view."""
    middle = len(depths) // 2
    for number, picture in enumerate(codes.reshape(-1, *codes.shape[2:])):
        item.add(f"input_Cam{number:03d}.png", picture)
        item.add(f"gt_disp_lowres_Cam{number:03d}.pfm", disparity(slab, depths[number]))
    item.add("gt_disp_lowres.pfm", disparity(slab, depths[middle]))
    item.add("gt_depth_lowres.pfm", depths[middle])
    reach = float(depths.min()), float(depths.max())
    grid: Any = SimpleNamespace(
        name=name, columns=slab.views, rows=slab.views, width=slab.size.width,
        height=slab.size.height, disparity=partial(disparity, slab),
    )  # fmt: skip
    text = hci.parameters(grid, KnownGeometry.of_slab(slab), reach)
    item.files["parameters.cfg"] = text.encode()


MAKERS = {
    "focal_stacks": _focal_stack, "infinigen_defocus": _infinigen, "light_fields": _light_field,
    "defocus_pairs": _defocus_pair, "dual_pixel": _dual_pixel, "films": _instant_of_film,
}  # fmt: skip


def make_batch(
    description: Description,
    indices: Iterable[int],
    shard: str | Path,
    records: str | Path,
    drafts: str | Path,
    device: Device,
    *,
    made_of: str = "",
    finished: Finished | None = None,
) -> list[dict]:
    """Make items ``indices``: a tar file of all, and their records as JSON.

    Complete items in the folder ``drafts``, which is removed at the end, or in a ``finished`` data
    set are kept if their sources' digest is ``made_of``.
    """
    indices, drafts, all_records = list(indices), Path(drafts), []
    make_folder(drafts)
    for index in indices:
        tar, record = (drafts / f"{index:06d}.{kind}" for kind in ("tar", "json"))
        if not record.exists():  # written after its tar file
            kept = finished.item(index, made_of) if finished else None
            files, facts = kept or _make_or_refuse(description, index, device, made_of, drafts)
            write_tar(tar, ((f"{index:06d}.{name}", data) for name, data in files.items()))
            write_json(record, facts)
        all_records.append(json.loads(record.read_text(encoding="utf-8")))
    write_tar(shard, (file for i in indices for file in members(drafts / f"{i:06d}.tar")))
    write_json(records, all_records)
    shutil.rmtree(drafts, ignore_errors=True)
    return all_records


def made_of(description: Description, sources: str) -> str:
    """Return the digest of all that items depend on: keys, files and the library's code."""
    return f"{description.digest(sources)}-{version(Path(__file__))}"


def run_batch(
    description: Description, scenes: range, shard: Path, folder: Path, sources: str,
    device: Device | str | None, threads: int | None = None,
) -> None:  # fmt: skip
    """Make the items of one job: ``shard``, and a JSON file of records beside it.

    Complete items of a killed job, or of the finished data set in ``folder``, are kept.
    """
    digest = made_of(description, sources)
    drafts = shard.with_name(f"drafts-{digest}-{shard.stem}")
    for other in set(shard.parent.glob(f"drafts-*-{shard.stem}")) - {drafts}:
        shutil.rmtree(other, ignore_errors=True)  # of other code or sources
    if not isinstance(device, Device):
        device = open_device(device, threads=threads)
    make_batch(
        description, scenes, shard, shard.with_suffix(".json"), drafts, device, made_of=digest,
        finished=Finished.at(folder),
    )  # fmt: skip


def _make_or_refuse(
    description: Description, index: int, device: Device, made_of: str, drafts: Path
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return files and record of an item; for a refused scene no files, and the reason."""
    start, processor = time.perf_counter(), time.process_time()
    try:
        item = make_item(description, index, device, made_of, drafts=drafts)
    except (SceneError, OpticsError) as error:
        item = Item(record={"index": index, "refused": str(error)})
    item.record["seconds"] = round(time.perf_counter() - start, 3)
    item.record["core_seconds"] = round(time.process_time() - processor, 3)
    for part in ("scene", "files"):  # the rest is tracing
        item.record[f"{part}_core_seconds"] = round(item.watch.seconds.get(part, 0.0), 3)
    return item.files, item.record

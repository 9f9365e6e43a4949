"""Items of a data set: the files of one scene, all from one tracer, and what is known of them."""

from __future__ import annotations

import io
import json
import math
import re
import time
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lfcore.colour import srgb_codes
from lfcore.datasets import views
from lfcore.datasets.description import Description
from lfcore.datasets.sample import BACKDROP, sample
from lfcore.errors import SceneError
from lfcore.exchange import hci, hdf5, matlab
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.grid_geometry import KnownGeometry
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.pictures import picture_bytes
from lfcore.rendering.depth import all_samples, depth_of_views, disparity
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.quality import Quality, QualitySearch, Rendering
from lfcore.timing import Stopwatch
from lfcore.tracing.tracer import Tracer

DEPTH_BINS = np.geomspace(0.03, 30, 41)
"""Edges of the records' histogram of depths, metres."""
BLUR_BINS = np.linspace(0, 10, 41)
"""Edges of that of blur radii, pixels; larger ones are in the last."""


@dataclass
class Item:
    """Files by their field, in order, the item's record, and core seconds of parts of the work."""

    files: dict[str, bytes] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)
    watch: Stopwatch = field(default_factory=lambda: Stopwatch(clock=time.process_time))

    def add(self, name: str, picture: np.ndarray, *, half: bool = False) -> None:
        with self.watch.part("files"):
            self.files[name] = picture_bytes(name[name.rindex(".") :], picture, half=half)


def make_item(description: Description, index: int, device: Device | str | None = None) -> Item:
    """Sample, trace and encode scene ``index``.

    Raises :class:`SceneError` or :class:`OpticsError` for a scene that makes no item: a mesh that
    cannot be read, too little to see, or a quality beyond the budget.
    """
    item = Item()
    with item.watch.part("scene"):
        scene, names = sample(description, index)
        tracer = open_tracer(scene, device)
    slab = Slab(scene.camera, 1, description.pixels)
    triangle, depth = (
        found[0] for found in tracer.bundle_hits(bundles.views(slab, all_samples(slab)))
    )
    behind = np.array([material.name in BACKDROP for material in scene.materials])
    seen = float((~behind[scene.material_ids[triangle]] & (triangle >= 0)).mean())
    if seen < description.placement.least_seen:
        raise SceneError(
            f"empty frustum: objects fill {100 * seen:.1f} % of the picture", file=scene.name
        )
    item.record = {
        "index": index, "split": description.split(index), "objects": names, "seen": round(seen, 4),
        "camera": scene.camera.to_json() | {"pixels": description.pixels},
        "depth_m": [float(depth.min()), float(depth.max())],
        "depths": np.histogram(depth, DEPTH_BINS)[0].tolist(),
    }  # fmt: skip
    MAKERS[description.kind](item, description, tracer, depth)
    # Of the worst picture.
    item.record["expected_db"] = round(float(min(item.record["each_db"])), 2)
    item.files["json"] = json.dumps(item.record).encode()
    return item


def _focal_stack(item: Item, of: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """As FoD500: a TIFF per focus, and depth as half floats in three channels."""
    made, focus = formed(of, tracer, list(of.lens.focus_m))
    for number, picture in enumerate(made.pictures):
        item.add(f"focus{number:02d}.tif", picture)
    _add_sharp(item, "sharp.tif", of, tracer)
    item.add("depth.exr", np.repeat(depth[..., None], 3, 2), half=True)
    _note(item, of, tracer.scene.camera, depth, focus, made)


def _defocus_pair(item: Item, of: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Sharp and out of focus, with depth and the signed circle of confusion."""
    number = item.record["index"] % len(of.lens.focus_m)
    made, focus = formed(of, tracer, [of.lens.focus_m[number]])
    _add_sharp(item, "sharp.png", of, tracer)
    item.add("defocused.png", made.pictures[0])
    item.add("coc_px.exr", blur_px(tracer.scene.camera, of.pixels, depth, focus[0]))
    item.add("depth_m.exr", depth)
    _note(item, of, tracer.scene.camera, depth, focus, made)


def formed(
    of: Description, tracer: Tracer, focus: list[float]
) -> tuple[Rendering, list[float]]:  # fmt: skip
    """Pictures of the wanted quality at these distances.

    A margin, which is cut off, lets all of the lens see the border.
    """
    camera = tracer.scene.camera
    planes = [SensorPlane(distance, camera.f_number) for distance in focus]
    reach = max(abs(plane.delta - camera.delta) for plane in planes) * camera.lens_radius_m
    margin = math.ceil(reach * of.pixels / camera.field_width) + 1
    side = of.pixels + 2 * margin
    wide = replace(camera, sensor_width_m=camera.sensor_width_m * side / of.pixels)
    made = QualitySearch(tracer, wide, planes, side, Quality(of.quality_db)).pictures()
    window = np.s_[:, margin : side - margin, margin : side - margin]
    return replace(made, pictures=made.pictures[window], error=made.error[window]), focus


def _add_sharp(item: Item, name: str, of: Description, tracer: Tracer) -> None:
    """The picture through the middle of the lens."""
    slab = Slab(tracer.scene.camera, 1, of.pixels)
    pattern, expected_db = views.chosen(tracer, slab, [0], of.quality_db)
    item.add(name, views.view(tracer, slab, 0, pattern))
    item.record |= {"each_db": expected_db, "rays_per_pixel": views.rays_per_pixel(pattern)}


def _note(
    item: Item, of: Description, camera: Camera, depth: np.ndarray, focus: list[float],
    made: Rendering,
) -> None:  # fmt: skip
    """Add what is known of defocused pictures to the record, which has that of the sharp one."""
    rays, sharp_db = item.record["rays_per_pixel"], item.record["each_db"]
    radii = np.abs([blur_px(camera, of.pixels, depth, distance) / 2 for distance in focus])
    item.record |= {
        "focus_m": focus,
        "each_db": [round(float(db), 2) for db in made.expected_db] + sharp_db,
        "rays_per_pixel": round(made.rays_per_pixel + rays, 2),
        "blurs": np.histogram(np.minimum(radii, BLUR_BINS[-1]), BLUR_BINS)[0].tolist(),
    }


def blur_px(camera: Camera, pixels: int, depth: np.ndarray, focus_m: float) -> np.ndarray:
    """Signed diameter of the circle of confusion, pixels, float32; positive behind the focus."""
    apart = 1 / focus_m - 1 / depth.astype(np.float64)
    return (2 * camera.lens_radius_m * apart * pixels / camera.field_width).astype(np.float32)


# -- light fields -----------------------------------------------------------------------------


@dataclass
class _Views:
    """What :func:`lfcore.exchange.hci.parameters` asks of views."""

    slab: Slab
    name: str

    def __post_init__(self) -> None:
        self.rows = self.columns = self.slab.views
        self.width = self.height = self.slab.pixels

    def disparity(self, depth: np.ndarray) -> np.ndarray:
        return disparity(self.slab, depth)


def _light_field(item: Item, of: Description, tracer: Tracer, depth: np.ndarray) -> None:
    """Views and their disparities, in the layouts that are asked for."""
    slab = Slab(tracer.scene.camera, of.lens.views, of.pixels)
    count = slab.views**2
    pattern, expected_db = views.chosen(tracer, slab, (0, count // 2, count - 1), of.quality_db)
    depths = depth_of_views(tracer, slab)
    codes = np.empty((slab.views, slab.views, of.pixels, of.pixels, 3), np.uint8)
    for number, shown in enumerate(codes.reshape(count, *codes.shape[2:])):
        shown[:] = srgb_codes(views.view(tracer, slab, number, pattern))
    reach = float(depths.min()), float(depths.max())
    _add_hci(item, _Views(slab, tracer.scene.name), codes, depths)
    with item.watch.part("files"):
        if "mat" in of.also:
            matlab.write_array(file := io.BytesIO(), codes)
            item.files["mat"] = file.getvalue()
        if "hdf5" in of.also:
            by_view = depths.reshape(codes.shape[:-1])
            hdf5.write_arrays(
                file := io.BytesIO(), LF=codes, depth_lowres=by_view,
                disp_lowres=disparity(slab, by_view),
            )  # fmt: skip
            item.files["h5"] = file.getvalue()
    item.record |= {
        "each_db": expected_db, "rays_per_pixel": float(count * views.rays_per_pixel(pattern)),
        "focus_m": [slab.camera.focus_m], "baseline_mm": of.lens.baseline_mm,
        "disparity_px": [float(d) for d in disparity(slab, np.array(reach[::-1]))],
    }  # fmt: skip


def _add_hci(item: Item, grid: _Views, codes: np.ndarray, depths: np.ndarray) -> None:
    """As HCI's 4D benchmark, with the disparity of every view."""
    slab, middle = grid.slab, len(depths) // 2
    for number, picture in enumerate(codes.reshape(-1, *codes.shape[2:])):
        item.add(f"input_Cam{number:03d}.png", picture)
        item.add(f"gt_disp_lowres_Cam{number:03d}.pfm", disparity(slab, depths[number]))
    item.add("gt_disp_lowres.pfm", disparity(slab, depths[middle]))
    item.add("gt_depth_lowres.pfm", depths[middle])
    reach = float(depths.min()), float(depths.max())
    text = hci.parameters(grid, KnownGeometry.of_slab(slab), reach)  # type: ignore[arg-type]
    item.files["parameters.cfg"] = text.encode()


MAKERS = {
    "focal_stacks": _focal_stack, "light_fields": _light_field, "defocus_pairs": _defocus_pair,
}  # fmt: skip


def place_of(kind: str, split: str, index: int, name: str) -> str:
    """Where the file of a field is in the folder of a data set."""
    if kind == "focal_stacks":  # one folder: training, then validation
        name = re.sub(r"^focus(\d+)\.tif$", r"_\1All.tif", name)
        named = {"depth.exr": "Dpt.exr", "sharp.tif": "AiF.tif", "json": ".json"}.get(name, name)
        return f"{index:06d}{named}"
    if name == "mat":
        return f"HCI_new/{'test' if split == 'test' else 'training'}/{index:06d}.mat"
    if name == "h5":
        return f"hdf5/{split}/{index:06d}.h5"
    folder = f"hci/{split}" if kind == "light_fields" else split
    return f"{folder}/{index:06d}/{'item.json' if name == 'json' else name}"

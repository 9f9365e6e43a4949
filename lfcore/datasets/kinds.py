"""The pictures of each kind of data set: what is traced, and the files that it becomes."""

import io
import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np

from lfcore.datasets import views
from lfcore.datasets.description import Description
from lfcore.datasets.item import Item
from lfcore.exchange import arrays, hci
from lfcore.optics.camera import Camera
from lfcore.optics.dual_pixel import dual_pixel_disparity
from lfcore.optics.grid_geometry import KnownGeometry
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import depth_of_views, disparity
from lfcore.rendering.quality import Quality, QualitySearch, Rendering
from lfcore.tracing.tracer import Tracer

BLUR_BINS = np.linspace(0, 10, 41)
"""The edges of the histogram of blur radii, pixels; larger radii count in the last bin."""
HALF_DB = 3.0
"""The dB by which half an aperture is worse than the whole, as it has half the rays."""


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


def _instant_of_film(
    item: Item, description: Description, tracer: Tracer, depth: np.ndarray
) -> None:
    """Add the middle view of an instant, and its depth; the film itself has all instants."""
    _add_sharp(item, "sharp.png", description, tracer)
    item.add("depth_m.exr", depth)
    item.record["focus_m"] = [tracer.scene.camera.focus_m]


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
    """Add the facts of defocused pictures to the record.  Those of the sharp picture are there."""
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


MAKERS = {
    "focal_stacks": _focal_stack, "infinigen_defocus": _infinigen, "light_fields": _light_field,
    "defocus_pairs": _defocus_pair, "dual_pixel": _dual_pixel, "films": _instant_of_film,
}  # fmt: skip

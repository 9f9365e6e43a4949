"""Truth beside pictures: surfaces, identities, optical flow, occlusion and blur of every pixel.

All is that of the ray through the middle of a pixel, never a mixture of two surfaces.
"""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import OpenEXR

from lfcore.errors import LfcoreError, check_kind
from lfcore.files import make_folder, whole_file
from lfcore.opencl.device import Device
from lfcore.optics import bundles
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels
from lfcore.optics.slab import Slab
from lfcore.pictures import check_suffix
from lfcore.rendering.depth import check_samples, disparity
from lfcore.rendering.prepared import open_dark_tracer
from lfcore.scene.model import Scene
from lfcore.tracing.tracer import Tracer

SAME_DEPTH = 1e-4
"""The relative difference of depth up to which two rays meet the same point: float32, twice."""
VECTORS = {"normal": "XYZ", "albedo": "RGB", "flow_px": "UV", "scene_flow_m": "XYZ"}
"""The letters of channels in EXR, by field."""


def truth(
    scene: Scene,
    views: int = 1,
    pixels: Pixels = 256,
    *,
    sample: Sequence[int] | None = None,
    flow_to: Sequence[int] | None = None,
    planes: Sequence[SensorPlane] = (),
    device: Device | str | None = None,
) -> dict[str, np.ndarray]:
    """Trace what is true of each pixel of a view.

    Parameters
    ----------
    scene : Scene
        As in :func:`bake`.
    views, pixels : int
        The views per side, and the size of pictures, as in :func:`render`.
    sample : (int, int), optional
        Column and row of the view's lens sample.  Default: the middle.
    flow_to : (int, int), optional
        The lens sample of the view that flow leads to, and that may see less.  Default: the middle.
    planes : sequence of SensorPlane
        Pictures whose circles of confusion are computed.
    device : Device or str, optional
        As in :func:`render`.

    Returns
    -------
    dict of ndarray
        ``depth_m`` (H, W) float32, along the axis, infinity for a miss; ``disparity_px`` (H, W)
        float32, as :func:`disparity`; ``normal`` (H, W, 3) float32, unit shading normals in camera
        space, 0 for a miss; ``albedo`` (H, W, 3) float32, linear; ``triangle`` and ``material``
        (H, W) int32, numbers in the scene, -1 for a miss; ``flow_px`` (H, W, 2) float32, columns
        and rows to the same point in the other view; ``occluded`` (H, W) bool, whether something
        hides the point there; ``coc_px`` (P, H, W) float32, diameters, positive behind the focus;
        ``specular`` (H, W) bool, whether it is a mirror, glass, coated or a veil;
        ``virtual_depth_m`` (H, W) float32, the depth at which what such a surface shows appears,
        else ``depth_m``.

    Raises
    ------
    OpticsError
        A sample is outside the lens.

    Examples
    --------
    >>> known = lfcore.truth(scene, views=3, pixels=(24, 16), sample=(0, 1))
    >>> known["normal"].shape, known["flow_px"].shape, bool(known["occluded"].all())
    ((16, 24, 3), (16, 24, 2), False)
    """
    check_kind(scene, Scene, "scene", remedy="Read one with load_scene")
    slab = Slab.of(scene.camera, views, pixels)
    middle = (slab.views // 2,) * 2
    return view_truth(
        open_dark_tracer(scene, device), slab, sample or middle, flow_to or middle, planes
    )


def view_truth(
    tracer: Tracer, slab: Slab, sample: Sequence[int], flow_to: Sequence[int],
    planes: Sequence[SensorPlane] = (),
) -> dict[str, np.ndarray]:  # fmt: skip
    """As :func:`truth`, with a tracer."""
    samples = check_samples(slab, np.array([sample]))
    other = check_samples(slab, np.array([flow_to]))
    rays = bundles.views(slab, samples)
    triangle, depth = (array[0] for array in tracer.bundle_hits(rays, samples))
    surfaces = tracer.bundle_surfaces(rays, samples)
    materials = np.append(tracer.scene.material_ids, -1).astype(np.int32)  # -1: a miss
    offset = disparity(slab, depth)
    flow = offset[..., None] * (samples - other)[0].astype(np.float32)
    specular, image = tracer.shows_others(triangle), depth
    for _, virtual in tracer.parts(rays)[1:] if specular.any() else ():
        image = np.where(virtual[0] > 0, virtual[0], depth)
    return {
        "depth_m": depth, "disparity_px": offset, "normal": surfaces.normal[0],
        "albedo": surfaces.albedo[0], "triangle": triangle, "material": materials[triangle],
        "flow_px": flow, "occluded": occluded(tracer, slab, other, rays, triangle, depth),
        "coc_px": np.array(
            [circle_of_confusion(slab, plane, depth) for plane in planes], np.float32
        ).reshape(-1, *depth.shape),
        "specular": specular, "virtual_depth_m": image,
    }  # fmt: skip


def occluded(
    tracer: Tracer, slab: Slab, other: np.ndarray, rays: bundles.Bundles, triangle: np.ndarray,
    depth: np.ndarray,
) -> np.ndarray:  # fmt: skip
    """Return whether the lens point of sample ``other`` (1, 2) does not see the rays' hits, (H, W)
    bool; misses are points at infinity."""
    origins, directions = (part.reshape(-1, 3).astype(np.float64) for part in rays.rays())
    hit = triangle.ravel() >= 0
    eye = np.append(slab.lens_positions()[other[0]], 0.0)
    far = np.where(hit, depth.ravel(), 1.0)[:, None]
    towards = np.where(hit[:, None], origins + far * directions - eye, directions)
    return _hidden(tracer, eye, towards, triangle.ravel()).reshape(depth.shape)


def _hidden(
    tracer: Tracer, eye: np.ndarray, towards: np.ndarray, triangle: np.ndarray
) -> np.ndarray:  # fmt: skip
    """Return whether ``eye`` (3,) does not see the points ``towards`` (R, 3) on these triangles,
    (R,) bool; of misses (-1) the points at infinity."""
    hit = triangle >= 0
    found = tracer.closest_hit(
        np.broadcast_to(eye, towards.shape).astype(np.float32), towards.astype(np.float32)
    )
    # The distance is in units of ``towards``, which ends at the point.
    hidden = np.where(hit, found.distance < 1 - SAME_DEPTH, found.triangle >= 0)
    return hidden & (found.triangle != triangle)


def flow_between(
    tracer: Tracer, later: Tracer, slab: Slab, sample: Sequence[int]
) -> dict[str, np.ndarray]:
    """Return where the points of a view are at a later instant of the same scene.

    The hit of a pixel's middle keeps its weights of the triangle's corners.

    Returns
    -------
    dict of ndarray
        ``flow_px`` (H, W, 2) float32, columns and rows to the same point in the later view,
        infinity for a point that is no longer before the lens; ``scene_flow_m`` (H, W, 3) float32,
        its way in camera space; ``occluded`` (H, W) bool, whether something hides it then.  For a
        miss the first two are 0.
    """
    samples = check_samples(slab, np.array([sample]))
    origins, directions = (part.reshape(-1, 3) for part in bundles.views(slab, samples).rays())
    hits = tracer.closest_hit(origins, directions)
    hit = (hits.triangle >= 0)[:, None]
    weights = np.where(hit, hits.barycentric, 0).astype(np.float64)[..., None]
    eye = np.append(slab.lens_positions()[samples[0]], 0.0)
    here, there = (
        (weights * each.scene.triangles[hits.triangle]).sum(1) - eye for each in (tracer, later)
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        flow = (there[:, :2] / there[:, 2:] - here[:, :2] / here[:, 2:]) / slab.pixel_pitch
    before = there[:, 2:] > 0
    flow = np.where(hit, np.where(before, flow, np.inf), 0)
    hidden = _hidden(later, eye, np.where(hit, there, directions), hits.triangle)
    shape = slab.size.height, slab.size.width
    return {
        "flow_px": flow.astype(np.float32).reshape(*shape, 2),
        "scene_flow_m": np.where(hit, there - here, 0).astype(np.float32).reshape(*shape, 3),
        "occluded": hidden.reshape(shape) | ~(before | ~hit).reshape(shape),
    }


def circle_of_confusion(slab: Slab, plane: SensorPlane, depth: np.ndarray) -> np.ndarray:
    """Return the signed diameter of the circle of confusion, pixels, float32; positive behind the
    focus."""
    with np.errstate(divide="ignore"):
        defocus = plane.delta - 1 / depth.astype(np.float64)  # dioptres
    diameter = slab.camera.focal_length_m / plane.f_number
    return (diameter * defocus / slab.pixel_pitch).astype(np.float32)


def write_truth(path: str | Path, known: dict[str, np.ndarray]) -> None:
    """Write the truth of a view: ``.npz``, or ``.exr`` with named channels.

    Channels of an EXR are ``depth_m``, ``normal.X`` to ``Z``, ``albedo.R`` to ``B``, ``flow_px.U``
    and ``V``, ``coc_px.00`` and so on, float32; numbers count from 1, uint32, and 0 is a miss;
    ``occluded`` and ``specular`` are 0 or 1, uint32.

    Raises
    ------
    LfcoreError
        Another suffix, or a file that cannot be written.

    Examples
    --------
    >>> lfcore.write_truth("ball.exr", lfcore.truth(scene, pixels=16))
    """
    check_suffix(path, (".npz", ".exr"))
    make_folder(Path(path).parent)
    with whole_file(path) as file:
        if Path(path).suffix.lower() == ".npz":
            np.savez_compressed(file, **known)  # type: ignore[arg-type]
        else:
            file.write(channels_exr(known))


def channels_exr(known: dict[str, np.ndarray]) -> bytes:
    """Return an EXR with the named channels of :func:`write_truth`."""
    channels: dict[str, np.ndarray] = {}
    for name, array in known.items():
        if array.dtype.kind in "bi":
            channels[name] = (array.astype(np.int64) + (array.dtype.kind == "i")).astype(np.uint32)
        elif name in VECTORS:
            for k, letter in enumerate(VECTORS[name]):
                channels[f"{name}.{letter}"] = array[..., k]
        elif array.ndim == 3:
            channels |= {f"{name}.{k:02d}": one for k, one in enumerate(array)}
        else:
            channels[name] = array
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    file = io.BytesIO()
    try:
        pixels = {name: np.ascontiguousarray(array) for name, array in channels.items()}
        with OpenEXR.File(header, pixels) as whole:
            whole.write(file)
    except (RuntimeError, ValueError) as error:
        raise LfcoreError(f"cannot be made an EXR: {error}") from None
    return file.getvalue()

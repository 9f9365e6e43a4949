"""Depth and disparity of views, and a picture in which everything is in focus.

A pixel has the depth (planar z) of the ray through its middle, never a mixture of two surfaces.
"""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError
from lfcore.files import whole_file
from lfcore.optics import bundles
from lfcore.optics.slab import Extent, Slab, all_samples
from lfcore.progress import Progress
from lfcore.refocus.two_parts import virtual_depth
from lfcore.rendering.exposure import ExposedTracer
from lfcore.tracing.tracer import Tracer

VIEWS_AT_A_TIME_RAYS = 1 << 24
"""The rays of views that are traced at a time."""
SAME_PX = 0.5
"""The blur, pixels, within which two depths are the same."""
RANGE_VIEWS = 3
"""The lens samples per side of the rays that measure the range of depths."""
RANGE_PIXELS = 96
"""The pixels per side of these rays."""
MOST_VIRTUAL = 0.995
"""The quantile of virtual inverse depths up to which they are stored."""


def depth_of_views(
    tracer: Tracer,
    slab: Slab,
    samples: np.ndarray | None = None,
    *,
    virtual: bool = False,
    progress: Progress | None = None,
) -> np.ndarray:
    """(K, H, W) float32, metres along the axis, indexed [view, v, u]; infinity for a miss.

    ``samples`` (K, 2) are lens samples (i, j); default all, row by row.  ``virtual`` depths are,
    for mirrors, glass and coats, those of the images that they show.
    """
    samples = check_samples(slab, samples)
    width, height = slab.size
    depth = np.empty((len(samples), height, width), np.float32)
    step = max(1, VIEWS_AT_A_TIME_RAYS // (width * height))
    for start in range(0, len(samples), step):
        part = samples[start : start + step]
        rays = bundles.views(slab, part)
        if virtual:
            depth[start : start + step] = virtual_depth([d for _, d in tracer.parts(rays)])
        else:
            depth[start : start + step] = tracer.bundle_hits(rays, part)[1]
        if progress:
            progress(start + len(part), len(samples))
    return depth


def depth_range(tracer: Tracer, slab: Slab) -> tuple[float, float] | None:
    """The nearest and the farthest depth, metres, of a few rays spread over the slab; None if all
    miss."""
    depth = _spread_depths(tracer, slab)
    depth = depth[np.isfinite(depth)]
    return (float(depth.min()), float(depth.max())) if len(depth) else None


def seen_range(tracer: Tracer, slab: Slab) -> tuple[float, float] | None:
    """The depth range; for a mesh on a floor, the scene's, without the floor."""
    scene = tracer.scene
    if scene.floor is None or scene.depth_range is None:
        return depth_range(tracer, slab)
    near, far = scene.depth_range
    return near, far


def depth_content(tracer: Tracer, slab: Slab) -> dict:
    """The depth ranges for a file's ``content``."""
    ranges = {"depth_m": depth_range(tracer, slab), "ends_m": tracer.scene.depth_range}
    if tracer.scene.floor:
        ranges["seen_m"] = seen_range(tracer, slab)
    return {name: list(ends) for name, ends in ranges.items() if ends}


def dioptre_range(tracer: Tracer, slab: Slab, margin: float) -> tuple[float, float]:
    """The least and greatest inverse depth, 1/m, of a few rays, misses being 0.

    The range is widened on either side by the share ``margin``.
    """
    inverse = _inverse(_spread_depths(tracer, slab))
    far, near = (float(inverse.min()), float(inverse.max())) if len(inverse) else (0.0, 0.0)
    return max(0.0, far - margin * (near - far)), near + margin * (near - far)


def virtual_range(tracer: Tracer, slab: Slab, margin: float) -> tuple[float, float]:
    """As :func:`dioptre_range`, of virtual depths, without the nearest ones: near a focus of curved
    glass, rays have arbitrary virtual depths."""
    coarse = spread_over(slab)
    rays = bundles.views(coarse, all_samples(coarse))
    instants = tracer.each((0.0, 0.5, 1.0)) if isinstance(tracer, ExposedTracer) else [tracer]
    depths = [depth for now in instants for _, depth in now.parts(rays)[1:]]
    depth = np.concatenate([np.ravel(each) for each in depths] or [np.zeros(0)])
    inverse = 1.0 / depth[depth > 0].astype(float)
    near = float(np.quantile(inverse, MOST_VIRTUAL)) if len(inverse) else 0.0
    return 0.0, near * (1 + margin)


def _spread_depths(tracer: Tracer, slab: Slab) -> np.ndarray:
    """Depths in metres, infinity for a miss, of a few rays all over lens and picture."""
    coarse = spread_over(slab)
    origins, directions = bundles.views(coarse, all_samples(coarse)).rays()
    instants = tracer.each((0.0, 0.5, 1.0)) if isinstance(tracer, ExposedTracer) else [tracer]
    depth = np.concatenate([now.closest_hit(origins, directions)[1] for now in instants])
    return depth[depth > 0]


def spread_over(slab: Slab) -> Slab:
    """A slab of a few rays all over the lens and the picture."""
    views, extent = min(slab.views, RANGE_VIEWS), None
    if slab.extent is not None:
        extent = Extent((0, 0, views, views), slab.picture(RANGE_PIXELS))
    return Slab(slab.camera, views, RANGE_PIXELS, extent)


def check_samples(slab: Slab, samples: np.ndarray | None) -> np.ndarray:
    """(K, 2) lens samples (i, j), default all; raises :class:`OpticsError` for one outside the
    lens."""
    samples = all_samples(slab) if samples is None else np.asarray(samples).reshape(-1, 2)
    if samples.size and not (0 <= samples.min() and samples.max() < slab.views):
        raise OpticsError(f"lens samples are from 0 to {slab.views - 1}", key="samples")
    return samples


def disparity(slab: Slab, depth: np.ndarray) -> np.ndarray:
    """Convert depth to disparity: the pixels by which a point moves from view to view.

    A view at lens point s shows a point of depth z at the tangent ``X / z - s (1 / z - delta)``.
    The point moves against the lens point, by ``-(1 / z - delta) lens pitch / pixel pitch`` pixels
    per lens sample.  Disparity has the other sign: it is positive before the plane of focus.

    Parameters
    ----------
    slab : Slab
        The lens and its views.
    depth : array_like
        Metres along the axis, infinity for a miss.

    Returns
    -------
    ndarray
        float32 pixels, of the same shape; 0 in the plane of focus.

    Examples
    --------
    >>> slab = lfcore.Slab(lfcore.Camera(0.05, 0.036, 2.0, 3.0), views=5, pixels=64)
    >>> lfcore.disparity(slab, np.array([3.0])).tolist()
    [0.0]
    """
    scale = slab.lens_pitch_m / slab.pixel_pitch
    with np.errstate(divide="ignore"):
        inverse = 1.0 / np.asarray(depth, np.float64)
        return np.asarray((inverse - slab.camera.delta) * scale, np.float32)


def all_in_focus(
    slab: Slab, depth: np.ndarray, views: Iterable[tuple[np.ndarray, np.ndarray, np.ndarray]]
) -> np.ndarray:
    """(H, W, 3) float32, linear light: the picture through the lens centre, every point averaged
    over all views that see it, else from the view nearest to the axis.

    ``depth`` (H, W) is that of rays through the lens centre.  ``views`` are samples (K, 2), light
    (K, H, W, 3) and depths (K, H, W), in groups.  A view sees a point if it has the same depth
    there, to within :data:`SAME_PX` of blur at the rim of the lens.
    """
    (columns, rows), lens = slab.size, slab.lens_positions()
    near = _inverse(depth)
    limit = SAME_PX * slab.pixel_pitch / max(slab.camera.lens_radius_m, 1e-30)
    shift = (near - slab.camera.delta) / slab.pixel_pitch  # pixels per metre of lens
    total, weight = np.zeros((rows, columns, 3)), np.zeros((rows, columns, 1))
    fallback, closest = np.zeros((rows, columns, 3)), np.inf
    v, u = np.mgrid[:rows, :columns]
    for samples, light, depths in views:
        for (i, j), picture, view_depth in zip(samples, light, depths, strict=True):
            x = np.floor(u - lens[i] * shift + 0.5).astype(np.int64)
            y = np.floor(v - lens[j] * shift + 0.5).astype(np.int64)
            inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
            x, y = x.clip(0, columns - 1), y.clip(0, rows - 1)
            visible = inside & (np.abs(_inverse(view_depth[y, x]) - near) <= limit)
            total += picture[y, x] * visible[..., None]
            weight += visible[..., None]
            if (radius := np.hypot(lens[i], lens[j])) < closest:
                closest, fallback = radius, picture[y, x]
    return np.where(weight > 0, total / np.maximum(weight, 1), fallback).astype(np.float32)


def _inverse(depth: np.ndarray) -> np.ndarray:
    with np.errstate(divide="ignore"):
        return 1.0 / np.asarray(depth, np.float64)


def depth_picture(depth: np.ndarray) -> np.ndarray:
    """Colour a depth map, uint8 (H, W, 3) sRGB: near is warm, far is cold, evenly in dioptres,
    misses are black.  The map is Turbo (Mikhailov, 2019)."""
    import cv2

    near = _inverse(depth)
    hit = np.isfinite(depth) & (depth > 0)
    if not hit.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    low, high = near[hit].min(), near[hit].max()
    share = np.where(hit, (near - low) / max(high - low, 1e-30), 0.0)
    codes = np.rint(20 + 225 * share).astype(np.uint8)  # the colour map's ends are nearly black
    colours = cv2.applyColorMap(codes, cv2.COLORMAP_TURBO)[..., ::-1]
    return np.ascontiguousarray(np.where(hit[..., None], colours, 0).astype(np.uint8))


def save_depth(path: str | Path, slab: Slab, samples: np.ndarray, depth: np.ndarray) -> None:
    """Write depths and disparities (K, H, W) as npz; its array ``slab`` has the bytes of the slab's
    JSON."""
    header = np.frombuffer(json.dumps(slab.to_json()).encode(), np.uint8)
    with whole_file(path) as file:
        np.savez_compressed(
            file,
            depth_m=depth,
            disparity_px=disparity(slab, depth),
            samples=np.asarray(samples, np.int32),
            slab=header,
        )

"""The brightest light of a slab's rays, before they are stored."""

from __future__ import annotations

import math

import numpy as np

from lfcore.optics import bundles
from lfcore.optics.slab import Slab
from lfcore.rendering.depth import all_samples, spread_over
from lfcore.scene.model import Scene
from lfcore.tracing.tracer import Tracer

HEADROOM = 2.0
"""Highlights that few rays see, over those that all rays see, at most."""


def peak_to_store(tracer: Tracer, slab: Slab, transfer: str | None) -> float | None:
    """The light of the brightest code, a power of two; None for sRGB, which ends at white.

    Without a ``transfer``, sRGB where nothing brighter than white is seen.  Of surfaces that glow
    and of the background it is exact, of highlights a measurement by few rays, with headroom.
    """
    stops = tracer.needs.stops
    if transfer == "srgb" or (transfer is None and not stops):
        return None
    found = bundles.views(coarse := spread_over(slab), all_samples(coarse))
    seen = float(tracer.bundle_radiance(found).max(initial=0.0)) if stops else 1.0
    glow = _glow(tracer.scene, slab)
    if transfer is None and max(seen, glow) <= 1:
        return None
    most = max(1.0, glow, HEADROOM * seen)
    return 2.0 ** min(stops, math.ceil(math.log2(most)))


def _glow(scene: Scene, slab: Slab) -> float:
    """The brightest emission of a surface that has a corner in the picture."""
    glows = np.array([max(material.emission) for material in scene.materials], np.float64)
    x, y, z = np.moveaxis(scene.triangles, -1, 0).astype(np.float64)
    reach = slab.camera.field_width / 2 * max(slab.size) / min(slab.size)
    reach = reach * np.maximum(z, 0) + slab.camera.lens_radius_m
    seen = ((z > 0) & (np.maximum(np.abs(x), np.abs(y)) <= reach)).any(axis=1)
    return float(glows[scene.material_ids[seen]].max(initial=0.0))

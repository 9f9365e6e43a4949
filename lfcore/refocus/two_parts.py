"""Slicing of light in two parts: a surface's own light, and what it reflects or lets pass.

A reflection is in focus at the depth of its virtual image, not of the mirror.  So each part is
sliced by its own depth.  Where a surface has no light of its own (mirrors, glass), the specular
part takes its place among the layers of the picture.  Elsewhere (coats) the picture is a sum: own
light, plus the share of the pixel that such surfaces cover, by their depth, times the picture of
the specular light alone, by its virtual depth and without layers.

Sources: Sinha et al., "Image-Based Rendering for Scenes with Reflections", TOG 2012 (a sum of
layers); Lochmann et al., "Real-Time Reflective and Refractive Novel-View Synthesis", VMV 2014.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import ViewSet
from lfcore.refocus.depth_slicing import DepthSlicer
from lfcore.tracing.specular import BLACK

Part = tuple[np.ndarray, np.ndarray]
"""Light (K, rows, columns, 3) and depth (K, rows, columns), metres, float32."""


def placed_parts(parts: Sequence[Part]) -> Sequence[Part]:
    """Let specular light take the place of own light where this is at most :data:`BLACK`.

    The second of two parts has depth 0 for rays without specular light.  Arrays that are contiguous
    change.
    """
    if len(parts) == 1:
        return parts
    (own, depth), (light, virtual) = ([np.ascontiguousarray(each) for each in p] for p in parts)
    colours, shown = own.reshape(-1, 3), light.reshape(-1, 3)
    there = np.flatnonzero(virtual)
    bare = there[np.maximum.reduce([colours[there, k] for k in range(3)]) <= BLACK]
    colours[bare] += shown[bare]
    depth.reshape(-1)[bare] = virtual.reshape(-1)[bare]
    if len(bare) == len(there):
        return [(own, depth)]
    shown[bare] = 0
    virtual.reshape(-1)[bare] = 0
    return [(own, depth), (light, virtual)]


def virtual_depth(depths: Sequence[np.ndarray]) -> np.ndarray:
    """The depth of images in mirrors, glass and coats, and of other rays' surfaces.

    ``depths`` has one part or two.
    """
    surface, *virtual = depths
    return np.where(virtual[0] > 0, virtual[0], surface) if virtual else surface


def one_part(parts: Sequence[Part]) -> Part:
    """All light in one part, for one slicing.

    Its depth is virtual where a surface has no light of its own, else the surface's.  Arrays change
    as in :func:`placed_parts`.
    """
    (light, depth), *rest = placed_parts(parts)
    for shown, _ in rest:
        light = light + shown
    return light, depth


class TwoPartSlicer:
    """Forms pictures from rays with one part or two; parameters are those of :class:`DepthSlicer`.

    The second part costs time for the rays that have it, and memory as soon as one ray has it.
    """

    def __init__(
        self, views: ViewSet, planes: Sequence[SensorPlane], pixels: int, *device: Any, **more: Any
    ):
        self._body = DepthSlicer(views, planes, pixels, *device, **more)
        self._made = views, planes, pixels, *device
        self._more = more
        self._specular: tuple[DepthSlicer, DepthSlicer] | None = None

    def add(
        self,
        part: slice | np.ndarray,
        parts: Sequence[Part],
        first_row: int = 0,
    ) -> None:
        """Add rows of some views, as :meth:`DepthSlicer.add` does, of one part or two.

        The second has depth 0 for rays without specular light; arrays change as in
        :func:`placed_parts`.
        """
        (own, depth), *rest = placed_parts(parts)
        self._body.add(part, own, depth, first_row)
        for light, virtual in rest:
            shown, images = self._specular_slicers()
            shown.add(part, light, np.where(virtual > 0, depth, np.float32(0)), first_row)
            images.add(part, light, virtual, first_row)

    def _specular_slicers(self) -> tuple[DepthSlicer, DepthSlicer]:
        """Slicers of the specular light by surfaces' depth, as the body's, and by virtual depth."""
        if self._specular is None:
            views, planes, *rest = self._made
            whole = [replace(plane, normalise="aperture") for plane in planes]
            more = self._more | {"bounds_px": (), "empty": np.nan}
            self._specular = (
                DepthSlicer(*self._made, **self._more), DepthSlicer(views, whole, *rest, **more)
            )  # fmt: skip
        return self._specular

    def pictures(self) -> np.ndarray:
        """As :meth:`DepthSlicer.pictures`."""
        if self._specular is None:
            return self._body.pictures()
        shown, images = self._specular
        return self._body.pictures(shown, images.pictures(vignetted=False))

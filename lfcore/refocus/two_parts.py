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

Part = tuple[np.ndarray, np.ndarray]
"""Light (K, rows, columns, 3) and depth (K, rows, columns), metres, float32."""


BLACK = 1e-3
"""The most own light, a share of white, that counts as none in a file: codecs add as much."""


def placed_parts(parts: Sequence[Part], black: float = 0.0) -> Sequence[Part]:
    """Let specular light take the place of own light where this is at most ``black``.

    The second of two parts has depth 0 for rays without specular light.
    """
    if len(parts) == 1:
        return parts
    (own, depth), (light, virtual) = parts
    there = np.flatnonzero(virtual)
    bare = there[own.reshape(-1, 3)[there].max(axis=1, initial=0) <= black]
    if len(bare):
        own, depth, light, virtual = (each.copy() for each in (own, depth, light, virtual))
        own.reshape(-1, 3)[bare] = light.reshape(-1, 3)[bare]
        depth.reshape(-1)[bare] = virtual.reshape(-1)[bare]
        light.reshape(-1, 3)[bare] = 0
        virtual.reshape(-1)[bare] = 0
    return [(own, depth), (light, virtual)] if len(bare) < len(there) else [(own, depth)]


def virtual_depth(depths: Sequence[np.ndarray]) -> np.ndarray:
    """The depth of images in mirrors, glass and coats, and of other rays' surfaces.

    ``depths`` has one part or two.
    """
    surface, *virtual = depths
    return np.where(virtual[0] > 0, virtual[0], surface) if virtual else surface


def one_part(parts: Sequence[Part], black: float = 0.0) -> Part:
    """All light in one part, for one slicing.

    Its depth is virtual where a surface has no light of its own, else the surface's.
    """
    (light, depth), *rest = placed_parts(parts, black)
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
        *,
        black: float = 0.0,
    ) -> None:
        """Add rows of some views, as :meth:`DepthSlicer.add` does, of one part or two.

        The second has depth 0 for rays without specular light; ``black`` is as for
        :func:`placed_parts`.
        """
        (own, depth), *rest = placed_parts(parts, black)
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
        return self._body.pictures(shown, images.pictures())

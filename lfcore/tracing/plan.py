"""The plan of a job: the elements that a block spans, and whether rays are traced one by one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.bundles import Bundles
from lfcore.tracing.packets import PacketShape
from lfcore.tracing.probes import OUTER, best_outer, leaves_a_ray, probed_elements

SINGLE_RAY_LEAVES = 2.5
"""Leaves in the way of a block, a ray, above which single rays are faster: measured."""


def _seen(bundles: Bundles) -> tuple:
    """Everything about the bundles that a decision depends on: equal bundles have equal plans."""
    grid = bundles.columns, bundles.rows, bundles.lattice, bundles.step.tobytes()
    return *grid, probed_elements(bundles).tobytes()


class Plan:
    """How the rays of one scene are cut into packets.

    Parameters
    ----------
    leaf_boxes : (L, 6) of the scene's hierarchy.
    closest_hit : what rays (R, 3) meet, of :meth:`Tracer.closest_hit`.
    outer, single_rays : answers given before they are asked for.

    Raises
    ------
    OpticsError : ``outer`` is none of :data:`OUTER`.
    """

    def __init__(
        self,
        leaf_boxes: np.ndarray,
        closest_hit: Callable,
        *,
        outer: int | None = None,
        single_rays: bool | None = None,
    ):
        if outer is not None and outer not in OUTER:
            raise OpticsError(f"must be one of {OUTER}, not {outer!r}", key="outer")
        self._leaf_boxes, self._closest_hit = leaf_boxes, closest_hit
        self._forced_outer, self._forced_single = outer, single_rays
        self._outer: dict[tuple, int] = {}
        self._single: dict[tuple, bool] = {}

    def shape(self, bundles: Bundles, sink: str, *, grouped: bool = True) -> PacketShape:
        """How these rays are cut into packets.

        Neighbouring elements may share blocks for ``sink`` HITS and FRAMES; ``grouped``: whether
        the elements' places are known, so that they can share packets.
        """
        outer = self.outer(bundles, sink) if grouped and sink != "IMAGE" else 1
        single = self.single_rays(bundles, outer)
        inner = max(bundles.columns, bundles.rows)
        shape = PacketShape.for_inner(inner, 1 if single else outer, single)
        return shape if grouped else replace(shape, group=1)

    def outer(self, bundles: Bundles, sink: str) -> int:
        """Elements along each axis that a block spans."""
        if self._forced_outer is not None:
            return self._forced_outer
        if bundles.lattice is None:
            return 1
        key = sink, *_seen(bundles)
        if key not in self._outer:
            self._outer[key] = best_outer(self._closest_hit, bundles, sink)
        return self._outer[key]

    def single_rays(self, bundles: Bundles, outer: int = 1) -> bool:
        """Whether blocks of these rays have so much in their way that single rays are faster.

        Never for elements of one ray: such rays come from anywhere, and none must change how
        its neighbours are traced.
        """
        if self._forced_single is not None:
            return self._forced_single
        if bundles.columns * bundles.rows == 1:
            return False
        key = outer, *_seen(bundles)
        if key not in self._single:
            leaves = leaves_a_ray(self._leaf_boxes, bundles, outer)
            self._single[key] = leaves > SINGLE_RAY_LEAVES
        return self._single[key]

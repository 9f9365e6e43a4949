"""Pictures that are formed while their rays are traced."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from lfcore.errors import OpticsError
from lfcore.evaluation.true_picture import Reference
from lfcore.evaluation.work_precision.points import (
    ON_THE_FLY,
    core_clock,
    point,
    refused_point,
    timed_point,
)
from lfcore.opencl.device import programs_made
from lfcore.optics.lattice import Lattice
from lfcore.optics.slab import Slab
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.quality import Quality, QualitySearch
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

NEAREST, BY_DEPTH = "nearest pixel", "by depth"
ONE_BY_ONE, TO_QUALITY = "by depth, each plane traced at its focus", "by depth, to a quality"


def nearest_rows(tracer: Tracer, reference: Reference, views: Sequence[int]) -> Iterator[dict]:
    """The thesis's recipe: N x N lens samples, all rays through the middle of their pixel."""
    for n in views:
        slab = Slab.of(tracer.scene.camera, n, reference.size)
        work = partial(trace_planes, tracer, slab, reference.planes)
        yield timed_point(
            reference, work, tracer.device, panel=ON_THE_FLY, method=NEAREST, setting=f"{n} x 1",
            rays=slab.rays,
        )  # fmt: skip


def by_depth_rows(
    tracer: Tracer, reference: Reference, lattices: Sequence[Lattice]
) -> Iterator[dict]:
    """Few rays, each spread by its depth: traced once for all planes, and once per plane."""
    camera, planes, pixels = tracer.scene.camera, reference.planes, reference.size

    def one_by_one(lattice: Lattice) -> np.ndarray:
        made = [pictures_by_depth(tracer, camera, [plane], pixels, lattice) for plane in planes]
        return np.concatenate(made)

    for lattice in lattices:
        together = partial(pictures_by_depth, tracer, camera, planes, pixels, lattice)
        alone = partial(one_by_one, lattice)
        for method, work, times in ((BY_DEPTH, together, 1), (ONE_BY_ONE, alone, len(planes))):
            yield timed_point(
                reference, work, tracer.device, panel=ON_THE_FLY, method=method,
                setting=str(lattice), rays=times * lattice.rays(pixels),
            )  # fmt: skip


def quality_rows(
    tracer: Tracer, reference: Reference, qualities_db: Sequence[float]
) -> Iterator[dict]:
    """As many rays as the wanted quality takes."""
    planes, pixels = reference.planes, reference.size
    for wanted in qualities_db:
        job = QualitySearch(tracer, tracer.scene.camera, planes, pixels, Quality(wanted))
        context = {"panel": ON_THE_FLY, "method": TO_QUALITY, "setting": f"{wanted:g} dB"}
        clock = core_clock(tracer.device)
        try:
            made, seconds = clocked_warm(job.pictures, programs_made, clock=clock)
        except OpticsError as error:
            yield refused_point(reference, error, **context)
            continue
        yield point(
            reference, made.pictures, rays=made.lattice.rays(pixels), seconds=seconds,
            expected_db=float(made.expected_db.min()), **context,
        )  # fmt: skip

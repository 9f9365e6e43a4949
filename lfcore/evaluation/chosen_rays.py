"""The choice of rays: qualities in dB, and the rays, seconds and bytes that they cost.

Each quality is recorded by :func:`lfcore.record`, which chooses the rays, and compared with
the thesis's recipe: one ray per pixel of each of N x N views.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

import lfcore
from lfcore.errors import OpticsError, SettingsError
from lfcore.evaluation.true_picture import Reference
from lfcore.evaluation.work_precision.points import point
from lfcore.evaluation.work_precision.study import BY_DEPTH, grid_row, recording_seconds
from lfcore.opencl.device import Device, programs_made
from lfcore.optics.slab import Lattice
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.quality import Quality
from lfcore.scene.model import Scene
from lfcore.timing import clocked_warm

COLUMNS = (
    "scene", "M", "method", "quality_db", "lattice", "rays_per_pixel", "rays", "seconds", "bytes",
    "read_seconds", "expected_db", "psnr_traced_db", "psnr_true_db", "worst_plane_m",
    "truth_known_db", "rays_share", "seconds_share", "size_share",
)  # fmt: skip
"""The columns; the last three are fractions of the scene's first row, the thesis's recipe."""
SHARES = {"rays_share": "rays", "seconds_share": "seconds", "size_share": "bytes"}
MOST_RAYS = 65536
"""The budget in rays per pixel: large, so that hard scenes take long instead of failing."""


def thesis_row(
    scene: str,
    reference: Reference,
    views: int,
    jobs: Sequence[Mapping],
    traced: np.ndarray,
    retrieved: np.ndarray,
) -> dict:
    """The row of the workflow's own light field of N = ``views``.

    ``jobs`` are the records of tracing, storing and retrieving it; ``traced`` and ``retrieved``
    (P, H, W, 3), linear light, are pictures formed on the fly, and from the file.
    """
    return _row(scene, reference, traced, grid_row(reference, views, retrieved, jobs))


def chosen_row(
    path: str | Path, scene: Scene, device: Device, reference: Reference, quality_db: float
) -> dict:
    """Record the rays for ``quality_db`` to the file ``path``; returns their row.

    Raises :class:`SettingsError` for a quality that needs more rays than the budget.
    """
    planes, size = reference.planes, reference.size
    focus = sorted(plane.focus_m for plane in planes)
    quality = Quality(quality_db, MOST_RAYS, (focus[0], focus[-1]))
    try:
        seconds = recording_seconds(scene, path, device, pixels=size, quality=quality)
    except OpticsError as error:
        if error.key != "quality_db":
            raise
        key = "workflow/reports.yaml: chosen_rays.qualities_db"
        problem = f"{scene.name}: {error.problem}"
        raise SettingsError(problem, key=key, remedy=error.remedy) from None
    with lfcore.LightField.open(path) as field:
        read_planes = partial(field.refocus_many, planes, device=device)
        retrieved, read_seconds = clocked_warm(read_planes, programs_made, clock=device.clock)
        slab, content = field.require_slab(), field.metadata.content
    lattice = Lattice(slab.views, slab.pixels / size.longer)
    tracer = open_tracer(scene, device)
    traced = pictures_by_depth(tracer, scene.camera, planes, size, lattice)
    measured = point(
        reference, retrieved, rays=slab.rays, method=BY_DEPTH, setting=str(lattice),
        expected_db=content["expected"]["db"], record_seconds=seconds, seconds=read_seconds,
        bytes=Path(path).stat().st_size,
    )  # fmt: skip
    return _row(scene.name, reference, traced, measured) | {"quality_db": quality_db}


def _row(scene: str, reference: Reference, traced: np.ndarray, measured: Mapping) -> dict:
    """The row of a point of error against run time, with the seconds of recording."""
    row = {**measured, "scene": scene, "M": reference.size.as_given, "lattice": measured["setting"]}
    row |= {"seconds": measured["record_seconds"], "read_seconds": measured["seconds"]}
    row["psnr_traced_db"] = min(reference.psnr(traced))
    return {name: row.get(name) for name in COLUMNS}


def chosen_rays_table(rows: Sequence[Mapping]) -> pd.DataFrame:
    """The table with columns :data:`COLUMNS` of rows that begin with the thesis's in each scene."""
    table = pd.DataFrame(rows, columns=list(COLUMNS))
    for name, column in SHARES.items():
        share = table[column] / table.groupby("scene", sort=False)[column].transform("first")
        table[name] = [float(f"{value:.3g}") for value in share]
    decibels = dict.fromkeys((name for name in COLUMNS if name.endswith("_db")), 1)
    return table.round(
        decibels | {"rays_per_pixel": 1, "seconds": 3, "read_seconds": 3, "worst_plane_m": 3}
    )

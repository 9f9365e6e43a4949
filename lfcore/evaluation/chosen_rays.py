"""Which rays to choose: a quality in dB, and the rays, seconds and bytes that it takes.

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
from lfcore.evaluation.work_precision.points import core_clock, point
from lfcore.opencl.device import Device, programs_made
from lfcore.optics.lattice import Lattice
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.prepared import hierarchy_of, open_tracer
from lfcore.rendering.quality import Quality
from lfcore.scene.model import Scene
from lfcore.timing import clocked_warm

COLUMNS = (
    "scene", "M", "method", "quality_db", "lattice", "rays_per_pixel", "rays", "seconds", "bytes",
    "read_seconds", "expected_db", "psnr_traced_db", "psnr_true_db", "worst_plane_m",
    "truth_known_db", "rays_share", "seconds_share", "size_share",
)  # fmt: skip
"""The last three are fractions of the scene's first row, the thesis's recipe."""
SHARES = {"rays_share": "rays", "seconds_share": "seconds", "size_share": "bytes"}
THESIS, CHOSEN = "nearest pixel", "by depth"
MOST_RAYS = 65536
"""The budget in rays per pixel: hard scenes take long instead of failing."""


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
    trace, store, retrieve = jobs
    return _row(
        scene, reference, traced, retrieved, method=THESIS, lattice=Lattice(views, 1.0),
        seconds=trace["seconds"] + store["encode_seconds"] + store["join_seconds"],
        bytes=store["video_bytes"], read_seconds=retrieve["seconds"] * retrieve["threads"],
    )  # fmt: skip


def chosen_row(
    path: str | Path, scene: Scene, device: Device, reference: Reference, quality_db: float
) -> dict:
    """Record the rays for ``quality_db`` to the file ``path``; returns their row.

    Raises :class:`SettingsError` for a quality that needs more rays than the budget.
    """
    clock, planes, size = core_clock(device), reference.planes, reference.size
    focus = sorted(plane.focus_m for plane in planes)
    quality = Quality(quality_db, MOST_RAYS, (focus[0], focus[-1]))
    hierarchy_of(scene)  # the clock counts rays and frames, not the tree

    def record() -> None:
        lfcore.record(
            scene, path, pixels=size, quality=quality, device=device,
        ).close()  # fmt: skip

    try:
        _, seconds = clocked_warm(record, programs_made, clock=clock)
    except OpticsError as error:
        if error.key != "quality_db":
            raise
        key = "configuration: analysis.chosen_rays.qualities_db"
        problem = f"{scene.name}: {error.problem}"
        raise SettingsError(problem, key=key, remedy=error.remedy) from None
    with lfcore.LightField.open(path) as field:
        read = partial(field.refocus_many, planes, device=device)
        retrieved, read_seconds = clocked_warm(read, programs_made, clock=clock)
        slab, content = field.require_slab(), field.metadata.content
    lattice = Lattice(slab.views, slab.pixels / size.longer)
    tracer = open_tracer(scene, device)
    traced = pictures_by_depth(tracer, scene.camera, planes, size, lattice)
    return _row(
        scene.name, reference, traced, retrieved, method=CHOSEN, lattice=lattice,
        quality_db=quality_db, expected_db=content["expected"]["db"], seconds=seconds,
        bytes=Path(path).stat().st_size, read_seconds=read_seconds,
    )  # fmt: skip


def _row(
    scene: str,
    reference: Reference,
    traced: np.ndarray,
    retrieved: np.ndarray,
    *,
    lattice: Lattice,
    **measured: object,
) -> dict:
    row = point(reference, retrieved, rays=lattice.rays(reference.size), scene=scene, **measured)
    row |= {"lattice": str(lattice), "rays_per_pixel": lattice.rays_per_pixel}
    row |= {"M": reference.size.as_given, "psnr_traced_db": min(reference.psnr(traced))}
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

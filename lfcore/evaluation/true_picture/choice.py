"""What we would do in the thesis's place: few rays of known depth, beside its largest N."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from lfcore.errors import LfcoreError
from lfcore.evaluation.true_picture.points import BY_DEPTH, NEAREST, worst_planes
from lfcore.evaluation.true_picture.reference import Reference
from lfcore.opencl.device import programs_made
from lfcore.optics.lattice import Lattice
from lfcore.refocus.stored_depth import slice_stored
from lfcore.rendering.record_depth import depth_store, record_by_depth
from lfcore.storage.defaults import chosen_encoding
from lfcore.storage.lightfield import LightFieldFile
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

TARGET_DB = 45.0
"""True PSNR of the worst plane: what the default encoder is chosen for, too."""
COLUMNS = (
    "scene", "M", "method", "lattice", "rays", "seconds", "bytes", "read_seconds", "psnr_true_db",
    "rays_share", "seconds_share", "size_share",
)  # fmt: skip
"""The last three are shares of the scene's first row, the thesis's recipe."""


def recommended(rows: pd.DataFrame, target_db: float = TARGET_DB) -> Lattice:
    """The lattice of fewest rays whose worst plane reaches ``target_db``; if none, the truest.

    ``rows`` have the columns of :mod:`lfcore.evaluation.true_picture.points`; those through the
    widest aperture count.  Raises :class:`LfcoreError` where nothing was sliced by depth.
    """
    widest = rows[np.isclose(rows.f_number.astype(float), rows.f_number.min())]
    worst = worst_planes(widest[widest.method == BY_DEPTH])
    if worst.empty:
        raise LfcoreError("no lattice was sliced by depth, so none can be recommended")
    enough = worst[worst.psnr_true_db >= target_db]
    best = worst.loc[worst.psnr_true_db.idxmax() if enough.empty else enough.rays.idxmin()]
    views, subpixels = best.lattice.split(" x ")
    return Lattice(int(views), float(subpixels))


def thesis_recipe(
    scene: str, reference: Reference, views: int, jobs: Sequence[dict], pictures: np.ndarray
) -> dict:
    """The row of the workflow's own light field of N = ``views``, without the shares.

    ``jobs`` are the records of tracing, storing and retrieving it; ``pictures`` (P, M, M, 3), what
    was retrieved, are held against ``reference``.
    """
    traced, stored, retrieved = jobs
    return _row(
        scene, reference, pictures, method=NEAREST, lattice=f"{views} x 1", rays=traced["rays"],
        seconds=traced["seconds"] + stored["encode_seconds"] + stored["join_seconds"],
        bytes=stored["video_bytes"], read_seconds=retrieved["seconds"],
    )  # fmt: skip


def our_choice(path: str | Path, tracer: Tracer, reference: Reference, count: Lattice) -> dict:
    """The row of ``count``, recorded with depth to the file ``path``, without the shares.

    ``seconds`` trace and store it with one thread, ``read_seconds`` form all planes of it.
    """
    spec = chosen_encoding(count.views, by_depth=True)
    slab, store = depth_store(tracer.scene.camera, count, reference.pixels, spec)
    record = partial(record_by_depth, path, tracer, slab, store)
    _, seconds = clocked_warm(record, programs_made)
    with LightFieldFile.open(path) as field:
        read = partial(slice_stored, field, reference.planes, device=tracer.device)
        pictures, read_seconds = clocked_warm(read, programs_made)
    return _row(
        tracer.scene.name, reference, pictures, method=BY_DEPTH, lattice=str(count),
        rays=slab.rays, seconds=seconds, bytes=Path(path).stat().st_size,
        read_seconds=read_seconds,
    )  # fmt: skip


def _row(scene: str, reference: Reference, pictures: np.ndarray, **measured: object) -> dict:
    worst = min(reference.psnr(pictures))
    return {"scene": scene, "M": reference.pixels, **measured, "psnr_true_db": worst}


def compared(rows: Sequence[dict]) -> pd.DataFrame:
    """Columns :data:`COLUMNS`: each row beside the first of its scene."""
    table = pd.DataFrame(rows)
    for name, of in (("rays", "rays"), ("seconds", "seconds"), ("size", "bytes")):
        share = table[of] / table.groupby("scene", sort=False)[of].transform("first")
        table[f"{name}_share"] = share.map(lambda share: float(f"{share:.3g}"))
    table = table.round({"seconds": 3, "read_seconds": 3, "psnr_true_db": 1})
    return table[list(COLUMNS)]

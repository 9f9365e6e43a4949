"""What we would do in the thesis's place: few rays of known depth, beside its largest N."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from lfcore.errors import LfcoreError
from lfcore.evaluation.timing import clocked_warm
from lfcore.evaluation.true_picture.points import BY_DEPTH, NEAREST, worst_planes
from lfcore.evaluation.true_picture.reference import Reference, inner_psnr
from lfcore.opencl.device import programs_made
from lfcore.refocus.stored_depth import slice_stored
from lfcore.rendering.by_depth import RayCount
from lfcore.rendering.record_depth import depth_store, record_by_depth
from lfcore.storage.defaults import codec_spec
from lfcore.storage.lightfield import LightFieldFile
from lfcore.tracing.tracer import Tracer

TARGET_DB = 45.0
"""True PSNR of the worst plane: what the default encoder is chosen for, too."""
COLUMNS = (
    "scene", "M", "method", "lattice", "rays", "seconds", "bytes", "read_seconds", "psnr_true_db",
    "rays_share", "seconds_share", "size_share",
)  # fmt: skip
"""The last three are shares of the scene's first row, the thesis's recipe."""


@dataclass(frozen=True)
class Made:
    """A stored light field as it was measured: ``seconds`` trace and store it with one thread,
    ``read_seconds`` form all planes of it; ``pictures`` (P, M, M, 3) are those planes."""

    method: str
    lattice: str
    rays: int
    seconds: float
    bytes: int
    read_seconds: float
    pictures: np.ndarray

    def row(self, scene: str, reference: Reference) -> dict:
        """Without the shares."""
        pairs = zip(self.pictures, reference.pictures, strict=True)
        own = ("method", "lattice", "rays", "seconds", "bytes", "read_seconds")
        return (
            {"scene": scene, "M": reference.pictures.shape[1]}
            | {name: getattr(self, name) for name in own}
            | {"psnr_true_db": min(inner_psnr(*pair) for pair in pairs)}
        )


def recommended(rows: pd.DataFrame, target_db: float = TARGET_DB) -> RayCount:
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
    return RayCount(int(views), float(subpixels))


def thesis_recipe(
    views: int, traced: dict, stored: dict, retrieved: dict, pictures: np.ndarray
) -> Made:
    """The workflow's own light field of N = ``views``, of the records of its jobs."""
    seconds = traced["seconds"] + stored["encode_seconds"] + stored["join_seconds"]
    return Made(
        NEAREST, f"{views} x 1", traced["rays"], seconds, stored["video_bytes"],
        retrieved["seconds"], pictures,
    )  # fmt: skip


def our_choice(path: str | Path, tracer: Tracer, reference: Reference, count: RayCount) -> Made:
    """Record ``count`` with depth to the file ``path``, and form the planes of ``reference``."""
    pixels = reference.pictures.shape[1]
    spec = codec_spec(count.views, by_depth=True)
    slab, store = depth_store(tracer.scene.camera, count, pixels, spec)
    _, seconds = clocked_warm(lambda: record_by_depth(path, tracer, slab, store), programs_made)
    with LightFieldFile.open(path) as field:
        pictures, read = clocked_warm(
            lambda: slice_stored(field, reference.planes, device=tracer.device), programs_made
        )
    return Made(
        BY_DEPTH, str(count), slab.rays, seconds, Path(path).stat().st_size, read, pictures
    )  # fmt: skip


def compared(rows: Sequence[dict]) -> pd.DataFrame:
    """Columns :data:`COLUMNS`: rows of :meth:`Made.row`, each beside the first of its scene."""
    table = pd.DataFrame(rows)
    for name, of in (("rays", "rays"), ("seconds", "seconds"), ("size", "bytes")):
        share = table[of] / table.groupby("scene", sort=False)[of].transform("first")
        table[f"{name}_share"] = share.map(lambda share: float(f"{share:.3g}"))
    table = table.round({"seconds": 3, "read_seconds": 3, "psnr_true_db": 1})
    return table[list(COLUMNS)]

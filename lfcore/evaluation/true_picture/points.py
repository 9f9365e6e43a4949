"""Rows of the table of true errors: methods and lattices, their seconds and their PSNR."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np
import pandas as pd

from lfcore.evaluation.true_picture.reference import BELOW_DB, Reference
from lfcore.opencl.device import programs_made
from lfcore.optics.lattice import Lattice
from lfcore.optics.slab import Slab
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.quality import Quality, QualitySearch
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

COLUMNS = (
    "scene", "f_number", "plane_m", "pictures", "method", "lattice", "rays_per_pixel", "rays",
    "seconds", "bytes", "psnr_true_db", "expected_db", "truth_known_db", "note",
)  # fmt: skip
NEAREST, BY_DEPTH, TO_QUALITY = "nearest pixel", "by depth", "to a quality"

TOO_GOOD = f"not judged: within {BELOW_DB:g} dB of what is known of the truth"


def rounded(rows: pd.DataFrame) -> pd.DataFrame:
    """``rows`` as they are published."""
    decibels = dict.fromkeys(("psnr_true_db", "expected_db", "truth_known_db"), 1)
    rows = rows.astype({"pictures": "Int64", "rays": "Int64"})  # none where nothing was traced
    return rows.round({**decibels, "seconds": 3, "rays_per_pixel": 1, "f_number": 2, "plane_m": 3})


def worst_planes(rows: pd.DataFrame) -> pd.DataFrame:
    """One row a scene, aperture, method and lattice: that of the plane with the lowest PSNR, of
    pictures of all planes.  Other renderers' have what is expected of every plane."""
    keys = ["scene", "f_number", "method", "lattice"]
    rows = rows[rows.seconds.notna()].reset_index(drop=True)
    rows = rows[rows.pictures == rows.groupby("scene").pictures.transform("max")]
    shown = rows.assign(psnr_true_db=rows.psnr_true_db.fillna(rows.expected_db))
    return shown.loc[shown.groupby(keys, sort=False).psnr_true_db.idxmin()]


def plane_rows(
    reference: Reference,
    pictures: np.ndarray,
    *,
    rays: int,
    expected_db: Sequence[float | None] | None = None,
    **context: object,
) -> Iterator[dict]:
    """A row with :data:`COLUMNS` of each of ``pictures`` (P, M, M, 3), linear light.

    ``rays`` and ``context``, the other columns, are those of all rows: seconds are of all pictures
    together.
    """
    shared = context | {
        "pictures": len(pictures), "rays": rays, "rays_per_pixel": rays / reference.pixels**2,
    }  # fmt: skip
    for plane, psnr, known, expected in zip(
        reference.planes,
        reference.psnr(pictures),
        reference.known_db.tolist(),
        expected_db or [None] * len(pictures),
        strict=True,
    ):
        yield {
            **dict.fromkeys(COLUMNS),
            **shared,
            "f_number": plane.f_number,
            "plane_m": plane.focus_m,
            "psnr_true_db": psnr,
            "expected_db": expected,
            "truth_known_db": known,
            "note": TOO_GOOD if psnr > known - BELOW_DB else None,
        }


def method_rows(
    tracer: Tracer,
    references: Sequence[Reference],
    counts: Sequence[Lattice],
    nearest_views: Sequence[int],
    targets_db: Sequence[float] = (),
    one_picture_db: Sequence[float] = (),
) -> Iterator[dict]:
    """Rows of every method at every lattice, timed for all planes of a reference together.

    Parameters
    ----------
    references : one an aperture.
    counts : lattices of slicing by depth.
    nearest_views : N of the thesis's recipe, whose rays pass the middle of a pixel.
    targets_db : qualities that are asked for, whose rays are chosen by their disagreement.
    one_picture_db : those of them that are asked for the worst plane alone, too.
    """
    scene, camera = tracer.scene.name, tracer.scene.camera
    for reference in references:
        planes, pixels = reference.planes, reference.pixels
        for count in counts:
            work = partial(pictures_by_depth, tracer, camera, planes, pixels, count)
            pictures, seconds = clocked_warm(work, programs_made)
            rays = count.rays(pixels)
            yield from plane_rows(
                reference, pictures, scene=scene, method=BY_DEPTH, lattice=str(count), rays=rays,
                seconds=seconds, bytes=16 * rays,
            )  # fmt: skip
        for target in targets_db:
            rows = list(_to_quality(tracer, reference, target))
            yield from rows
            if target in one_picture_db:
                worst = int(np.argmin([row["psnr_true_db"] for row in rows]))
                yield from _to_quality(tracer, reference.of_plane(worst), target)
        for views in nearest_views:
            slab = Slab(camera, views, pixels)
            work = partial(trace_planes, tracer, slab, planes)
            pictures, seconds = clocked_warm(work, programs_made)
            yield from plane_rows(
                reference, pictures, scene=scene, method=NEAREST, lattice=f"{views} x 1",
                rays=slab.rays, seconds=seconds,
            )  # fmt: skip


def _to_quality(tracer: Tracer, reference: Reference, target: float) -> Iterator[dict]:
    """Rows of pictures that were asked for ``target`` dB."""
    scene, pixels = tracer.scene, reference.pixels
    wanted = QualitySearch(tracer, scene.camera, reference.planes, pixels, Quality(target))
    made, seconds = clocked_warm(wanted.pictures, programs_made)
    rays = [count.rays(pixels) for count in made.lattices]
    yield from plane_rows(
        reference, made.pictures, expected_db=made.expected_db.tolist(), scene=scene.name,
        method=TO_QUALITY, lattice=f"{target:g} dB", rays=sum(rays), seconds=seconds,
        bytes=16 * max(rays),
    )  # fmt: skip

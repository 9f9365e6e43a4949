"""Rows of the table of true errors: methods and lattices, their seconds and their PSNR."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np
import pandas as pd

from lfcore.evaluation.timing import clocked_warm
from lfcore.evaluation.true_picture.reference import BELOW_DB, Reference, inner_psnr
from lfcore.opencl.device import programs_made
from lfcore.optics.slab import Slab
from lfcore.rendering.by_depth import RayCount, pictures_by_depth
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.quality import WantedQuality
from lfcore.tracing.tracer import Tracer

COLUMNS = (
    "scene", "f_number", "plane_m", "pictures", "method", "lattice", "rays_per_pixel", "rays",
    "seconds", "bytes", "psnr_true_db", "expected_db", "truth_known_db", "note",
)  # fmt: skip
NEAREST, BY_DEPTH, TO_QUALITY = "nearest pixel", "by depth", "to a quality"

TOO_GOOD = f"not judged: within {BELOW_DB:g} dB of what is known of the truth"

Made = TypeVar("Made")


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
    expected_db: Sequence[float] | None = None,
    **context: object,
) -> Iterator[dict]:
    """A row with :data:`COLUMNS` of each of ``pictures`` (P, M, M, 3), linear light.

    ``context`` are the columns that all rows share; seconds are of all pictures together.
    """
    expected = [None] * len(pictures) if expected_db is None else list(expected_db)
    for plane, picture, truth, known, said in zip(
        reference.planes, pictures, reference.pictures, reference.known_db, expected, strict=True
    ):
        psnr = inner_psnr(picture, truth)
        yield (
            dict.fromkeys(COLUMNS)
            | {"pictures": len(pictures)}
            | context
            | {
                "f_number": plane.f_number,
                "plane_m": plane.focus_distance_m,
                "psnr_true_db": psnr,
                "expected_db": said,
                "truth_known_db": float(known),
                "note": TOO_GOOD if psnr > known - BELOW_DB else None,
            }
        )


def method_rows(
    tracer: Tracer,
    references: Sequence[Reference],
    counts: Sequence[RayCount],
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
    for reference in references:
        for count in counts:
            pictures, seconds = _by_depth(tracer, reference, count)
            rays = count.rays(reference.pictures.shape[1])
            yield from plane_rows(
                reference, pictures, scene=tracer.scene.name,
                method=BY_DEPTH, lattice=str(count), rays=rays, seconds=seconds,
                rays_per_pixel=rays / reference.pictures.shape[1] ** 2, bytes=16 * rays,
            )  # fmt: skip
        for target in targets_db:
            rows = list(_to_quality(tracer, reference, target))
            yield from rows
            if target in one_picture_db:
                worst = int(np.argmin([row["psnr_true_db"] for row in rows]))
                yield from _to_quality(tracer, reference.of_plane(worst), target)
        for views in nearest_views:
            slab = Slab(tracer.scene.camera, views, reference.pictures.shape[1])
            pictures, seconds = _nearest(tracer, reference, slab)
            yield from plane_rows(
                reference, pictures, scene=tracer.scene.name, method=NEAREST,
                lattice=f"{views} x 1", rays=slab.rays, rays_per_pixel=views**2, seconds=seconds,
            )  # fmt: skip


def _by_depth(tracer: Tracer, reference: Reference, count: RayCount) -> tuple[np.ndarray, float]:
    camera, pixels = tracer.scene.camera, reference.pictures.shape[1]
    return _timed(
        tracer, lambda: pictures_by_depth(tracer, camera, reference.planes, pixels, count)
    )


def _to_quality(tracer: Tracer, reference: Reference, target: float) -> Iterator[dict]:
    """Rows of pictures that were asked for ``target`` dB."""
    camera, pixels = tracer.scene.camera, reference.pictures.shape[1]
    wanted = WantedQuality(tracer, camera, reference.planes, pixels, target)
    made, seconds = _timed(tracer, wanted.pictures)
    rays = sum(count.rays(pixels) for count in made.counts)
    expected = [float(each) for each in made.expected_db]
    yield from plane_rows(
        reference, made.pictures, expected_db=expected, scene=tracer.scene.name, rays=rays,
        method=TO_QUALITY, lattice=f"{target:g} dB", rays_per_pixel=rays / pixels**2,
        seconds=seconds, bytes=16 * max(count.rays(pixels) for count in made.counts),
    )  # fmt: skip


def _nearest(tracer: Tracer, reference: Reference, slab: Slab) -> tuple[np.ndarray, float]:
    return _timed(tracer, lambda: trace_planes(tracer, slab, reference.planes))


def _timed(tracer: Tracer, work: Callable[[], Made]) -> tuple[Made, float]:
    """What ``work`` makes, and its seconds when programs are built."""

    def finished() -> Made:
        made = work()
        tracer.device.queue.finish()
        return made

    return clocked_warm(finished, programs_made)

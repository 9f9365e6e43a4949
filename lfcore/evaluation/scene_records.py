"""Rows of the thesis's tables for one scene: quality, seconds, sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.evaluation.metrics import picture_quality
from lfcore.evaluation.tables import TableError, sizes
from lfcore.evaluation.true_picture.reference import Reference, inner_psnr, load_reference
from lfcore.files import read_json
from lfcore.optics.plane_pictures import load_stack


@dataclass(frozen=True)
class Resolution:
    """What was made at one N: pictures (.npz) and measurements (.json); none where not stored."""

    views: int
    on_the_fly: str | Path
    trace: str | Path
    from_video: str | Path | None = None
    store: str | Path | None = None
    retrieve: str | Path | None = None


def scene_records(
    scene: str, pixels: int, files: Sequence[Resolution], truth: str | Path
) -> dict[str, list[dict]]:
    """Rows of tables 7.1, 7.2 and 7.3.

    The last of ``files`` is the thesis's own reference of table 7.1; ``truth`` is a file of true
    pictures of the same planes.  Raises :class:`TableError` where its planes are others.
    """
    rows: dict[str, list[dict]] = {"table_7_1": [], "table_7_2": [], "table_7_3": []}
    best, true = load_stack(files[-1].on_the_fly)[0], load_reference(truth)
    for one in files:
        traced, pictures = read_json(one.trace), load_stack(one.on_the_fly)[0]
        context = {"scene": scene, "N": one.views, "M": pixels}
        context |= {key: traced[key] for key in ("triangles", "device", "threads")}
        rows["table_7_1"].append(
            context
            | {"seconds": traced["seconds"], "psnr_true_db": _true_quality(one.on_the_fly, true)}
            | picture_quality(pictures, best)
        )
        if one.from_video is None or one.store is None or one.retrieve is None:
            continue
        stored, retrieved = read_json(one.store), read_json(one.retrieve)
        seconds = {"seconds": stored["encode_seconds"] + stored["join_seconds"]}
        size = sizes(rays=traced["rays"], video_bytes=stored["video_bytes"])
        context |= {key: stored[key] for key in ("device", "threads")}
        rows["table_7_2"].append(context | seconds | size)
        context |= {key: retrieved[key] for key in ("device", "threads", "seconds")}
        context["psnr_true_db"] = _true_quality(one.from_video, true)
        found = picture_quality(load_stack(one.from_video)[0], pictures)
        rows["table_7_3"].append(context | found)
    # JSON knows no infinity: the quality of a picture against itself is null here.
    for row in rows["table_7_1"]:
        row["psnr_db"] = row["psnr_db"] if np.isfinite(row["psnr_db"]) else None
    return rows


def _true_quality(stack_file: str | Path, true: Reference) -> float:
    """Average over the planes of PSNR in dB against the true pictures."""
    pictures, planes = load_stack(stack_file)
    if planes != true.planes:
        raise TableError(
            "shows other planes than the true pictures", file=stack_file, remedy="Make both again"
        )
    return float(np.mean([inner_psnr(*pair) for pair in zip(pictures, true.pictures, strict=True)]))

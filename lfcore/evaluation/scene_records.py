"""Rows of the thesis's tables for one scene: quality, seconds, sizes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.evaluation.metrics import picture_quality
from lfcore.evaluation.tables import TableError, sizes
from lfcore.evaluation.true_picture import Reference, load_reference
from lfcore.files import read_json
from lfcore.optics.plane_pictures import load_stack


@dataclass(frozen=True)
class Resolution:
    """The files of one N: pictures (.npz), measurements (.json); None where nothing is stored."""

    views: int
    on_the_fly: str | Path
    trace: str | Path
    from_video: str | Path | None = None
    store: str | Path | None = None
    retrieve: str | Path | None = None


def scene_records(
    scene: str, pixels: int | str, files: Sequence[Resolution], truth: str | Path
) -> dict[str, list[dict]]:
    """Rows of tables 7.1, 7.2 and 7.3.

    The last of ``files`` is the thesis's own reference of table 7.1; ``truth`` is a file of true
    pictures of the same planes.  Raises :class:`TableError` where its planes are others.
    """
    rows: dict[str, list[dict]] = {"table_7_1": [], "table_7_2": [], "table_7_3": []}
    best, true = load_stack(files[-1].on_the_fly)[0], load_reference(truth)
    for one in files:
        traced, pictures = read_json(one.trace), load_stack(one.on_the_fly)[0]
        context = {"scene": scene, "N": one.views, "M": pixels, "triangles": traced["triangles"]}
        made = context | {key: traced[key] for key in ("device", "threads", "seconds")}
        rows["table_7_1"].append(made | _quality(one.on_the_fly, best, true))
        if one.from_video is None or one.store is None or one.retrieve is None:
            continue
        stored, retrieved = read_json(one.store), read_json(one.retrieve)
        made = context | {key: stored[key] for key in ("device", "threads")}
        made["seconds"] = stored["encode_seconds"] + stored["join_seconds"]
        size = sizes(rays=traced["rays"], video_bytes=stored["video_bytes"])
        rows["table_7_2"].append(made | size)
        made = context | {key: retrieved[key] for key in ("device", "threads", "seconds")}
        rows["table_7_3"].append(made | _quality(one.from_video, pictures, true))
    return rows


def _quality(stack_file: str | Path, reference: np.ndarray, true: Reference) -> dict:
    """Quality of pictures against others, and in dB against the true ones, averaged over planes.

    JSON knows no infinity: the quality of a picture against itself is null.
    """
    pictures, planes = load_stack(stack_file)
    if planes != true.planes:
        raise TableError(
            "shows other planes than the true pictures", file=stack_file, remedy="Make both again"
        )
    true_db = np.mean(true.psnr(pictures))
    found: dict = picture_quality(pictures, reference)
    found["psnr_db"] = found["psnr_db"] if np.isfinite(found["psnr_db"]) else None
    return found | {"psnr_true_db": float(true_db)}

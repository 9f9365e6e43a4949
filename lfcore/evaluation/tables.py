"""Tables 7.1, 7.2 and 7.3 of the thesis, each row beside the thesis's own values.

Each row is a record, a dictionary with the measured columns.  The thesis's values are joined by
scene and N; other scenes have empty cells.
"""

import functools
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lfcore.evaluation.metrics import picture_quality
from lfcore.evaluation.table_files import table_of
from lfcore.evaluation.true_picture import Reference, load_reference
from lfcore.files import read_json
from lfcore.optics.plane_pictures import load_stack

THESIS_FILE = Path(__file__).with_name("thesis_tables.csv")
MIB = 2**20
KEY = ("scene", "N")
CONTEXT = ("triangles", "M", "device", "threads")
# Decimals in CSV: the precision of the measurement.
DECIMALS = {
    "seconds": 3, "psnr_db": 3, "psnr_true_db": 2, "ssim": 5, "ratio_float32": 2, "ratio_uint8": 2,
}  # fmt: skip


QUALITY = ("seconds", "psnr_db", "psnr_true_db", "ssim")
SIZES = (
    "raw_bytes_float32", "raw_bytes_uint8", "video_bytes", "ratio_float32", "ratio_uint8",
)  # fmt: skip
MEASURED = {"table_7_1": QUALITY, "table_7_2": ("seconds", *SIZES), "table_7_3": QUALITY}
"""Angular resolution on the fly, encoding, and retrieval from the stored light field."""
OF_THESIS = {
    "table_7_1": {f"thesis_{name}": f"quality_{name}" for name in ("seconds", "psnr_db", "ssim")},
    "table_7_2": {
        "thesis_seconds": "encode_seconds",
        "thesis_raw_bytes_float32": "raw_bytes_float32",
        "thesis_video_bytes": "video_bytes",
        "thesis_ratio_float32": "compression_ratio",
        "thesis_ratio_uint8": "ratio_uint8",
    },
    "table_7_3": {f"thesis_{name}": f"decode_{name}" for name in ("seconds", "psnr_db", "ssim")},
}
"""The thesis's columns: the name in the table, and in :func:`thesis_figures`."""


@functools.cache
def thesis_figures() -> pd.DataFrame:
    """The thesis's tables 7.1 to 7.3, indexed by (scene, N); M = 512 on a GTX 1080 Ti.

    Its sizes are in MiB of float32 RGB (12 bytes per ray); ``ratio_uint8`` is its compression
    ratio against the 3 bytes of 8-bit RGB.
    """
    figures = pd.read_csv(THESIS_FILE).rename(columns={"angular_resolution": "N"})
    figures["raw_bytes_float32"] = figures.raw_mib_float32_rgb * MIB
    figures["video_bytes"] = (figures.video_mb * MIB).round().astype("int64")
    figures["ratio_uint8"] = figures.compression_ratio / 4
    return figures.set_index(list(KEY))


def make_table(name: str, records: Iterable[Mapping]) -> pd.DataFrame:
    """The table ``name`` (a key of :data:`MEASURED`) of its records, as :func:`scene_records`
    makes them, in their order.

    Raises :class:`TableError` when a record lacks a column or has one too many.
    """
    rows = [row for row in records if row["table"] == name]
    table = table_of(rows, ("table", *KEY, *MEASURED[name], *CONTEXT), DECIMALS)
    table = table.drop(columns="table")
    beside = OF_THESIS[name]
    figures = thesis_figures()[list(beside.values())].set_axis(list(beside), axis=1)
    return table.join(figures, on=list(KEY))


def sizes(*, rays: int, video_bytes: int) -> dict[str, float]:
    """Raw sizes and compression ratios in both conventions: 12 and 3 bytes per ray.

    The thesis's "expected size" counts float32 RGB; its chapter 5 counts 8-bit RGB.
    """
    values = 12 * rays, 3 * rays, video_bytes, 12 * rays / video_bytes, 3 * rays / video_bytes
    return dict(zip(SIZES, values, strict=True))


def scene_records(
    scene: str, pixels: int | str, files: Mapping[int, Sequence[str | Path]], truth: str | Path
) -> list[dict]:
    """Rows of tables 7.1, 7.2 and 7.3, each with the name of its ``table``.

    ``files`` are, by N: pictures formed on the fly (.npz), measurements of tracing (.json) and,
    if the light field is stored, pictures from the video, measurements of storing and of
    retrieving.  The last N is the thesis's own reference of table 7.1; ``truth`` is a file of true
    pictures of the same planes.
    """
    rows, true = [], load_reference(truth)
    best, _ = load_stack([*files.values()][-1][0])
    for views, (on_the_fly, trace, *of_video) in files.items():
        traced, pictures = read_json(trace), load_stack(on_the_fly)[0]
        context = {"scene": scene, "N": views, "M": pixels, "triangles": traced["triangles"]}
        facts = context | {key: traced[key] for key in ("device", "threads", "seconds")}
        rows.append({"table": "table_7_1"} | facts | _quality(on_the_fly, best, true))
        if not of_video:
            continue
        from_video, *records = of_video
        stored, retrieved = map(read_json, records)
        facts = context | {key: stored[key] for key in ("device", "threads")}
        facts["seconds"] = stored["encode_seconds"] + stored["join_seconds"]
        size = sizes(rays=traced["rays"], video_bytes=stored["video_bytes"])
        rows.append({"table": "table_7_2"} | facts | size)
        facts = context | {key: retrieved[key] for key in ("device", "threads", "seconds")}
        rows.append({"table": "table_7_3"} | facts | _quality(from_video, pictures, true))
    return rows


def _quality(stack_file: str | Path, reference: np.ndarray, true: Reference) -> dict:
    """Quality of pictures against others, and in dB against the true ones, averaged over planes."""
    pictures, _ = load_stack(stack_file)
    true_db = float(np.mean(true.psnr(pictures)))
    return {**picture_quality(pictures, reference), "psnr_true_db": true_db}

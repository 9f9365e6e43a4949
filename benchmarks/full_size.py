"""The thesis's tables at their full size, as they are published: docs/results/.

    python -m benchmarks.publish --take full --command "snakemake ..." results

All of it is read from the results of one run; what the run did not make is not published.
"""

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np
import pandas as pd
import yaml
from matplotlib.figure import Figure
from PIL import Image

from benchmarks.results import ROOT, PublishError, head, markdown, source, wrapped, write_result
from lfcore.colour import srgb_codes
from lfcore.evaluation.figures import (
    QUALITY,
    SIZE,
    THESIS_PIXELS,
    Panel,
    curves_over_n,
    save_figure,
)
from lfcore.evaluation.table_files import human_bytes
from lfcore.files import make_folder, whole_file, write_text
from lfcore.optics.plane_pictures import load_stack

FOLDER = ROOT / "docs" / "results"
THESIS = {
    "table_7_1": "Table 7.1: angular resolution",
    "table_7_2": "Table 7.2: encoding",
    "table_7_3": "Table 7.3: retrieval",
}
SETTINGS = "settings.yaml"
FIGURE = "against_thesis.png"
JPEG_QUALITY = 92
"""Of JPEG, chroma whole: the pictures are to be looked at, not measured."""
COMPARED = {
    # columns of a table, and whether more is better
    "table_7_1": {"seconds": False, "psnr_db": True, "ssim": True},
    "table_7_2": {"seconds": False, "video_bytes": False, "ratio_float32": True},
    "table_7_3": {"seconds": False, "psnr_db": True, "ssim": True},
}
LABELS = {
    "seconds": "s", "psnr_db": "PSNR dB", "psnr_true_db": "true PSNR dB", "ssim": "SSIM",
    "video_bytes": "size", "ratio_float32": "ratio",
}  # fmt: skip
CHOICE = {
    "scene": "scene", "method": "method", "lattice": "lattice", "rays": "rays", "seconds": "s",
    "bytes": "bytes", "psnr_true_db": "true PSNR dB",
}  # fmt: skip
"""The published columns of the table on chosen rays, and their names."""
SHOWN = (16, 512)
"""The N whose rows are on the page; the CSV files have all."""
DIGITS = {"seconds": 1, "psnr_db": 1, "psnr_true_db": 1, "ssim": 4, "ratio_float32": 0}


Tables = dict[str, pd.DataFrame]
"""The three tables of a run by name, and the rays to choose where they are there."""


def hours(tables: Tables, cores: int, *, thesis: bool = False) -> float:
    """Of all cells: what they took of one thread, shared by ``cores``, and retrieval; the thesis's
    as it gives them."""
    column = "thesis_seconds" if thesis else "seconds"
    traced, stored, retrieved = (float(tables[name][column].sum()) for name in THESIS)
    shared = traced + stored
    return ((shared if thesis else shared / cores) + retrieved) / 3600


def compared(tables: Tables) -> Iterator[tuple[str, bool]]:
    """Cells that the thesis has, too, in words; whether ours is better."""
    stored = tables["table_7_2"]
    smaller = (stored.thesis_video_bytes / stored.video_bytes).tolist()
    for name, columns in COMPARED.items():
        for place, row in enumerate(tables[name].to_dict("records")):
            for column, more in columns.items():
                ours, theirs = row[column], row[f"thesis_{column}"]
                # What others are held against, the largest N, cannot be bettered.
                if pd.isna(theirs) or math.isinf(theirs) or (column == "ssim" and theirs == 1):
                    continue
                better = ours > theirs if more else ours < theirs
                words = f"{shown(column, ours)} ({shown(column, theirs)})"
                table = THESIS[name].partition(":")[0]
                cell = f"{table}, {row['scene']}, N = {row['N']}, {LABELS[column]}"
                reason = f"Our file is {smaller[place]:.1f} times smaller."
                if column == "seconds":
                    reason = "Seconds are of one core."
                yield f"{cell}: {words}. {reason}", better


def shown(column: str, value: float) -> str:
    """A number as it stands in the manual."""
    if pd.isna(value):
        return ""
    if column == "video_bytes":
        return human_bytes(value)
    return "inf" if math.isinf(value) else f"{value:.{DIGITS[column]}f}"


def read_run(results: Path) -> Tables:
    """What a run left in its folder ``results``.

    Raises :class:`PublishError` for a table, a cell or a picture that is not there.
    """
    made = {}
    for name in THESIS:
        file = results / "tables" / f"{name}.csv"
        if not file.is_file():
            raise PublishError(
                "is not there", file=file, remedy="Let the run end: make results/tables/ first"
            )
        made[name] = pd.read_csv(file)
    choice = results / "tables" / "chosen_rays.csv"
    return made | {"chosen_rays": pd.read_csv(choice)} if choice.is_file() else made


def publish(results: Path, provenance: dict[str, str], settings: dict, to: Path = FOLDER) -> Tables:
    """Write tables, figure, pictures and settings of the run in ``results`` to the folder ``to``.

    ``settings`` are the checked configuration that it was made with.
    """
    tables = read_run(results)
    first = tables["table_7_1"]
    asked = {(scene, n) for scene in settings["scenes"] for n in settings["views"]}
    there = set(zip(first.scene, first.N, strict=True))
    if asked != there or set(first.M) != {settings["pixels"]}:
        raise PublishError(
            "holds other scenes, N or M than the configuration asks for",
            file=results / "tables" / "table_7_1.csv", remedy="Name the run's own --configfile",
        )  # fmt: skip
    make_folder(to)
    for name, table in tables.items():
        write_result(to / f"{name}.csv", provenance, table)
    write_text(to / SETTINGS, head(provenance) + yaml.safe_dump(settings, sort_keys=False))
    save_figure(to / FIGURE, against_thesis(tables))
    stacks = list(_stacks(results, first.scene.unique(), to))
    write_text(to / "index.md", page(tables, provenance, stacks))
    return tables


def _stacks(results: Path, scenes: Iterable[str], to: Path) -> Iterator[tuple[str, str]]:
    """Write the focal and aperture stack of each scene, pixel for pixel; titles and files."""
    for scene in scenes:
        for name in ("focal", "aperture"):
            stack = results / scene / "figures" / f"{name}_stack.npz"
            pictures, planes = load_stack(stack)
            if name == "aperture":  # the dimmed half repeats the other
                pictures, planes = pictures[len(planes) // 2 :], planes[len(planes) // 2 :]
            labels = [f"{plane.focus_m:.3g} m" for plane in planes]
            labels += [f"f/{plane.f_number:.2g}" for plane in planes]
            codes = np.concatenate([srgb_codes(picture) for picture in pictures], axis=1)
            file = f"{name}_stack_{scene}.jpg"
            with whole_file(to / file) as out:
                jpeg = cast(BinaryIO, out)
                Image.fromarray(codes).save(jpeg, "JPEG", quality=JPEG_QUALITY, subsampling=0)
            yield f"{scene}, {name} stack: {', '.join(dict.fromkeys(labels))}", file


def against_thesis(tables: Tables) -> Figure:
    """Error, bits and time per ray over N, one colour per scene: ours, and dashed the thesis's."""
    traced, stored, decoded = (tables[name] for name in THESIS)
    time = Panel("trace, store and read, ns per ray", "seconds", 1e9)
    sums = {
        name: traced[name] + stored[name] + decoded[name] for name in ("seconds", "thesis_seconds")
    }
    sizes = {name: stored[name] for name in ("video_bytes", "thesis_video_bytes")}
    return curves_over_n(decoded.assign(**sums, **sizes), [QUALITY[0], SIZE, time])


def page(tables: Tables, provenance: dict[str, str], stacks: list[tuple[str, str]]) -> str:
    """docs/results/index.md."""
    (pixels,) = tables["table_7_1"].M.unique()
    cells = list(compared(tables))
    worse = [words for words, better in cells if not better]
    improved = f"{len(cells) - len(worse)} of its {len(cells)} numbers are improved"
    cores = int(re.findall(r"(\d+) cores", provenance["processor"])[0])
    ours, theirs = hours(tables, cores), hours(tables, cores, thesis=True)
    of_size = "" if pixels == THESIS_PIXELS else " Its seconds and sizes are for M = 512."
    said = (
        f"M = {pixels}. The thesis's numbers are in brackets; {improved}. All cells take "
        f"{ours:.1f} hours on {cores} cores, {theirs:.1f} in the thesis.{of_size}"
    )
    parts: list[Iterable[str]] = [
        ["# The thesis's tables at full size"],
        wrapped(said),
        [f"![Error, size and time over N, ours and the thesis's]({FIGURE})"],
    ]
    for name, title in THESIS.items():
        parts += [[f"## {title}"], _markdown(tables[name], COMPARED[name])]
    if "chosen_rays" in tables:
        choice = tables["chosen_rays"][list(CHOICE)].rename(columns=CHOICE)
        parts += [["## Fewer rays, with depth"], markdown(choice)]
    if cells:
        items = ("\n  ".join(wrapped(f"- {words}")) for words in worse or ["none"])
        parts += [["## Not better than the thesis's"], items]
    parts += [["## Pictures"], *([f"![{title}]({file})"] for title, file in stacks)]
    parts.append(wrapped(source(provenance)))
    parts.append([f"All N: the CSV files in this folder. Configuration: [{SETTINGS}]({SETTINGS})."])
    return "\n\n".join(map("\n".join, parts)) + "\n"


def _markdown(table: pd.DataFrame, columns: dict[str, bool]) -> Iterator[str]:
    names = list(columns)
    if "psnr_true_db" in table:
        names.insert(2, "psnr_true_db")
    table = table[table.N.isin(SHOWN)]
    cells = table[["scene", "N"]].copy()
    for name in names:
        theirs = table.get(f"thesis_{name}", pd.Series(math.nan, table.index))
        pairs = zip(table[name], (shown(name, value) for value in theirs), strict=True)
        cells[LABELS[name]] = [
            shown(name, own) + (f" ({old})" if old else "") for own, old in pairs
        ]
    return markdown(cells)

"""The page of a data set: a contact sheet, histograms, refusals, and trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from lfcore.datasets.description import Description
from lfcore.datasets.items import BLUR_BINS, DEPTH_BINS
from lfcore.datasets.stored import StoredItem, stored_items
from lfcore.datasets.trials import trials_of
from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.page import Section, write_page
from lfcore.pictures import contact_sheet, write_picture
from lfcore.rendering.depth import depth_picture

SHOWN = 25
DEPTHS = ("depth.exr", "depth_m.exr", "gt_depth_lowres.pfm")
"""The field of the first picture's depth, of each kind."""
CAPTIONS = {
    "page": "What training sees. A scene that looks odd is a mistake: please report its number.",
    "items": "Per item the first picture, the last one, and depth: near is warm, evenly in 1/m.",
    "spread": "Over all pixels of all items, and the expected PSNR of the worst picture per item.",
    "refused": "Scenes that made no item; all others are at least of the quality asked for.",
}


def drawn(description: Description, records: Sequence[Mapping[str, Any]]) -> list[int]:
    """Numbers of the items on the contact sheet, at random, in order."""
    made = [one["index"] for one in records if "refused" not in one]
    rng = np.random.default_rng(description.seed)
    return sorted(rng.permutation(made)[:SHOWN].tolist())


def write_report(
    page: Path, description: Description, records: Sequence[Mapping[str, Any]],
    shards: Sequence[str | Path], tables: Mapping[str, Path], facts: Mapping[str, object],
) -> None:  # fmt: skip
    """Write the page, ``index.html``; its figures and tables are in the folder ``page`` beside."""
    folder, trials = page.parent / "page", trials_of(description)
    cells, labels = [], []
    for item in stored_items(shards, drawn(description, records)):
        cells.append(_cell(item))
        labels.append(f"{item.index:06d}: {item.record['expected_db']:.1f} dB")
        for trial in trials:
            trial.add(item)
    spread = _histograms(folder / "spread.png", description, records)
    sections = [
        Section("spread", "Depth, blur and quality", CAPTIONS["spread"], figures={"": spread}),
        Section("refused", "What was refused", CAPTIONS["refused"], table=tables["refused"]),
    ]
    if cells:
        sheet = folder / "contact_sheet.png"
        write_picture(sheet, contact_sheet(np.stack(cells), 3, 6, labels))
        items = Section("items", "Items drawn at random", CAPTIONS["items"], figures={"": sheet})
        sections = [items, *sections, *(trial.section(folder) for trial in trials)]
    write_page(
        page, sections, title=f"Data set {description.name}", introduction=CAPTIONS["page"],
        facts=facts, config={},
    )  # fmt: skip


def _cell(item: StoredItem) -> np.ndarray:
    names = [name for name in item.pictures() if name != "sharp.tif"]
    depth = item.floats(next(name for name in DEPTHS if name in item.files))
    shown = [item.codes(names[0]), item.codes(names[-1]), depth_picture(depth)]
    return np.hstack([cv2.resize(one, (160, 160), interpolation=cv2.INTER_AREA) for one in shown])


def _histograms(
    path: Path, description: Description, records: Sequence[Mapping[str, Any]]
) -> Path:  # fmt: skip
    made = [one for one in records if "refused" not in one]
    blurs = np.sum([one["blurs"] for one in made if "blurs" in one], axis=0)
    figure = Figure((10, 3), layout="constrained")
    axes = figure.subplots(1, 2 + np.ndim(blurs))
    depths = np.sum([one["depths"] for one in made], axis=0) if made else np.zeros(40)
    axes[0].stairs(depths / max(depths.sum(), 1), DEPTH_BINS, fill=True)
    axes[0].set(xscale="log", xlabel="depth, m", ylabel="share of pixels")
    if np.ndim(blurs):  # light fields have none
        axes[1].stairs(blurs / max(blurs.sum(), 1), BLUR_BINS, fill=True)
        axes[1].set(xlabel="blur radius, px", yscale="log")
    axes[-1].hist([one["expected_db"] for one in made], 20)
    axes[-1].axvline(description.quality_db, color="black", linewidth=1)
    axes[-1].set(xlabel="expected PSNR, dB", ylabel="items")
    save_figure(path, figure)
    return path

"""The page of a data set: a contact sheet, histograms, and two trials of focal stacks."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from lfcore.datasets import baselines
from lfcore.datasets.batch import members
from lfcore.datasets.description import Description
from lfcore.datasets.items import BLUR_BINS, DEPTH_BINS, blur_px
from lfcore.evaluation.figures import save_figure
from lfcore.evaluation.page import Section, write_page
from lfcore.exr import read_exr
from lfcore.optics.camera import Camera
from lfcore.pictures import contact_sheet, write_picture
from lfcore.rendering.depth import depth_picture

SHOWN = 25
BLURS_PX = (0, 0.5, 1, 2, 4, 8)
TEXTURES = {"weak": (0, 4), "middle": (4, 12), "strong": (12, 256)}
"""Classes of texture: standard deviation of codes within a window."""


def drawn(description: Description, records: Sequence[Mapping[str, Any]]) -> list[int]:
    """Numbers of the items on the contact sheet, at random, in order."""
    made = [one["index"] for one in records if "refused" not in one]
    rng = np.random.default_rng(description.seed)
    return sorted(rng.permutation(made)[:SHOWN].tolist())


def read_items(shards: Iterable[str | Path], indices: Iterable[int]) -> dict[int, dict[str, Any]]:
    """Files of some items by field, decoded: codes of pictures, floats of EXR."""
    wanted = set(indices)
    found: dict[int, dict[str, Any]] = {}
    for shard in shards:
        for name, data in members(shard):
            number, _, field = name.partition(".")
            if int(number) in wanted:
                found.setdefault(int(number), {})[field] = _decoded(field, data)
    return found


def _decoded(field: str, data: bytes) -> Any:
    if field.endswith((".tif", ".png")):
        return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))[..., ::-1]
    if field.endswith(".exr"):
        with tempfile.NamedTemporaryFile(suffix=".exr") as file:
            file.write(data)
            file.flush()
            return read_exr(file.name)[0][..., 0].astype(np.float32)
    return json.loads(data) if field == "json" else data


def write_report(
    page: Path, description: Description, records: Sequence[Mapping[str, Any]],
    shards: Sequence[str | Path], tables: Mapping[str, Path], facts: Mapping[str, object],
) -> None:  # fmt: skip
    """Write the page, ``index.html``; its figures and tables are in the folder ``page`` beside."""
    folder = page.parent / "page"
    items = read_items(shards, drawn(description, records))
    sheet = folder / "contact_sheet.png"
    write_picture(sheet, _sheet(description, items))
    sections = [
        Section("items", "Items drawn at random", CAPTIONS["items"], figures={"": sheet}),
        Section("spread", "Depth, blur and quality", CAPTIONS["spread"],
                figures={"": _histograms(folder / "spread.png", description, records)}),
        Section("refused", "What was refused", CAPTIONS["refused"], table=tables["refused"]),
    ]  # fmt: skip
    if description.kind == "focal_stacks" and items and len(description.lens.focus_m) >= 3:
        focus = folder / "depth_from_focus.csv"
        _focus_table(description, items).to_csv(focus, index=False)
        layers, edges = folder / "layers.csv", folder / "layers.png"
        _layers_table(description, items, edges).to_csv(layers, index=False)
        sections += [
            Section("focus", "Depth from focus", CAPTIONS["focus"], table=focus),
            Section("layers", "Gaussian blur by layers", CAPTIONS["layers"], table=layers,
                    figures={"": edges}),
        ]  # fmt: skip
    write_page(
        page, sections, title=f"Data set {description.name}", introduction=CAPTIONS["page"],
        facts=facts, config={},
    )  # fmt: skip


CAPTIONS = {
    "page": "What training sees. A scene that looks odd is a mistake: please report its number.",
    "items": "Per item the first picture, the last one, and depth: near is warm, evenly in 1/m.",
    "spread": "Over all pixels of all items, and the expected PSNR of the worst picture per item.",
    "refused": "Scenes that made no item; all others are at least of the quality asked for.",
    "focus": "The sharpest plane by the modified Laplacian (Pertuz et al., 2013), over the blur "
    "radius in the sharpest picture and the strength of texture. Errors are medians of inverse "
    "depth in 1/m; *nearest plane* is the share of pixels whose plane is the right one.",
    "layers": "The usual imitation of a lens against these pictures: the sharp picture is blurred "
    "by Gaussians in 16 layers of depth. PSNR in dB over all pixels, within reach of occlusion "
    "edges, and elsewhere. The picture: traced, imitated, and their difference times four.",
}


def _sheet(description: Description, items: Mapping[int, Mapping[str, Any]]) -> np.ndarray:
    cells, labels = [], []
    for index, item in items.items():
        pictures = [value for name, value in item.items() if name.endswith((".tif", ".png"))]
        pictures = [p for p in pictures if p is not item.get("sharp.tif")]
        depth = item.get("depth.exr", item.get("depth_m.exr"))
        shown = [pictures[0], pictures[-1]]
        if depth is not None:
            shown.append(depth_picture(depth))
        small = [cv2.resize(one, (160, 160), interpolation=cv2.INTER_AREA) for one in shown]
        cells.append(np.hstack(small))
        labels.append(f"{index:06d}: {item['json']['expected_db']:.1f} dB")
    if not cells:
        return np.full((16, 16, 3), 255, np.uint8)
    return contact_sheet(np.stack(cells), 3, 6, labels)


def _histograms(
    path: Path, description: Description, records: Sequence[Mapping[str, Any]]
) -> Path:  # fmt: skip
    made = [one for one in records if "refused" not in one]
    figure = Figure((10, 3), layout="constrained")
    axes = figure.subplots(1, 3)
    depths = np.sum([one["depths"] for one in made], axis=0) if made else np.zeros(40)
    axes[0].stairs(depths / max(depths.sum(), 1), DEPTH_BINS, fill=True)
    axes[0].set(xscale="log", xlabel="depth, m", ylabel="share of pixels")
    blurs = np.sum([one["blurs"] for one in made if "blurs" in one] or [np.zeros(40)], axis=0)
    axes[1].stairs(blurs / max(blurs.sum(), 1), BLUR_BINS, fill=True)
    axes[1].set(xlabel="blur radius, px", yscale="log" if blurs.any() else "linear")
    axes[2].hist([one["expected_db"] for one in made], 20)
    axes[2].axvline(description.quality_db, color="black", linewidth=1)
    axes[2].set(xlabel="expected PSNR, dB", ylabel="items")
    save_figure(path, figure)
    return path


def _stack(item: Mapping[str, Any]) -> tuple[np.ndarray, np.ndarray, Camera, list[float]]:
    """Pictures' codes, depth, lens and focus distances of an item."""
    names = sorted(name for name in item if name.startswith("focus"))
    lens = {key: value for key, value in item["json"]["camera"].items() if key != "pixels"}
    stack = np.stack([item[name] for name in names])
    return stack, item["depth.exr"], Camera.from_json(lens), item["json"]["focus_m"]


def _focus_table(
    description: Description, items: Mapping[int, Mapping[str, Any]]
) -> pd.DataFrame:  # fmt: skip
    rows = []
    for item in items.values():
        stack, depth, camera, focus = _stack(item)
        found = baselines.depth_from_focus(stack / np.float32(255), focus)
        inverse, planes = 1 / depth.astype(np.float64), 1 / np.array(focus)
        plane, true_plane = (
            np.abs(planes[:, None, None] - one).argmin(0) for one in (found, inverse)
        )
        blur = np.min([np.abs(blur_px(camera, description.pixels, depth, f)) for f in focus], 0) / 2
        rows.append(pd.DataFrame({
            "blur": blur.ravel(), "texture": baselines.texture_of(item["sharp.tif"]).ravel(),
            "error": np.abs(found - inverse).ravel(), "right": (plane == true_plane).ravel(),
        }))  # fmt: skip
    every = pd.concat(rows)
    every["texture"] = pd.cut(
        every["texture"], [low for low, _ in TEXTURES.values()] + [256], right=False,
        labels=list(TEXTURES),
    )  # fmt: skip
    ends = [f"{a:g} to {b:g}" for a, b in pairwise(BLURS_PX)]
    every["blur"] = pd.cut(every["blur"], BLURS_PX, right=False, labels=ends)
    groups = every.groupby(["texture", "blur"], observed=True)
    table = groups.agg(pixels=("error", "size"), error=("error", "median"), right=("right", "mean"))
    return table.round(3).reset_index().rename(columns={
        "blur": "blur radius, px", "error": "error, 1/m", "right": "nearest plane",
    })  # fmt: skip


def _layers_table(
    description: Description, items: Mapping[int, Mapping[str, Any]], path: Path
) -> pd.DataFrame:
    rows, worst, strip = [], np.inf, None
    for item in items.values():
        stack, depth, camera, focus = _stack(item)
        sharp = baselines.linear(item["sharp.tif"])
        for codes, distance in zip(stack, focus, strict=True):
            blur = blur_px(camera, description.pixels, depth, distance)
            made, true = baselines.blurred_by_layers(sharp, blur), baselines.linear(codes)
            edges = baselines.occlusion_edges(blur)
            parts = {"all": np.ones_like(edges), "edges": edges, "elsewhere": ~edges}
            row = {f"{k}, dB": baselines.psnr_db(made, true, v) for k, v in parts.items()}
            rows.append({"focus, m": distance} | row)
            if row["edges, dB"] < worst:
                worst = row["edges, dB"]
                strip = np.hstack([true, made, np.clip(4 * np.abs(made - true), 0, 1)])
    if strip is not None:
        write_picture(path, cv2.resize(strip, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST))
    else:
        write_picture(path, np.ones((16, 16, 3), np.float32))
    return pd.DataFrame(rows).groupby("focus, m").mean().round(1).reset_index()

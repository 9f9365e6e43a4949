"""Figures of the report: contact sheets of pictures, and curves over N.

Pictures come as float arrays in linear light; they are encoded to sRGB here, once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib import font_manager
from matplotlib.figure import Figure
from PIL import Image, ImageDraw, ImageFont

from lfcore.colour import srgb_codes
from lfcore.files import make_folder, whole_file
from lfcore.pictures import write_picture

PANEL_PX = 256
GAP_PX = 10
LABEL_PX = 26
INK = (30, 34, 40)
PAPER = (255, 255, 255)

matplotlib.use("Agg")


def contact_sheet(
    path: str | Path,
    pictures: Sequence[np.ndarray],
    labels: Sequence[str],
    *,
    columns: int | None = None,
    panel_px: int = PANEL_PX,
) -> None:
    """Write pictures side by side, each above its label, as one PNG.

    Parameters
    ----------
    pictures : (P, H, W, 3) float array, or P of (H, W, 3); linear light in [0, 1].
    labels : one a picture, such as ``"1.2 m"``.
    columns : pictures in a row; default is all.
    panel_px : a smaller picture is enlarged to this width; a larger one is left as it is.

    Raises
    ------
    ValueError
        when there is no picture, or not one label a picture.
    """
    if not len(pictures) or len(pictures) != len(labels):
        raise ValueError(f"{len(pictures)} pictures and {len(labels)} labels make no sheet")
    panels = [_panel(srgb_codes(picture), panel_px) for picture in pictures]
    width, height = panels[0].size
    columns = min(columns or len(panels), len(panels))
    rows = math.ceil(len(panels) / columns)
    sheet = Image.new(
        "RGB",
        (
            columns * (width + GAP_PX) + GAP_PX,
            rows * (height + LABEL_PX + GAP_PX) + GAP_PX,
        ),
        PAPER,
    )
    draw, font = ImageDraw.Draw(sheet), _font()
    for index, (panel, label) in enumerate(zip(panels, labels, strict=True)):
        x = GAP_PX + (index % columns) * (width + GAP_PX)
        y = GAP_PX + (index // columns) * (height + LABEL_PX + GAP_PX)
        sheet.paste(panel, (x, y))
        draw.text((x + width / 2, y + height + 4), label, INK, font, anchor="ma")
    write_picture(path, np.asarray(sheet))


def _panel(codes: np.ndarray, panel_px: int) -> Image.Image:
    picture = Image.fromarray(codes)
    if picture.width >= panel_px:
        return picture
    height = round(picture.height * panel_px / picture.width)
    return picture.resize((panel_px, height), Image.Resampling.BICUBIC)


def _font() -> ImageFont.FreeTypeFont:
    # matplotlib brings the same font to every machine.
    return ImageFont.truetype(font_manager.findfont("DejaVu Sans"), 15)


def curves_over_n(
    path: str | Path,
    table: pd.DataFrame,
    panels: Mapping[str, tuple[str, str]],
    *,
    log_y: Sequence[str] = (),
) -> None:
    """Draw columns of a table over N, one curve a scene, the thesis's own dashed.

    Parameters
    ----------
    table : with ``scene`` and ``N``; points that are missing or infinite are left out.
    panels : for each panel its y label, and the columns of ours and of the thesis.
    log_y : y labels of the panels with a logarithmic axis.
    """
    figure = Figure(figsize=(4.4 * len(panels), 3.7), layout="constrained")
    axes = np.atleast_1d(figure.subplots(1, len(panels)))
    for axis, (label, (ours, thesis)) in zip(axes, panels.items(), strict=True):
        for index, (scene, rows) in enumerate(table.groupby("scene", sort=False)):
            colour = f"C{index}"
            _curve(axis, rows.N, rows[ours], "o-", colour, str(scene))
            _curve(axis, rows.N, rows[thesis], "x--", colour, None)
        axis.set_xscale("log", base=2)
        if label in log_y:
            axis.set_yscale("log")
        axis.set_xticks(sorted(table.N.unique()))
        axis.xaxis.set_major_formatter("{x:.0f}")
        axis.minorticks_off()
        axis.set_xlabel("angular resolution N")
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    axes[0].plot([], [], "x--", color="0.5", label="thesis")
    axes[0].legend(frameon=False)
    save_figure(path, figure)


def _curve(axis, x, y, style: str, colour: str, label: str | None) -> None:
    y = pd.to_numeric(y, errors="coerce").to_numpy(np.float64)
    shown = np.isfinite(y)
    axis.plot(
        np.asarray(x)[shown],
        y[shown],
        style,
        color=colour,
        label=label,
        markersize=5,
        linewidth=1.5,
    )


def save_figure(path: str | Path, figure: Figure, *, dpi: int = 130) -> None:
    """Write a matplotlib figure as PNG, without the date: equal figures are equal files."""
    make_folder(Path(path).parent)
    with whole_file(path) as file:
        figure.savefig(file, format="png", dpi=dpi, metadata={"Software": None})

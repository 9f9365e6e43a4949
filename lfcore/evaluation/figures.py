"""Figures of the report: contact sheets of pictures, and curves over N.

Pictures are float arrays in linear light, encoded to sRGB here.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NamedTuple, cast

import cv2
import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from PIL import Image

from lfcore.colour import srgb_codes
from lfcore.files import make_folder, whole_file
from lfcore.optics.size import Pixels, Size
from lfcore.pictures import contact_sheet as sheet_of
from lfcore.pictures import write_picture

PANEL_PX = 256
"""The width of a picture in a sheet."""
GAP_PX = 10
"""The gap between pictures of a sheet."""

matplotlib.use("Agg")
matplotlib.rcParams.update({
    "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False,
    "figure.constrained_layout.use": True,
})  # fmt: skip


Cell = tuple[np.ndarray, str]
"""A picture in linear light, and its label."""


class Sheet(NamedTuple):
    """Labelled pictures, and the number per row (None: all)."""

    cells: list[Cell]
    columns: int | None = None


def contact_sheet(
    path: str | Path, cells: Sequence[Cell], columns: int | None = None, *, panel_px: int = PANEL_PX
) -> None:
    """Write pictures (H, W, 3), linear light in [0, 1], each above its label, as one PNG.

    ``columns`` are pictures per row, by default all; pictures smaller than ``panel_px`` are
    enlarged to this width.
    """
    panels = np.stack([_panel(srgb_codes(picture), panel_px) for picture, _ in cells])
    labels = [label for _, label in cells]
    write_picture(path, sheet_of(panels, columns or len(panels), GAP_PX, labels))


def _panel(codes: np.ndarray, panel_px: int) -> np.ndarray:
    high, wide = codes.shape[:2]
    if wide >= panel_px:
        return codes
    size = panel_px, round(high * panel_px / wide)
    return np.asarray(Image.fromarray(codes).resize(size, Image.Resampling.BICUBIC))


def shrunk(picture: np.ndarray, width: int) -> np.ndarray:
    """``picture`` (H, W, 3), linear light, at most ``width`` pixels wide, by means over areas."""
    high, wide = picture.shape[:2]
    if wide <= width:
        return picture
    size = width, round(high * width / wide)
    return cv2.resize(np.asarray(picture, np.float32), size, interpolation=cv2.INTER_AREA)


def enlarged(picture: np.ndarray, corner: int, side: int, panel_px: int) -> np.ndarray:
    """The square of ``side`` at (corner, corner), by a whole factor, to at most ``panel_px``."""
    inside, times = picture[corner : corner + side, corner : corner + side], panel_px // side
    return inside.repeat(max(1, times), axis=0).repeat(max(1, times), axis=1)


THESIS_PIXELS = 512
"""M of the thesis's measurements."""


@dataclass(frozen=True)
class Panel:
    """A column of a table over N: this program's values and the thesis's.

    ``per_ray`` is None, or a factor of the value divided by the rays N^2 M^2: only such values are
    comparable across M.  ``of_thesis``: the thesis has the column.
    """

    label: str
    column: str
    per_ray: float | None = None
    of_thesis: bool = True

    def values(self, rows: pd.DataFrame, column: str, pixels: Pixels | str) -> np.ndarray:
        """(R,) float64 of a column, divided by the rays of M = ``pixels`` if ``per_ray``."""
        values = pd.to_numeric(rows[column], errors="coerce").to_numpy(np.float64)
        if self.per_ray is None:
            return values
        area = math.prod(Size.of(pixels))
        return values * self.per_ray / (rows.N * rows.N * area).to_numpy(np.float64)


QUALITY = (
    Panel("PSNR, as in the thesis, dB", "psnr_db"),
    Panel("PSNR against the true picture, dB", "psnr_true_db", of_thesis=False),
    Panel("SSIM", "ssim"),
)
TIME = Panel("nanoseconds per ray", "seconds", 1e9)
SIZE = Panel("bits per ray", "video_bytes", 8)
PANELS = {
    "table_7_1": (*QUALITY, TIME), "table_7_2": (SIZE, TIME), "table_7_3": (*QUALITY, TIME),
}  # fmt: skip


def curves_over_n(table: pd.DataFrame, panels: Sequence[Panel]) -> Figure:
    """Columns of a table over N, one curve per scene, the thesis's dashed.

    Values that are not per ray depend on M: where M is not the thesis's 512, its curves have
    separate axes.  ``table`` has ``scene``, ``N``, ``M`` and the panels' columns; missing and
    infinite points are left out.
    """
    (pixels,) = table.M.unique().tolist()
    drawn: list[tuple[Panel, str]] = []
    for panel in panels:
        together = panel.per_ray is not None or pixels == THESIS_PIXELS
        if not panel.of_thesis or table[f"thesis_{panel.column}"].isna().all():
            drawn.append((panel, "ours"))
        else:
            drawn += [(panel, "both")] if together else [(panel, "ours"), (panel, "thesis")]
    columns = min(len(drawn), 3)  # more are too small to read on a page
    lines = math.ceil(len(drawn) / columns)
    figure = Figure(figsize=(3.9 * columns, 3.7 * lines), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    for unused in axes[len(drawn) :]:
        unused.remove()
    titles = {"ours": f"M = {pixels}", "thesis": f"the thesis, M = {THESIS_PIXELS}"}
    titles["both"] = f"M = {pixels}; dashed: the thesis, M = {THESIS_PIXELS}"
    for axis, (panel, source) in zip(axes, drawn, strict=False):
        for index, (scene, rows) in enumerate(table.groupby("scene", sort=False)):
            if source != "thesis":
                ours = panel.values(rows, panel.column, pixels)
                _curve(axis, rows.N, ours, "o-", f"C{index}", str(scene))
            if source != "ours":
                thesis = panel.values(rows, f"thesis_{panel.column}", THESIS_PIXELS)
                label = str(scene) if source == "thesis" else None
                _curve(axis, rows.N, thesis, "x--", f"C{index}", label)
        if panel.per_ray is not None:
            axis.set_yscale("log")
        views_axis(axis, table.N)
        axis.set_ylabel(panel.label)
        axis.set_title(titles[source], fontsize=9)
    axes[0].legend()
    return figure


def views_axis(axis: Axes, views: pd.Series) -> None:
    """Make the x axis logarithmic with ticks at these N."""
    axis.set_xscale("log", base=2)
    axis.set_xticks(sorted(views.unique()))
    axis.xaxis.set_major_formatter("{x:.0f}")
    axis.xaxis.minorticks_off()
    axis.set_xlabel("views per side, N")


def log_ticks(axis: Axes) -> None:
    """Make the x axis logarithmic, with plain numbers at 1, 2 and 5 of each decade."""
    axis.set_xscale("log")
    axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.xaxis.set_tick_params(labelsize=8)


def _curve(
    axis: Axes, x: pd.Series, y: np.ndarray, style: str, colour: str, label: str | None
) -> None:
    shown = np.isfinite(y)
    axis.plot(
        x.to_numpy()[shown], y[shown], style, color=colour, label=label, markersize=5, linewidth=1.5
    )


def save_figure(path: str | Path, figure: Figure, *, dpi: int = 130) -> None:
    """Write a matplotlib figure as PNG, without the date: equal figures are equal files."""
    make_folder(Path(path).parent)
    with whole_file(path) as file:
        figure.savefig(cast(IO[bytes], file), format="png", dpi=dpi, metadata={"Software": None})

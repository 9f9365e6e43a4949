"""Figures beside the tables of the store."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lfcore.colour import display_values, srgb_decode
from lfcore.evaluation.equivalence import Result
from lfcore.evaluation.figures import Cell, contact_sheet, log_ticks, save_figure, views_axis

MARKERS = {"raster": "s", "serpentine": "o", "hilbert": "^"}
STYLES = {"libx264": "-", "libx265": "--", "libsvtav1": ":"}
CODEC_MARKERS = {"libx264": "o", "libx265": "s", "libsvtav1": "^"}
CODECS = {"x264": "libx264", "x265": "libx265", "AV1": "libsvtav1"}
COLOURS = matplotlib.colormaps["tab20"]
Colour = str | tuple[float, float, float, float]
ERROR_GAIN = 8
"""The gain of error maps: errors of 255 / 8 codes are white."""


def layouts_figure(path: str | Path, table: pd.DataFrame) -> None:
    """Bits per ray against PSNR of the refocused pictures: a row per N, a column per scene.

    ``table`` is that of :mod:`lfcore.evaluation.storage.rate_distortion`.
    """
    packs = "macropixels, " + table.pack.astype(str) + " x " + table.pack.astype(str)
    table = table.assign(name=packs.where(table.layout != "views", "views"))
    scenes, views, names = table.scene.unique(), sorted(table.N.unique()), [*table.name.unique()]
    figure = Figure(figsize=(3.6 * len(scenes) + 1.7, 2.6 * len(views) + 0.4))
    axes = figure.subplots(len(views), len(scenes), squeeze=False)
    for axis, (n, scene) in zip(axes.flat, product(views, scenes), strict=True):
        for row in table[(table.scene == scene) & (table.N == n)].itertuples():
            axis.plot(
                row.bits_per_ray, row.psnr_pictures_db, MARKERS[row.order], markersize=8,
                color=f"C{names.index(row.name)}", alpha=0.85, markeredgewidth=1.6,
                markeredgecolor="black" if row.is_default else "none",
            )  # fmt: skip
        axis.set_title(f"{scene}, N = {n}", fontsize=10)
    for axis in axes[:, 0]:
        axis.set_ylabel("PSNR of pictures (dB)")
    for axis in axes[-1]:
        axis.set_xlabel("bits per ray")
    keys = [axes[0, 0].plot([], [], "o", color=f"C{k}", label=n)[0] for k, n in enumerate(names)]
    for order, marker in MARKERS.items():
        keys += axes[0, 0].plot([], [], marker, color="0.5", label=order)
    keys += axes[0, 0].plot(
        [], [], "o", color="white", markeredgecolor="black", markeredgewidth=1.6, label="default"
    )
    figure.legend(handles=keys, loc="outside right upper", fontsize=9)
    save_figure(path, figure)


def rate_distortion_figure(path: str | Path, points: pd.DataFrame, deltas: pd.DataFrame) -> None:
    """One scene, a row per N: bits against PSNR of frames and of pictures, and speed against the
    delta rate.

    ``points`` and ``deltas`` are the tables of :mod:`lfcore.evaluation.storage.rate_distortion`.
    """
    views = sorted(points.N.unique())
    figure = Figure(figsize=(16, 5.2 * len(views)))
    axes = figure.subplots(len(views), 3, squeeze=False)
    curves = [name for name in points[points.codec != "ffv1"].curve.unique() if name != "default"]
    colours = {name: COLOURS(k % COLOURS.N) for k, name in enumerate(curves)}
    for line, n in zip(axes, views, strict=True):
        for axis, quality in zip(line, ("frames", "pictures"), strict=False):
            _rates(axis, points[points.N == n], f"psnr_{quality}_db", colours)
            axis.set(xlabel="bits per ray", ylabel=f"PSNR of {quality} (dB)")
            axis.set_title(f"N = {n}", fontsize=10)
        _speeds(line[2], deltas[deltas.N == n], colours)
    _legend(figure, axes[0, 0])
    save_figure(path, figure, dpi=110)


def _rates(axis: Axes, points: pd.DataFrame, quality: str, colours: Mapping[str, Colour]) -> None:
    """Curves of lossy codecs; lossless ones are far off and listed as text."""
    log_ticks(axis)
    lossless = points.codec == "ffv1"
    for name, curve in points[~lossless].groupby("curve", sort=False):
        curve = curve.sort_values("bits_per_ray")
        codec, single = curve.codec.iloc[0], len(curve) == 1
        axis.plot(
            curve.bits_per_ray, curve[quality], marker="*" if single else CODEC_MARKERS[codec],
            linestyle="" if single else STYLES[codec], color=colours.get(name, "black"),
            label=name, markersize=13 if single else 5, linewidth=1.4, zorder=3 if single else 2,
        )  # fmt: skip
    far = points[lossless]
    lines = [
        f"{name}: {bits:.2f} bits, {decibels:.1f} dB"
        for name, bits, decibels in zip(far.curve, far.bits_per_ray, far[quality], strict=True)
    ]
    axis.text(
        0.98, 0.02, "\n".join(lines), transform=axis.transAxes, ha="right", va="bottom", fontsize=8
    )


def _speeds(axis: Axes, deltas: pd.DataFrame, colours: Mapping[str, Colour]) -> None:
    log_ticks(axis)
    for row in deltas.itertuples():
        codec = next(codec for word, codec in CODECS.items() if row.curve.startswith(word))
        axis.plot(
            row.encode_mrays_per_second, row.bd_rate_pictures_percent, CODEC_MARKERS[codec],
            color=colours[row.curve], markersize=9,
        )  # fmt: skip
    axis.axhline(0, color="0.6", linewidth=0.8)
    axis.set_xlabel("million rays per CPU second, encoding")
    axis.set_ylabel("BD-rate of pictures (%), less is better")


def retrieval_figure(path: str | Path, table: pd.DataFrame) -> None:
    """Seconds against N, a panel per scene, decoding alone in black.

    ``table`` is that of :mod:`lfcore.evaluation.storage.retrieval`.
    """
    scenes = table.scene.unique()
    figure = Figure(figsize=(3.9 * len(scenes) + 1.8, 3.9))
    axes = figure.subplots(1, len(scenes), squeeze=False, sharey=True)[0]
    for axis, scene in zip(axes, scenes, strict=True):
        of_scene = table[table.scene == scene]
        for k, (work, rows) in enumerate(of_scene.groupby("what", sort=False)):
            colour = "black" if k == 0 else f"C{k - 1}"
            axis.plot(rows.N, rows.seconds, "o-", color=colour, label=work, markersize=4)
        axis.set_yscale("log")
        views_axis(axis, table.N)
        axis.set_title(scene, fontsize=10)
    axes[0].set_ylabel("CPU seconds")
    _legend(figure, axes[0])
    save_figure(path, figure)


def _legend(figure: Figure, axis: Axes) -> None:
    handles, labels = axis.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right upper", fontsize=9)


def equivalence_sheet(
    path: str | Path, results: Sequence[Result], focus_m: Sequence[float]
) -> None:
    """Pictures by each method, above their error maps; a block of two rows per focus distance.

    The first column is the reference; its map is empty.  A map is the root mean square over
    channels, in codes.
    """
    sheet: list[Cell] = []
    reference, *methods = results
    for k, focus in enumerate(focus_m):
        truth = reference.pictures[k]
        sheet.append((truth, f"{reference.method}, {focus:.3g} m"))
        for result in methods:
            method = result.method.replace("the plenoptic photograph", "photograph")
            sheet.append((result.pictures[k], f"{method}, {result.filter}"))
        sheet.append((np.ones_like(truth), f"errors x {ERROR_GAIN}:"))
        for result in methods:
            squares = np.square(display_values(result.pictures[k]) - display_values(truth)).mean(-1)
            shown = srgb_decode(np.clip(np.sqrt(squares) * ERROR_GAIN / 255, 0, 1))
            label = f"{np.sqrt(squares.mean()):.2f} codes rms"
            sheet.append((np.repeat(shown[..., None], 3, axis=-1), label))
    contact_sheet(path, sheet, len(results))

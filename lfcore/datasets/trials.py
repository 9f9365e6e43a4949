"""Trials of a data set: depth by simple methods, and the usual imitation of a lens."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from lfcore.datasets import baselines
from lfcore.datasets.description import Description
from lfcore.datasets.items import blur_px
from lfcore.datasets.stored import StoredItem
from lfcore.evaluation.page import Section
from lfcore.optics.camera import Camera
from lfcore.pictures import write_picture

BLURS_PX = (0, 0.5, 1, 2, 4, 8)
DISPARITIES_PX = (0, 0.25, 0.5, 1, 2, 4)
TEXTURES = {"weak": (0, 4), "middle": (4, 12), "strong": (12, 256)}
"""Classes of texture: standard deviation of codes within a window."""
SWEPT = 49
"""The number of disparities that are tried."""
BAD_PX = 0.07
"""The error of disparity from which on HCI's benchmark counts a pixel as bad."""


@dataclass
class Trial(ABC):
    """Takes one item after the other; :meth:`section` of the page needs at least one."""

    of: Description
    rows: list[pd.DataFrame] = field(default_factory=list)

    @abstractmethod
    def add(self, item: StoredItem) -> None:
        """Try an item."""

    @abstractmethod
    def section(self, folder: Path) -> Section:
        """Write tables and pictures into ``folder``."""

    def _by_texture(self, measure: str, ends: Sequence[float]) -> pd.DataFrame:
        """Pixels, ``error`` and ``good`` of all rows by texture and class of ``measure``."""
        every = pd.concat(self.rows)
        every["texture"] = pd.cut(
            every["texture"], [low for low, _ in TEXTURES.values()] + [256], right=False,
            labels=list(TEXTURES),
        )  # fmt: skip
        names = [f"{low:g} to {high:g}" for low, high in pairwise(ends)]
        every[measure] = pd.cut(every[measure], list(ends), right=False, labels=names)
        groups = every.groupby(["texture", measure], observed=True)
        table = groups.agg(
            pixels=("error", "size"), error=("error", "median"), good=("good", "mean")
        )
        return table.round(3).reset_index()


def trials_of(description: Description) -> list[Trial]:
    """The trials that a kind of data sets allows."""
    if description.kind == "light_fields":
        return [PlaneSweep(description)]
    if description.kind == "focal_stacks" and len(description.lens.focus_m) >= 3:
        return [DepthFromFocus(description), Layers(description)]
    return []


def _stack(item: StoredItem) -> tuple[np.ndarray, np.ndarray, Camera, list[float]]:
    """Pictures' codes, depth, lens and focus distances of an item."""
    lens = {key: value for key, value in item.record["camera"].items() if key != "pixels"}
    names = [name for name in item.pictures() if name.startswith("focus")]
    stack = np.stack([item.codes(name) for name in sorted(names)])
    return stack, item.floats("depth.exr"), Camera.from_json(lens), item.record["focus_m"]


class DepthFromFocus(Trial):
    """The sharpest plane of focal stacks."""

    def add(self, item: StoredItem) -> None:
        stack, depth, camera, focus = _stack(item)
        found = baselines.depth_from_focus(stack / np.float32(255), focus)
        inverse, planes = 1 / depth.astype(np.float64), 1 / np.array(focus)
        plane, true_plane = (
            np.abs(planes[:, None, None] - one).argmin(0) for one in (found, inverse)
        )
        blur = np.min([np.abs(blur_px(camera, self.of.pixels, depth, f)) for f in focus], 0) / 2
        self.rows.append(pd.DataFrame({
            "blur radius, px": blur.ravel(), "error": np.abs(found - inverse).ravel(),
            "texture": baselines.texture_of(item.codes("sharp.tif")).ravel(),
            "good": (plane == true_plane).ravel(),
        }))  # fmt: skip

    def section(self, folder: Path) -> Section:
        table = self._by_texture("blur radius, px", BLURS_PX)
        names = {"error": "error, 1/m", "good": "nearest plane"}
        table.rename(columns=names).to_csv(file := folder / "depth_from_focus.csv", index=False)
        return Section(
            "focus", "Depth from focus",
            "The sharpest plane by the modified Laplacian (Pertuz et al., 2013), over the blur "
            "radius in the sharpest picture and the strength of texture. Errors are medians of "
            "inverse depth in 1/m; *nearest plane* is the share of pixels whose plane is the right "
            "one.", table=file,
        )  # fmt: skip


class PlaneSweep(Trial):
    """Disparity of light fields from the middle row and column of views."""

    def add(self, item: StoredItem) -> None:
        side = self.of.lens.views
        middle = side // 2
        views = {}
        for k in range(side):
            for i, j in ((k, middle), (middle, k)):
                codes = item.codes(f"input_Cam{j * side + i:03d}.png")
                grey = cv2.cvtColor(codes, cv2.COLOR_RGB2GRAY).astype(np.float32)
                views[i - middle, j - middle] = grey
                if k == middle:
                    texture = baselines.texture_of(codes)
        true = item.floats("gt_disp_lowres.pfm")
        low, high = item.record["disparity_px"]
        tried = np.linspace(low, high, SWEPT)
        error = np.abs(baselines.plane_sweep(views, tried) - true)
        self.rows.append(pd.DataFrame({
            "disparity, px": np.abs(true).ravel(), "texture": texture.ravel(),
            "error": error.ravel(), "good": (error < BAD_PX).ravel(),
        }))  # fmt: skip

    def section(self, folder: Path) -> Section:
        table = self._by_texture("disparity, px", DISPARITIES_PX)
        names = {"error": "error, px", "good": f"within {BAD_PX:g} px"}
        table.rename(columns=names).to_csv(file := folder / "plane_sweep.csv", index=False)
        return Section(
            "sweep", "Plane sweep",
            "Disparity at which the middle row and column of views agree best, over the absolute "
            "disparity and the strength of texture. Errors are medians.", table=file,
        )  # fmt: skip


@dataclass
class Layers(Trial):
    """Gaussian blur by layers against the traced pictures."""

    worst_db: float = np.inf
    strip: np.ndarray | None = None

    def add(self, item: StoredItem) -> None:
        stack, depth, camera, focus = _stack(item)
        sharp = baselines.linear(item.codes("sharp.tif"))
        for codes, distance in zip(stack, focus, strict=True):
            blur = blur_px(camera, self.of.pixels, depth, distance)
            made, true = baselines.blurred_by_layers(sharp, blur), baselines.linear(codes)
            edges = baselines.occlusion_edges(blur)
            parts = {"all": np.ones_like(edges), "edges": edges, "elsewhere": ~edges}
            row = {f"{k}, dB": baselines.psnr_db(made, true, v) for k, v in parts.items()}
            self.rows.append(pd.DataFrame([{"focus, m": distance} | row]))
            if row["edges, dB"] < self.worst_db:
                self.worst_db = row["edges, dB"]
                self.strip = np.hstack([true, made, np.clip(4 * np.abs(made - true), 0, 1)])

    def section(self, folder: Path) -> Section:
        file, shown = folder / "layers.csv", {}
        pd.concat(self.rows).groupby("focus, m").mean().round(1).reset_index().to_csv(
            file, index=False
        )
        if self.strip is not None:
            shown[""] = folder / "layers.png"
            large = cv2.resize(self.strip, None, fx=2, fy=2, interpolation=cv2.INTER_NEAREST)
            write_picture(shown[""], large)
        return Section(
            "layers", "Gaussian blur by layers",
            "The usual imitation of a lens against these pictures: the sharp picture is blurred by "
            "Gaussians in 16 layers of depth. PSNR in dB over all pixels, within reach of "
            "occlusion edges, and elsewhere. The picture: traced, imitated, and their difference "
            "times four.",
            table=file, figures=shown,
        )  # fmt: skip

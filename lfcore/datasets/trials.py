"""Trials of a data set: depth by simple methods, and the usual imitation of a lens.

They show what the data are for, and what the usual way of making focal stacks gets wrong.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from lfcore.colour import display_values, srgb_decode
from lfcore.datasets.description import Description
from lfcore.datasets.items import StoredItem, blur_px
from lfcore.evaluation.metrics import PEAK, psnr
from lfcore.evaluation.page import Section
from lfcore.optics.camera import Camera
from lfcore.pictures import write_picture

WINDOW = 9
"""The side of the window that a focus measure is summed over, pixels."""
LAYERS = 16
"""The layers of inverse depth that are blurred one by one."""
EDGE_PX = 1.0
"""The step of the blur, pixels, from which on a step of depth is an occlusion edge."""


def focus_measure(picture: np.ndarray) -> np.ndarray:
    """(H, W) sum-modified Laplacian of a picture (H, W, 3) of sRGB-encoded values.

    Source: Pertuz, Puig, Garcia, Pattern Recognition 2013, LAP2.
    """
    grey = cv2.cvtColor(np.ascontiguousarray(picture, np.float32), cv2.COLOR_RGB2GRAY)
    kernel = np.array([[-1, 2, -1]], np.float32)
    across, down = (np.abs(cv2.filter2D(grey, -1, k)) for k in (kernel, kernel.T))
    return cv2.boxFilter(across + down, -1, (WINDOW, WINDOW))


def depth_from_focus(stack: np.ndarray, focus_m: Sequence[float]) -> np.ndarray:
    """(H, W) inverse depth, 1/m, of the sharpest of (P, H, W, 3) pictures, refined by a parabola
    through the logarithm of three measures (Nayar and Nakagawa, 1994, with a Gaussian)."""
    measures = np.log(np.stack([focus_measure(picture) for picture in stack]) + 1e-6)
    inverse, best = 1 / np.asarray(focus_m), measures.argmax(0)
    middle = best.clip(1, len(stack) - 2)
    (x0, y0), (x1, y1), (x2, y2) = (
        (inverse[k], np.take_along_axis(measures, k[None], 0)[0])
        for k in (middle - 1, middle, middle + 1)
    )
    # Newton's form; its slope is 0 at the top.
    first, second = (y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)
    bend = (second - first) / (x2 - x0)
    with np.errstate(divide="ignore", invalid="ignore"):
        top = (x0 + x1) / 2 - first / (2 * bend)
    inside = (best == middle) & (bend < 0)
    return np.where(inside, top.clip(np.minimum(x0, x2), np.maximum(x0, x2)), inverse[best])


def plane_sweep(views: Mapping[tuple[int, int], np.ndarray], disparities: np.ndarray) -> np.ndarray:
    """(H, W) disparity, pixels per view, at which views agree best with the middle one.

    ``views`` are (H, W) grey by columns and rows from the middle, (0, 0). Source: Collins, "A
    space-sweep approach to true multi-image matching", CVPR 1996.
    """
    middle, costs = views[0, 0], []
    height, width = middle.shape
    for tried in disparities.tolist():
        cost = np.zeros_like(middle)
        for (right, down), view in views.items():
            move = np.array([[1, 0, -tried * right], [0, 1, -tried * down]])
            moved = cv2.warpAffine(
                view, move, (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )  # fmt: skip
            cost += np.abs(moved - middle)
        costs.append(cv2.boxFilter(cost, -1, (WINDOW, WINDOW)))
    every = np.stack(costs)
    best = every.argmin(0).clip(1, len(every) - 2)
    low, at, high = (np.take_along_axis(every, best[None] + k, 0)[0] for k in (-1, 0, 1))
    bend = np.maximum(low - 2 * at + high, 1e-9)
    step = disparities[1] - disparities[0]
    return disparities[best] + step * ((low - high) / (2 * bend)).clip(-1, 1)


def blurred_by_layers(sharp: np.ndarray, blur_px: np.ndarray) -> np.ndarray:
    """(H, W, 3) linear light: layers of the sharp picture by ``blur_px``, the signed diameter of
    blur, each blurred by a Gaussian of that disc's variance and laid over what is behind it."""
    edges = np.linspace(blur_px.min() - 1e-6, blur_px.max() + 1e-6, LAYERS + 1)
    layer = np.digitize(blur_px, edges) - 1
    out = np.zeros_like(sharp)
    weight = np.zeros((*sharp.shape[:2], 1), np.float32)
    for number in range(LAYERS - 1, -1, -1):  # the largest is the farthest
        mask = (layer == number).astype(np.float32)
        if not mask.any():
            continue
        sigma = float(np.abs(blur_px[layer == number]).mean()) / 4  # of a disc: diameter / 4
        part = np.dstack([sharp * mask[..., None], mask])
        if sigma > 0.1:
            part = cv2.GaussianBlur(part, (0, 0), sigma, borderType=cv2.BORDER_REPLICATE)
        cover = part[..., 3:]
        out, weight = out * (1 - cover) + part[..., :3], weight * (1 - cover) + cover
    return out / np.maximum(weight, 1e-6)


def occlusion_edges(blur_px: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels within reach of the blur of a step of depth."""
    kernel = np.ones((3, 3), np.uint8)
    step = cv2.dilate(blur_px, kernel) - cv2.erode(blur_px, kernel)
    reach = 2 * round(float(np.abs(blur_px).max()) / 2) + 3
    return cv2.dilate((step > EDGE_PX).astype(np.uint8), np.ones((reach, reach), np.uint8)) > 0


def psnr_db(found: np.ndarray, expected: np.ndarray, where: np.ndarray) -> float:
    """PSNR of linear light as sRGB, over some of the pixels; NaN over none."""
    if not where.any():
        return float("nan")
    return psnr(display_values(found[where]), display_values(expected[where]), peak=PEAK)


def texture_of(sharp: np.ndarray) -> np.ndarray:
    """(H, W): local standard deviation of uint8 codes, 0 to 255."""
    grey = cv2.cvtColor(sharp, cv2.COLOR_RGB2GRAY).astype(np.float32)
    mean, square = (cv2.boxFilter(g, -1, (WINDOW, WINDOW)) for g in (grey, grey * grey))
    return np.sqrt(np.maximum(square - mean * mean, 0))


BLURS_PX = (0, 0.5, 1, 2, 4, 8)
DISPARITIES_PX = (0, 0.25, 0.5, 1, 2, 4)
TEXTURES = {"weak": (0, 4), "middle": (4, 12), "strong": (12, 256)}
"""Classes of texture: standard deviation of codes within a window."""
SWEPT = 49
"""The number of disparities that are tried."""
BAD_PX = 0.07
"""The error of disparity from which on HCI's benchmark counts a pixel as bad."""


@dataclass
class Trial:
    """Takes one item after the other by ``add``; ``section`` of the page, whose tables and pictures
    go into a folder, needs at least one."""

    of: Description
    rows: list[pd.DataFrame] = field(default_factory=list)

    def _by_texture(self, measure: str, ends: Sequence[float]) -> pd.DataFrame:
        """Pixels, ``error`` and ``good`` of all rows by texture and class of ``measure``."""
        every = pd.concat(self.rows)
        edges = [low for low, _ in TEXTURES.values()] + [256]
        every["texture"] = pd.cut(every["texture"], edges, right=False, labels=list(TEXTURES))
        names = [f"{low:g} to {high:g}" for low, high in pairwise(ends)]
        every[measure] = pd.cut(every[measure], list(ends), right=False, labels=names)
        groups = every.groupby(["texture", measure], observed=True)
        table = groups.agg(
            pixels=("error", "size"), error=("error", "median"), good=("good", "mean")
        )
        return table.round(3).reset_index()


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
        found = depth_from_focus(stack / np.float32(255), focus)
        inverse, planes = 1 / depth.astype(np.float64), 1 / np.array(focus)
        plane, true_plane = (
            np.abs(planes[:, None, None] - one).argmin(0) for one in (found, inverse)
        )
        blur = np.min([np.abs(blur_px(camera, self.of.pixels, depth, f)) for f in focus], 0) / 2
        self.rows.append(pd.DataFrame({
            "blur radius, px": blur.ravel(), "error": np.abs(found - inverse).ravel(),
            "texture": texture_of(item.codes("sharp.tif")).ravel(),
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
                    texture = texture_of(codes)
        true = item.floats("gt_disp_lowres.pfm")
        low, high = item.record["disparity_px"]
        tried = np.linspace(low, high, SWEPT)
        error = np.abs(plane_sweep(views, tried) - true)
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
        sharp = srgb_decode(item.codes("sharp.tif"))
        for codes, distance in zip(stack, focus, strict=True):
            blur = blur_px(camera, self.of.pixels, depth, distance)
            made, true = blurred_by_layers(sharp, blur), srgb_decode(codes)
            edges = occlusion_edges(blur)
            parts = {"all": np.ones_like(edges), "edges": edges, "elsewhere": ~edges}
            row = {f"{k}, dB": psnr_db(made, true, v) for k, v in parts.items()}
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


def trials_of(description: Description) -> list[DepthFromFocus | PlaneSweep | Layers]:
    """The trials that a kind of data sets allows."""
    if description.kind == "light_fields":
        return [PlaneSweep(description)]
    if description.kind == "focal_stacks" and len(description.lens.focus_m) >= 3:
        return [DepthFromFocus(description), Layers(description)]
    return []

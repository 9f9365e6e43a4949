"""Trains depth from focus on our stacks and on convolved ones: python -m benchmarks.teach

One small network is trained twice per seed, from the same weights and the same crops: on focal
stacks of rays, and on stacks of the same scenes that the sharp picture and depth make by
convolution, as FOSSA trains (:func:`benchmarks.peers.convolved.fossa`).  Both are tested on stacks
of many rays, of other rooms and of shapes that no training scene has.

    python -m benchmarks.teach --data teach/ --out teach.csv --figure teach.webp
    python -m benchmarks.teach --data full/ --full --out full.csv     # ten minutes per training

Data and trainings are kept in ``--data``; a killed run continues.
"""

import argparse
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import distance_transform_edt

from benchmarks.peers.convolved import fossa
from benchmarks.peers.method import check_installed
from benchmarks.results import report, said
from lfcore.colour import srgb_codes, srgb_decode
from lfcore.datasets.description import Description
from lfcore.datasets.items import make_item
from lfcore.datasets.kinds import blur_px
from lfcore.datasets.sample import lens_of
from lfcore.errors import OpticsError, SceneError
from lfcore.opencl.device import open_device
from lfcore.optics.camera import Camera

HELD_OUT = ["vase", "train", "plant", "lamp"]
"""The shapes of test scenes only."""
TRAINED = ["ball", "block", "blob", "rod", "cone", "ring", "tower", "book", "armchair", "table",
           "globe"]  # fmt: skip
LENS: dict[str, Any] = {
    "focal_length_mm": 35, "sensor_width_mm": 24, "f_number": 1, "focus_m": [0.8, 1.2, 2, 4, 8],
}  # fmt: skip
PLACES: dict[str, dict[str, Any]] = {
    "objects": {"pixels": 128, "placement": {
        "depth_m": [0.6, 6, "log"], "wall_m": [6.5, 9], "objects": [5, 12]}},
    "rooms": {"pixels": 160, "placement": {"share_rooms": 1}},
}  # fmt: skip
"""The two kinds of scenes."""
TRAIN_DB, TEST_DB = 38, 50
"""The quality of stacks for training and of true ones, dB."""
POWERS = (1, 5)
"""The binary logarithms between which the power of the convolved blur's edge is drawn per stack, as
FOSSA's."""
EDGE = 1.1
"""The least ratio of neighbours' depths at a depth edge."""
NEAR_PX = 10
"""The distance to depth edges within which errors count as near them, pixels."""
CROP_PX = 64
BATCH = 6
RATE = 3e-3
"""The greatest learning rate of Adam; it rises and falls in one cycle."""


@dataclass(frozen=True)
class Size:
    """How many scenes of each kind train and test, and the steps of a training."""

    train: Mapping[str, int]
    test: Mapping[str, int]
    steps: int


SMALL = Size({"objects": 120, "rooms": 12}, {"objects": 20, "rooms": 4}, 300)
FULL = Size({"objects": 800, "rooms": 100}, {"objects": 60, "rooms": 20}, 4000)


def near_edges(depth: np.ndarray, reach: float = NEAR_PX) -> np.ndarray:
    """Return which pixels are within ``reach`` of a depth edge."""
    edges, logs = np.zeros(depth.shape, bool), np.log(depth)
    for axis in (0, 1):
        step = np.abs(np.diff(logs, axis=axis)) > np.log(EDGE)
        edges |= np.pad(step, [(0, axis == 0), (0, axis == 1)])
    return distance_transform_edt(~edges) < reach if edges.any() else edges


def made(folder: Path, split: str, counts: Mapping[str, int]) -> list[dict[str, np.ndarray]]:
    """Make the stacks of a split that are not in ``folder``, and return all."""
    folder.mkdir(parents=True, exist_ok=True)
    items = []
    for kind, count in counts.items():
        keys = {
            "name": f"{kind}-{split}", "kind": "focal_stacks", "seed": 62 + (split == "test"),
            "quality_db": TEST_DB if split == "test" else TRAIN_DB, "lens": LENS,
            "scenes": {"train": count, "validation": 0},
            "shapes": {"builders": HELD_OUT if split == "test" else TRAINED},
        }  # fmt: skip
        description = Description.check(keys | PLACES[kind])
        for index in range(count):
            file = folder / f"{kind}-{split}-{index:04d}.npz"
            if not file.exists():
                arrays: dict[str, Any] = stack_of(description, index, split)
                np.savez(part := file.with_suffix(".part.npz"), **arrays)
                part.rename(file)
            if arrays := dict(np.load(file)):  # none of a scene that makes no item
                items.append({"name": file.stem, **arrays})
    return items


def stack_of(description: Description, index: int, split: str) -> dict[str, np.ndarray]:
    """Make a scene's stack; return its arrays, of a training scene with the convolved stack."""
    begun = time.process_time()
    try:
        item = make_item(description, index, open_device(threads=1), encoded=False)
    except (SceneError, OpticsError) as refused:
        said({"scene": f"{description.name}-{index}", "refused": refused})
        return {}
    arrays = {key: np.asarray(item.arrays[key]) for key in ("focus", "sharp", "depth")}
    if split == "train":
        camera = lens_of(description, index).camera
        arrays["convolved"] = convolved(camera, arrays["sharp"], arrays["depth"], index)
    rays = item.record["rays_per_pixel"]
    said(
        {
            "scene": f"{description.name}-{index}",
            "rays": rays,
            "core s": time.process_time() - begun,
        }
    )
    return arrays | {"rays": np.array(rays)}


def convolved(camera: Camera, sharp: np.ndarray, depth: np.ndarray, seed: int) -> np.ndarray:
    """Return the stack (P, H, W, 3), codes, of a sharp picture's codes by convolution."""
    power = 2 ** np.random.default_rng(seed).uniform(*POWERS)
    light, depth = srgb_decode(sharp).astype(np.float32), depth.astype(np.float32)
    radii = [blur_px(camera, len(depth), depth, focus) / 2 for focus in LENS["focus_m"]]
    return np.stack([srgb_codes(fossa(light, radius, power)) for radius in radii])


Batch = tuple[np.ndarray, np.ndarray]


def batches(items: list[dict], which: str, seed: int) -> Iterator[Batch]:
    """Yield codes (B, P, H, W, 3) and dioptres (B, H, W) of random crops, turned and mirrored; of
    each item as many as it has pixels."""
    rng = np.random.default_rng(seed)
    sizes = np.array([item["depth"].size for item in items])
    while True:
        stacks, depths = [], []
        for number in rng.choice(len(items), BATCH, p=sizes / sizes.sum()):
            depth, turn = items[number]["depth"], int(rng.integers(8))
            y, x = (int(rng.integers(side - CROP_PX + 1)) for side in depth.shape)
            window = np.s_[y : y + CROP_PX, x : x + CROP_PX]
            parts = items[number][which][(slice(None), *window)], 1 / depth[window][None]
            parts = tuple(np.rot90(part, turn, (1, 2)) for part in parts)
            stack, dioptres = (part[:, ::-1] if turn > 3 else part for part in parts)
            stacks.append(stack)
            depths.append(dioptres[0].astype(np.float32))
        yield np.stack(stacks), np.stack(depths)


@dataclass(frozen=True)
class Training:
    """A network's answers, dioptres, one per test scene; its losses, core seconds and weights."""

    found: list[np.ndarray]
    losses: np.ndarray
    seconds: float
    weights: int


def training(file: Path, which: str, seed: int, steps: int, trains: list, tested: list) -> Training:
    """Train and test a network, unless ``file`` has the result of an earlier run."""
    if not file.exists():
        from benchmarks.peers import depth_network

        begun, focus = time.process_time(), dioptres_of_focus()
        crops = batches(trains, which, seed)
        network, losses = depth_network.trained(crops, focus, steps, RATE, seed)
        facts: dict[str, Any] = {
            "seconds": time.process_time() - begun,
            "weights": depth_network.weights(network),
        }
        found: dict[str, Any] = {
            item["name"]: depth_network.found(network, item["focus"], focus) for item in tested
        }
        np.savez(part := file.with_suffix(".part.npz"), losses=losses, **facts, **found)
        part.rename(file)
    kept = np.load(file)
    answers = [kept[item["name"]] for item in tested]
    return Training(answers, kept["losses"], float(kept["seconds"]), int(kept["weights"]))


def dioptres_of_focus() -> np.ndarray:
    return (1 / np.array(LENS["focus_m"])).astype(np.float32)


def errors_of(found: list[np.ndarray], tested: list[dict]) -> Iterator[dict]:
    """Yield the errors at all pixels, near depth edges, and elsewhere, over all test scenes."""
    depths = [item["depth"].astype(np.float64) for item in tested]
    near = np.concatenate([near_edges(depth).ravel() for depth in depths])
    true = np.concatenate([depth.ravel() for depth in depths])
    ours = np.concatenate([each.ravel() for each in found]).astype(np.float64)
    finite = np.isfinite(true)
    for name, mask in (("all", finite), (f"within {NEAR_PX} px of depth edges", finite & near),
                       ("elsewhere", finite & ~near)):  # fmt: skip
        ratio, apart = 1 / (ours[mask] * true[mask]), ours[mask] - 1 / true[mask]
        yield {
            "pixels": name, "share": mask.mean(), "AbsRel": np.abs(ratio - 1).mean(),
            "RMSE, dpt": np.sqrt(np.square(apart).mean()),
            "d < 1.25": (np.maximum(ratio, 1 / ratio) < 1.25).mean(),
        }  # fmt: skip


TRAINED_ON = {"focus": "rays", "convolved": "convolution"}
ERRORS = ["AbsRel", "RMSE, dpt", "d < 1.25"]
SHOWN = ["pixels", "trained on", "seed", *ERRORS]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Return means over seeds with their standard deviations, as texts."""
    groups = rows.groupby(["pixels", "trained on"], sort=False)
    count = rows["seed"].nunique()
    texts = groups[ERRORS].agg(lambda c: f"{c.mean():.3f}" + f" ± {c.std():.3f}" * (len(c) > 1))
    return texts.reset_index().assign(seed=f"{count} seeds").sort_values("pixels", kind="stable")


def figure(path: Path, tested: list[dict], runs: Mapping[str, Training], chosen: list[int]) -> None:
    """Write a sheet: a row per test scene with picture, depth, both answers and their errors."""
    import matplotlib

    from lfcore.evaluation.figures import contact_sheet

    def coloured(values: np.ndarray, most: float, colours: str = "viridis") -> np.ndarray:
        return srgb_decode(matplotlib.colormaps[colours](np.clip(values / most, 0, 1))[..., :3])

    cells = []
    for number in chosen:
        item, side = tested[number], PLACES["objects"]["pixels"]
        true = 1 / item["depth"].astype(np.float32)
        row = [(srgb_decode(item["focus"][0]), "focus at 0.8 m"),
               (coloured(true, 1.5), "dioptres")]  # fmt: skip
        for which, run in runs.items():
            error, label = np.abs(run.found[number] - true), TRAINED_ON[which]
            row += [(coloured(run.found[number], 1.5), f"trained on {label}"),
                    (coloured(error, 0.4, "magma"), f"error, mean {error.mean():.3f}")]  # fmt: skip
        cells += [(picture[:side, :side], text) for picture, text in row]
    contact_sheet(path, cells, 6, panel_px=256)


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.teach", description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="folder of data and trainings")
    parser.add_argument("--full", action="store_true", help="more scenes and steps")
    parser.add_argument("--steps", type=int, help="of a training")
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(range(5)))
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--shown", type=int, nargs="+", default=[0, 1, 2], help="scenes of figure")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    check_installed("torch")
    import torch

    torch.set_num_threads(options.threads)
    size, folder = FULL if options.full else SMALL, options.data
    steps = options.steps or size.steps
    trains, tested = (made(folder, split, getattr(size, split)) for split in ("train", "test"))
    middle = np.median(np.concatenate([1 / item["depth"].ravel() for item in trains]))
    constant = [np.full(item["depth"].shape, middle) for item in tested]
    rows = [{"trained on": "nothing: a constant"} | row for row in errors_of(constant, tested)]
    runs: dict[tuple[str, int], Training] = {}
    for seed in options.seeds:
        for which, name in TRAINED_ON.items():
            file = folder / f"{which}-{seed}-{steps}.npz"
            runs[which, seed] = run = training(file, which, seed, steps, trains, tested)
            *_, before, last = np.array_split(run.losses, 5)
            facts = {"trained on": name, "seed": seed, "core s": run.seconds,
                     "loss": last.mean(), "loss before": before.mean()}  # fmt: skip
            rows += [said(facts | row) for row in errors_of(run.found, tested)]
    every = pd.DataFrame(rows)
    table = summary(every)
    losses = every.dropna().groupby("trained on")[["loss before", "loss"]].mean().round(3)
    flat = "; ".join(f"{name}: {a}, {b}" for name, a, b in losses.itertuples())
    note = (
        f"{len(trains)} scenes and {steps} steps of {BATCH} crops of {CROP_PX} x {CROP_PX} pixels "
        f"train {run.weights:,} weights; {len(tested)} scenes test. Loss in the last fifth but "
        f"one, and in the last: {flat}."
    )
    both = pd.concat([table, every.round(4)])
    report(options.out, "python -m benchmarks.teach", both, note, {"": table[SHOWN]})
    if options.figure:
        first = {which: runs[which, options.seeds[0]] for which in TRAINED_ON}
        figure(options.figure, tested, first, options.shown)


if __name__ == "__main__":
    main()

"""Baselines find what synthetic pictures were made from; the page of light fields."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from lfcore.datasets import trials
from lfcore.datasets.card import RECORDS, tables, write_report
from lfcore.datasets.description import Description
from lfcore.datasets.items import make_batch


@pytest.fixture
def noise():
    return np.random.default_rng(5).random((64, 64)).astype(np.float32)


@pytest.mark.parametrize("disparity", [-0.7, 0.0, 1.3])
def test_plane_sweep_finds_the_disparity(noise, disparity):
    smooth = gaussian_filter(noise, 1.5)
    views = {
        (i, j): shift(smooth, (-disparity * j, -disparity * i), order=3, mode="nearest")
        for i, j in ((-1, 0), (0, 0), (1, 0), (0, -1), (0, 1))
    }
    found = trials.plane_sweep(views, np.linspace(-2, 2, 41))
    assert np.abs(found - disparity)[8:-8, 8:-8].max() < 0.05


def test_the_sharpest_plane_is_found_between_pictures(noise):
    sharp = gaussian_filter(noise, 0.7)
    focus = np.array([0.2, 0.25, 0.33, 0.5, 1.0])
    true = 3.4  # dioptres; the nearest pictures are at 3 and 4
    stack = np.stack([
        np.repeat(gaussian_filter(sharp, abs(1 / f - true))[..., None], 3, 2) for f in focus
    ])  # fmt: skip
    found = trials.depth_from_focus(stack, focus)[12:-12, 12:-12]
    assert np.abs(np.median(found) - true) < 0.2


def test_layers_of_one_depth_are_one_blur(noise):
    sharp = np.repeat(noise[..., None], 3, 2)
    blurred = trials.blurred_by_layers(sharp, np.full((64, 64), 8.0))
    assert np.abs(blurred - gaussian_filter(sharp, (2, 2, 0), mode="nearest")).max() < 0.01
    step = np.where(np.arange(64) < 32, 0.0, 8.0) * np.ones((64, 1))
    edges = trials.occlusion_edges(step)
    assert edges[:, 28:36].all() and not edges[:, :20].any()


@pytest.mark.kernels
def test_the_page_of_light_fields_has_their_pictures_and_a_plane_sweep(device, tmp_path):
    of = Description.check({
        "name": "small", "kind": "light_fields", "pixels": 40, "quality_db": 20, "also": [],
        "scenes": {"train": 1, "validation": 0},
        "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 3},
        "placement": {"depth_m": [1.1, 2.8], "wall_m": 3},
    })  # fmt: skip
    shard = tmp_path / "shard.tar"
    records = make_batch(of, [0], shard, tmp_path / "records", tmp_path / "drafts", device)
    made = tables(of, records, tmp_path)
    made["refused"].to_csv(tmp_path / "refused.csv", index=False)
    page = tmp_path / "index.html"
    write_report(page, of, records, [shard], {"refused": tmp_path / "refused.csv"}, {})
    text = page.read_text()
    assert "Plane sweep" in text and text.count("data:image/png") == 2
    assert all(list(made[name]) == list(columns) for name, columns in RECORDS.items())
    (seconds,) = made["seconds"].to_dict("records")
    parts = seconds["scene_core_seconds"] + seconds["files_core_seconds"]
    assert 0 < parts < seconds["core_seconds"]

"""Depth and disparity of every view, traced again from the light field's own scene."""

import json

import cv2
import numpy as np
import pytest
from plain_scenes import CHART

from lfcore.api import load_scene, record
from lfcore.exchange import export_lightfield, import_lightfield
from lfcore.exchange.pictures import read_pfm
from lfcore.exchange.source import Selection
from lfcore.lightfield import LightField
from lfcore.rendering.depth import depth_of_views, disparity
from lfcore.rendering.prepared import open_tracer
from lfcore.storage.codecs import Encoding


@pytest.fixture(scope="module")
def chart():
    return load_scene(CHART)


@pytest.fixture(scope="module")
def traced(chart, tmp_path_factory):
    """5 x 5 views of 32 x 32 pixels of the chart, exact."""
    path = tmp_path_factory.mktemp("traced") / "chart.mkv"
    record(chart, path, views=5, pixels=32, encoding=Encoding("ffv1", "gbrp", depth=False))
    return path


def test_hci_has_every_views_depth_and_disparity(chart, traced, tmp_path, device):
    selection = Selection((3, 3), crop=(4, 2, 20, 24))
    assert export_lightfield(traced, "hci", tmp_path / "out", selection=selection, scene=chart,
                             device=device) == []  # fmt: skip
    field = LightField.open(traced)
    window = np.s_[2:26, 4:24]
    samples = np.array([(2 * i, 2 * j) for j in range(3) for i in range(3)])
    expected = depth_of_views(open_tracer(chart, device), field.slab, samples)
    for index in range(9):
        depth = read_pfm(tmp_path / "out" / f"gt_depth_lowres_Cam{index:03d}.pfm")
        np.testing.assert_array_equal(depth, expected[index][window])
        moved = read_pfm(tmp_path / "out" / f"gt_disp_lowres_Cam{index:03d}.pfm")
        np.testing.assert_allclose(
            moved, 2 * disparity(field.slab, expected[index])[window], rtol=1e-6, atol=1e-6
        )
        ids = cv2.imread(str(tmp_path / "out" / f"objectids_highres_Cam{index:03d}.png"), -1)
        assert ids.dtype == np.uint16
        assert (ids > 0).all() == np.isfinite(depth).all()
    np.testing.assert_array_equal(
        read_pfm(tmp_path / "out" / "gt_depth_lowres.pfm"), expected[4][window]
    )
    # OpenCV reads the float maps as they are meant.
    seen = cv2.imread(str(tmp_path / "out" / "gt_disp_lowres.pfm"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(seen, read_pfm(tmp_path / "out" / "gt_disp_lowres.pfm"))
    text = (tmp_path / "out" / "parameters.cfg").read_text()
    values = dict(line.split(" = ") for line in text.splitlines() if " = " in line)
    finite = [d for d in expected[:, 2:26, 4:24].ravel() if np.isfinite(d)]
    ends = 2 * disparity(field.slab, np.array([max(finite), min(finite)]))
    assert [float(values["disp_min"]), float(values["disp_max"])] == pytest.approx(ends.tolist())
    import_lightfield(tmp_path / "out", tmp_path / "back.mkv", encoding=Encoding("ffv1"))
    back = LightField.open(tmp_path / "back.mkv")
    assert back.depth_range == pytest.approx((min(finite), max(finite)), rel=0.2)
    assert back.metric


def test_nerfstudio_has_millimetres(chart, traced, tmp_path):
    export_lightfield(traced, "nerfstudio", tmp_path / "out", scene=chart)
    data = json.loads((tmp_path / "out" / "transforms.json").read_text())
    frame = data["frames"][7]
    mm = cv2.imread(str(tmp_path / "out" / frame["depth_file_path"]), cv2.IMREAD_UNCHANGED)
    field = LightField.open(traced)
    depth = depth_of_views(open_tracer(chart), field.slab, np.array([[2, 1]]))[0]
    expected = np.where(np.isfinite(depth), np.rint(1e3 * depth), 0)
    np.testing.assert_array_equal(mm, expected)


def test_without_the_scene_it_is_said(traced, tmp_path):
    for name in ("hci", "nerfstudio"):
        (note,) = export_lightfield(traced, name, tmp_path / name)
        assert "--scene" in note
        assert not list((tmp_path / name).glob("gt_*"))

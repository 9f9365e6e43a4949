"""True pictures and what is held against them."""

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from lfcore.errors import LfcoreError, OpticsError
from lfcore.evaluation.true_picture.figure import true_errors, worst_planes
from lfcore.evaluation.true_picture.points import (
    BY_DEPTH,
    COLUMNS,
    NEAREST,
    TO_QUALITY,
    method_rows,
)
from lfcore.evaluation.true_picture.reference import (
    inner_psnr,
    load_reference,
    save_reference,
    true_pictures,
)
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.by_depth import RayCount

pytestmark = pytest.mark.kernels

PIXELS = 24


@pytest.fixture(scope="module")
def reference(chart):
    camera = chart.scene.camera
    planes = [SensorPlane(focus, camera.f_number) for focus in (1.0, camera.focus_distance_m)]
    return true_pictures(chart, planes, PIXELS, (RayCount(10, 3), RayCount(8, 4)))


def test_two_lattices_agree_on_the_truth(reference):
    assert reference.pictures.shape == (2, PIXELS, PIXELS, 3)
    assert (reference.known_db > 45).all()


def test_the_truth_does_not_depend_on_how_it_is_traced(chart, reference):
    """Rays that each count in their own pixel, none spread, come to the same."""
    from lfcore.optics.ray_cells import crossed_views
    from lfcore.optics.slab import Slab
    from lfcore.rendering.direct import focused_camera

    plane = reference.planes[0]
    slab = Slab(focused_camera(chart.scene.camera, plane), 24, 3 * PIXELS)
    inside = plane.mask(slab).ravel()
    light = chart.bundle_radiance(crossed_views(slab).bundles())[inside].clip(0, 1).mean(0)
    plain = light.reshape(PIXELS, 3, PIXELS, 3, 3).mean((1, 3))
    assert inner_psnr(plain, reference.pictures[0]) > 40


def test_alike_lattices_are_no_reference(chart, reference):
    with pytest.raises(OpticsError, match="too alike"):
        true_pictures(chart, reference.planes, PIXELS, (RayCount(8, 3), RayCount(8, 4)))


def test_a_reference_is_kept(reference, tmp_path):
    file = tmp_path / "truth.npz"
    save_reference(file, reference)
    again = load_reference(file)
    assert again.planes == reference.planes
    np.testing.assert_array_equal(again.pictures, reference.pictures)
    file.write_bytes(b"none")
    with pytest.raises(LfcoreError, match="holds no true pictures"):
        load_reference(file)


def test_few_rays_by_depth_beat_many_that_miss_the_pixel(chart, reference, tmp_path):
    rows = list(method_rows(chart, [reference], [RayCount(4, 1), RayCount(4, 2)], [16]))
    table = pd.DataFrame(rows)
    assert list(table.columns) == list(COLUMNS) and len(table) == 6
    worst = worst_planes(table).set_index("lattice")
    assert set(worst.method) == {BY_DEPTH, NEAREST} and len(worst) == 3
    assert worst.psnr_true_db["4 x 2"] > worst.psnr_true_db["4 x 1"]
    assert worst.psnr_true_db["4 x 2"] > worst.psnr_true_db["16 x 1"] + 3
    assert worst.rays["4 x 2"] * 4 == worst.rays["16 x 1"]
    said = pd.DataFrame(method_rows(chart, [reference], [], [], [34]))
    assert set(said.method) == {TO_QUALITY} and set(said.lattice) == {"34 dB"}
    assert said.expected_db.min() >= 34 and said.psnr_true_db.min() > 32
    table = pd.concat([table, said])
    true_errors(tmp_path / "errors.png", table, machine="none")
    assert Image.open(tmp_path / "errors.png").size[0] > 300

"""True pictures and what is held against them."""

import numpy as np
import pandas as pd
import pytest

from lfcore.errors import LfcoreError, OpticsError
from lfcore.evaluation.renderers import Rendered
from lfcore.evaluation.true_picture.figure import true_errors, worst_planes
from lfcore.evaluation.true_picture.peers import peer_rows
from lfcore.evaluation.true_picture.points import (
    BY_DEPTH,
    COLUMNS,
    NEAREST,
    TO_QUALITY,
    TOO_GOOD,
    method_rows,
    plane_rows,
    rounded,
)
from lfcore.evaluation.true_picture.reference import (
    Reference,
    inner_psnr,
    load_reference,
    save_reference,
    true_pictures,
)
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane

pytestmark = pytest.mark.kernels

PIXELS = 24


@pytest.fixture(scope="module")
def reference(chart):
    camera = chart.scene.camera
    planes = [SensorPlane(focus, camera.f_number) for focus in (1.0, camera.focus_m)]
    return true_pictures(chart, planes, PIXELS, (Lattice(10, 3), Lattice(8, 4)))


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
        true_pictures(chart, reference.planes, PIXELS, (Lattice(8, 3), Lattice(8, 4)))


def test_a_reference_is_kept(reference, tmp_path):
    file = tmp_path / "truth.npz"
    save_reference(file, reference)
    again = load_reference(file)
    assert again.planes == reference.planes
    np.testing.assert_array_equal(again.pictures, reference.pictures)
    for damaged in (b"none", file.read_bytes()[:-100]):
        file.write_bytes(damaged)
        with pytest.raises(LfcoreError, match="holds no true pictures"):
            load_reference(file)


def test_few_rays_by_depth_beat_many_that_miss_the_pixel(chart, reference, tmp_path, drawn, shows):
    rows = list(method_rows(chart, [reference], [Lattice(4, 1), Lattice(4, 2)], [16]))
    table = pd.DataFrame(rows)
    assert list(table.columns) == list(COLUMNS) and len(table) == 6
    worst = worst_planes(table).set_index("lattice")
    assert set(worst.method) == {BY_DEPTH, NEAREST} and len(worst) == 3
    assert worst.psnr_true_db["4 x 2"] > worst.psnr_true_db["4 x 1"]
    assert worst.psnr_true_db["4 x 2"] > worst.psnr_true_db["16 x 1"] + 3
    assert worst.rays["4 x 2"] * 4 == worst.rays["16 x 1"]
    said = pd.DataFrame(method_rows(chart, [reference], [], [], [30, 34], [30]))
    assert (
        set(said.method) == {TO_QUALITY} and said.lattice.tolist() == ["30 dB"] * 3 + ["34 dB"] * 2
    )
    assert said.pictures.tolist() == [2, 2, 1, 2, 2], "of one goal one picture, too"
    asked = said.lattice.str.removesuffix(" dB").astype(float)
    assert (said.expected_db > asked - 1e-3).all() and (said.psnr_true_db > asked - 2).all()
    peers = pd.DataFrame(
        peer_rows(chart.scene, reference.planes, PIXELS, [40], peers={"POV-Ray": _noisy})
    )
    table = pd.concat([table, said, peers])
    whole = rounded(table)[["pictures", "rays"]].astype(str)
    assert set(whole.pictures) == {"2", "1"} and not whole.rays.str.contains(".", regex=False).any()
    true_errors(tmp_path / "errors.png", table, machine="none")
    (axis,) = drawn[0].axes
    shown = worst_planes(table)
    assert shows(axis, shown[["seconds", "psnr_true_db"]].to_numpy()) and len(shown) == 6


def _noisy(scene, plane, pixels, views):
    """A renderer whose independent samples err by 0.05 of white each."""
    noise = np.random.default_rng(views).normal(0, 0.05 / views, (pixels, pixels, 3))
    return Rendered("P", np.float32(0.5 + noise), views**2, 1e-6 * (views * pixels) ** 2)


def test_a_peer_takes_what_independent_samples_take(chart, reference):
    """Squared error falls with the samples: 10 dB more are ten times as many."""
    rows = pd.DataFrame(
        peer_rows(chart.scene, reference.planes, 64, [50, 60], peers={"P": _noisy})
    ).set_index(["lattice", "plane_m"])
    assert rows.columns.tolist() == [name for name in COLUMNS if name not in rows.index.names]
    planes = [plane.focus_m for plane in reference.planes]
    for target in (50, 60):
        one = rows.loc[f"{target} dB"].loc[planes]
        samples = (0.05 * 0.659) ** 2 * 10 ** (target / 10)  # the slope of sRGB at a half
        np.testing.assert_allclose(one.rays, samples * 64**2, rtol=0.1)
        np.testing.assert_allclose(one.seconds, one.rays * 1e-6)
        together = rows.loc[f"{target} dB"][rows.loc[f"{target} dB"].pictures == 2]
        assert together.seconds.item() == pytest.approx(one.seconds.sum())
    assert rows.psnr_true_db.isna().all() and set(rows.expected_db) == {50, 60}


def test_a_peer_that_is_not_there_says_so(chart, reference):
    missing = lambda *_: Rendered("P", None, note="left out: P is not installed")  # noqa: E731
    (row,) = peer_rows(chart.scene, reference.planes, 64, [40, 45], peers={"P": missing})
    assert row["note"] == "left out: P is not installed" and row["seconds"] is None


def test_what_the_truth_cannot_judge_says_so(reference):
    known = np.full(2, 50.0)
    truth = Reference(reference.planes, reference.pictures, known, reference.square_error)
    off = [0.02, 0.002]
    pictures = np.stack(
        [np.clip(true - each, 0, 1) for true, each in zip(truth.pictures, off, strict=True)]
    )
    rows = list(plane_rows(truth, pictures, rays=1, scene="chart"))
    assert rows[0]["psnr_true_db"] < 40 < rows[1]["psnr_true_db"]
    assert [row["note"] for row in rows] == [None, TOO_GOOD]

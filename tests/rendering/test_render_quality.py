"""Pictures of a wanted quality: what the pilot says, and what comes of it."""

import numpy as np
import pytest
import trimesh

import lfcore
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.quality import BORDER, LATTICES, PILOT, expectations


@pytest.mark.parametrize("error", [0.002, 0.02])
def test_independent_errors_are_expected_as_they_are(error):
    """Pictures whose mean squared error falls as their rays rise."""
    rng = np.random.default_rng(3)
    made = []
    for count in PILOT:
        noise = rng.normal(0, error / np.sqrt(count.rays_a_pixel), (2, 96, 96, 3))
        noise[1] *= 2
        made.append(srgb_decode(0.5 + noise))
    for (count, db), (same, too_much) in zip(expectations(*made), LATTICES, strict=True):
        assert count == same
        off = error / np.sqrt(count.rays_a_pixel) * np.array([1, 2])
        np.testing.assert_allclose(db + too_much, -20 * np.log10(off), atol=0.2)


def test_more_rays_are_expected_to_be_better():
    pictures = np.random.default_rng(1).random((2, 1, 32, 32, 3))
    expected = [float(db.min()) for _, db in expectations(*pictures)]
    assert expected == sorted(expected) and len(set(expected)) == len(LATTICES)
    counts = [count.rays_a_pixel for count, _ in LATTICES]
    assert counts == sorted(counts)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    file = tmp_path_factory.mktemp("quality") / "ball.glb"
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.visual = trimesh.visual.ColorVisuals(ball, vertex_colors=[200, 120, 60, 255])
    ball.export(file)
    return lfcore.load_scene(file)


@pytest.mark.kernels
def test_the_quality_that_was_asked_for_is_reached(scene):
    camera = scene.camera
    planes = [
        SensorPlane(camera.focus_distance_m * by, camera.f_number, "square") for by in (0.8, 1.2)
    ]
    made = lfcore.render_to_quality(scene, 38, planes=planes, pixels=32)
    assert made.pictures.shape == (2, 32, 32, 3) and made.expected_db.min() >= 38
    many = lfcore.render(scene, planes=planes, pixels=32, views=16, subpixels=4)
    border = int(BORDER * 32)
    inner = np.s_[border:-border, border:-border]
    for picture, truth in zip(made.pictures, many, strict=True):
        assert psnr(srgb_encode(picture[inner]), srgb_encode(truth[inner]), peak=1) > 37


@pytest.mark.kernels
def test_a_quality_beyond_all_lattices_is_refused(scene):
    with pytest.raises(lfcore.OpticsError, match="quality: 95 dB takes more than 4,096 rays"):
        lfcore.render_to_quality(scene, 95, pixels=16)
    with pytest.raises(lfcore.OpticsError, match="quality: must be a positive number"):
        lfcore.render_to_quality(scene, float("nan"), pixels=16)

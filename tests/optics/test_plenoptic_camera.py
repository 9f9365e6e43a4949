"""The plenoptic camera: real geometry, the photograph, views of it, refocusing it."""

from dataclasses import replace

import numpy as np
import pytest
from plain_scenes import CHART

from lfcore import Camera, OpticsError, SensorPlane
from lfcore.cli import main
from lfcore.optics import bundles
from lfcore.optics.plenoptic import PlenopticCamera, sub_aperture, sub_apertures
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.plenoptic import photograph, refocus_photograph
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.build import build_scene

CAMERA = Camera(0.12, 0.109, 1.0, 1.33)


def test_geometry_by_hand():
    camera = PlenopticCamera(CAMERA, 512, 16)
    pitch, image = 0.109 / 512, 0.12 * 1.33 / (1.33 - 0.12)
    focal = pitch * image / (0.12 - pitch)
    assert camera.microlens_focal_length_m == pytest.approx(focal)
    # The main lens, seen through a microlens, fills its share of the photosensor: D f / v.
    assert camera.image_pitch_m == pytest.approx(0.12 * focal / image)
    assert camera.hyperfocal_distance_m == pytest.approx(
        focal**2 / (focal / pitch * camera.pixel_pitch_m) + focal
    )
    assert camera.photograph_side == 8192


def test_rays_through_microlenses_are_the_slab():
    """Section 3.3: the two representations have the same rays."""
    camera = PlenopticCamera(CAMERA, 12, 4)
    points, slab = camera.main_lens_points(), camera.slab()
    np.testing.assert_allclose(points, np.tile(slab.lens_positions(), (12, 1)), atol=1e-12)
    pixels = np.array([(0, 0), (11, 3), (5, 7)])
    got, want = camera.bundles(pixels), bundles.macropixels(slab, pixels)
    for a, b in zip(got.rays(), want.rays(), strict=True):
        np.testing.assert_allclose(a, b, atol=1e-7)


def test_main_lens_within_the_hyperfocal_distance_is_refused():
    # Lens samples of 7.5 mm against microlenses of 9 mm.
    with pytest.raises(OpticsError, match="hyperfocal"):
        PlenopticCamera(CAMERA, 12, 16)
    with pytest.raises(OpticsError, match="wider than the main lens"):
        PlenopticCamera(replace(CAMERA, f_number=1.2), 1, 1)
    with pytest.raises(OpticsError, match="pixels"):
        PlenopticCamera(CAMERA, 0, 4)


def test_sub_apertures_by_hand():
    picture = np.arange(6 * 6 * 3).reshape(6, 6, 3)
    assert sub_aperture(picture, 2, 1, 0)[2, 1].tolist() == picture[4, 3].tolist()
    assert sub_apertures(picture, 3).shape == (3, 3, 2, 2, 3)
    with pytest.raises(OpticsError, match="no mosaic"):
        sub_apertures(picture, 4)
    with pytest.raises(OpticsError, match="from 0 to 1"):
        sub_aperture(picture, 2, 2, 0)


def test_photograph_and_what_is_made_of_it():
    """Odd sizes, so that frames do not fill the picture; against planes formed on the fly."""
    tracer = open_tracer(build_scene(CHART))
    camera = PlenopticCamera(CAMERA, 45, 4)
    seen = []
    picture = photograph(tracer, camera, progress=lambda *at: seen.append(at))
    assert picture.shape == (180, 180, 3)
    assert seen[-1] == (45**2, 45**2)
    planes = [SensorPlane(1.33, 1.0), SensorPlane(2.0, 1.0, "square"), SensorPlane(1.0, 2.0)]
    direct = trace_planes(tracer, camera.slab(), planes)
    made = refocus_photograph(camera, picture, planes, filter="nearest")
    # 8-bit YCbCr and 8-bit RGB between: one code of red is up to 0.01 of linear light.
    assert np.abs(made - direct).max() < 0.02
    assert np.abs(made - direct).mean() < 0.002


def test_command(tmp_path):
    names = [str(tmp_path / name) for name in ("photo.png", "near.exr", "corner.ppm")]
    command = ["plenoptic", str(CHART), "-o", names[0], "--pixels", "32", "--views", "4"]
    more = ["--refocus", "1.0", names[1], "--view", "0", "3", names[2]]
    assert main([*command, *more]) == 0
    assert len(list(tmp_path.iterdir())) == 3
    assert main([*command, "--view", "0", "4", names[2]]) == 1

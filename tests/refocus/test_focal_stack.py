"""The fast focal stack: how many additions it takes, and its error against the exact one."""

from dataclasses import replace

import av
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_scenes import CHART

from lfcore import Camera, OpticsError, SensorPlane, Slab
from lfcore.cli import main
from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.refocus.focal_stack import FocalStackSummer, focal_stack, focal_stack_views, plan
from lfcore.refocus.resampling import coverage
from lfcore.refocus.shift_sum import shift_sum, shift_sum_views

CAMERA = Camera(0.2, 0.1, 1.0, 2.0)  # wide: shifts of many pixels


def stack(count, near=1.2, far=6.0, **changes):
    dioptres = np.linspace(1 / near, 1 / far, count)
    return [SensorPlane(float(1 / delta), CAMERA.f_number, **changes) for delta in dioptres]


def layered_views(slab):
    """Views of two textured layers, one before and one behind the recorded focus."""
    s, x = slab.lens_positions(), slab.pixel_tangents()
    views = np.empty((slab.views, slab.views, slab.pixels, slab.pixels, 3), np.float32)
    for j, i in np.ndindex(slab.views, slab.views):
        for depth, far in ((4.0, True), (1.5, False)):
            # Where the ray of each pixel meets the layer, metres.
            across = (s[i] * (1 - depth * CAMERA.delta) + depth * x)[None, :]
            down = (s[j] * (1 - depth * CAMERA.delta) + depth * x)[:, None]
            wave = 0.5 + 0.4 * np.sin(25 * across) * np.cos(31 * down)
            colour = np.stack([wave, 0.7 * wave + 0.1, 1 - wave], -1)
            seen = np.broadcast_to(far | (np.abs(across) < 0.15), wave.shape)
            views[j, i][seen] = colour[seen]
    return views


@pytest.fixture(scope="module")
def slab():
    return Slab(CAMERA, 16, 96)


@pytest.fixture(scope="module")
def views(slab):
    return layered_views(slab)


def test_error_against_the_exact_stack(slab, views):
    """On sRGB codes: some 50 dB and more where every pixel has all views, 38 dB at the border."""
    planes = stack(40)
    fast = focal_stack_views(slab, views, planes)
    exact = shift_sum_views(slab, views, planes)
    found = []
    for plane, ours, theirs in zip(planes, fast, exact, strict=True):
        inside = coverage(slab, plane, "bilinear") > plane.mask(slab).sum() * (1 - 1e-6)
        codes = [255 * srgb_encode(np.clip(p[inside], 0, 1)) for p in (ours, theirs)]
        found.append(psnr(*codes, peak=255))
    assert np.mean(found) > 48, f"{np.mean(found):.1f} dB"
    assert min(found) > 33, f"{min(found):.1f} dB"
    # At the border too there is nothing odd: no pixel is off by much on average.
    assert np.abs(fast - exact).mean() < 0.01


def test_a_hundred_planes_cost_less_than_a_fifth_of_a_hundred_passes(slab):
    planes = stack(100)
    schedule = plan(slab, planes, 0.5)
    exact = len(planes) * int(planes[0].mask(slab).sum())
    assert schedule.additions < exact / 5
    more = plan(slab, stack(50), 0.5)
    assert schedule.additions < 1.9 * more.additions


@given(st.integers(1, 7), st.integers(4, 20), st.floats(1.2, 1.9), st.floats(2.1, 9.0))
@settings(max_examples=20)
def test_constant_light_stays_constant(views, pixels, near, far):
    slab = Slab(CAMERA, views, pixels)
    planes = stack(5, near, far)
    light = np.full((views, views, pixels, pixels, 3), 0.5, np.float32)
    fast = focal_stack_views(slab, light, planes)
    for plane, picture in zip(planes, fast, strict=True):
        inside = coverage(slab, plane, "bilinear") > plane.mask(slab).sum() * (1 - 1e-6)
        np.testing.assert_allclose(picture[inside], 0.5, atol=2e-3)


def test_the_recorded_focus_alone_is_exact(slab, views):
    plane = SensorPlane(2.0, 1.4, "square", normalise="lens")
    fast = focal_stack_views(slab, views, [plane])
    np.testing.assert_allclose(fast, shift_sum_views(slab, views, [plane]), atol=2e-5)


def test_what_it_cannot_do_is_refused(slab):
    planes = stack(3)
    with pytest.raises(OpticsError, match="one aperture"):
        FocalStackSummer(slab, [planes[0], replace(planes[1], f_number=8.0)])
    with pytest.raises(OpticsError, match="magnification"):
        FocalStackSummer(slab, stack(2, keep_magnification=True))
    with pytest.raises(OpticsError, match="no planes"):
        FocalStackSummer(slab, [])
    with pytest.raises(OpticsError, match="tolerance_px"):
        FocalStackSummer(slab, planes, tolerance_px=0)


@pytest.mark.parametrize("kind", ["macropixels", "views"])
def test_from_a_file(tmp_path, kind):
    path = tmp_path / "chart.mkv"
    options = ["--depth", "none", "--pixels", "96", "--views", "4"]
    options += ["--codec", f"ffv1,layout={kind}"]
    assert main(["record", str(CHART), "-o", str(path), *options]) == 0
    planes = [SensorPlane(d, 1.0) for d in (1.0, 1.33, 2.0)]
    fast, exact = focal_stack(path, planes), shift_sum(path, planes)
    assert np.abs(fast - exact).mean() < 0.02
    film = tmp_path / "film.mp4"
    command = ["stack", str(path), "--focus", "1", "1.33", "2", "--method", "blocks"]
    command += ["-o", str(film)]
    assert main(command) == 0
    with av.open(str(film)) as container:
        frames = [
            frame.reformat(format="rgb24", src_colorspace="ITU709").to_ndarray()
            for frame in container.decode(video=0)
        ]
    off = np.abs(np.stack(frames)[:, None] / 255.0 - srgb_encode(fast)).mean((2, 3, 4))
    assert off.shape == (3, 3) and (off.argmin(1) == [0, 1, 2]).all()
    film.unlink()
    assert main([*command, "--filter", "bilinear"]) == 1
    assert not film.exists()

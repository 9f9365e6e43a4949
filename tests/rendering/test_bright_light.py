"""Light above white: traced, stored, read and shown."""

import dataclasses

import numpy as np
import pytest
from plain_scenes import refused, scene, wall

import lfcore
from lfcore import Material
from lfcore.colour import pq_decode, pq_encode, srgb_codes
from lfcore.exr import read_exr_picture
from lfcore.oracle import colour as truth
from lfcore.pictures import read_picture
from lfcore.storage.layout import FrameLayout

CAMERA = lfcore.Camera(focal_length_m=0.1, sensor_width_m=0.05, f_number=1.0, focus_m=1.0)
PIXELS, RADIANCE, DISTANCE = 96, 50.0, 4.0
LAMP_PX, DISC_PX = 4, 0.1 * (1 - 1 / DISTANCE) * PIXELS / CAMERA.field_width
LATTICES = {"depth": lfcore.Lattice(8, 2), "nearest": lfcore.Lattice(64, 1, displaced=False)}
TEN_BITS = 0.02  # the step of PQ from code to code, of light


def lamp(radiance=RADIANCE, **changes):
    """A square lamp far behind what is in focus, before a black wall."""
    half = LAMP_PX / 2 * CAMERA.field_width / PIXELS * DISTANCE
    triangles = np.concatenate([wall(DISTANCE, half), wall(8.0)])
    glow = Material("lamp", (0, 0, 0), emission=(radiance,) * 3)
    return scene(
        triangles, materials=[Material("wall", (0, 0, 0)), glow], clip=False, camera=CAMERA,
        material_ids=np.int32([1, 1, 0, 0]), ambient=(0, 0, 0), background=(0, 0, 0), **changes,
    )  # fmt: skip


def disc(picture):
    """The mean light well inside the lamp's disc."""
    y, x = np.mgrid[:PIXELS, :PIXELS] - (PIXELS - 1) / 2
    return picture[np.hypot(x, y) < DISC_PX / 2 - LAMP_PX * 0.75].mean()


EXPECTED = RADIANCE * LAMP_PX**2 / (np.pi * DISC_PX**2 / 4)


@pytest.mark.kernels
@pytest.mark.parametrize("filter", LATTICES)
def test_a_lamp_out_of_focus_keeps_its_light(filter):
    options = {"pixels": PIXELS, "filter": filter, "views": LATTICES[filter]}
    assert disc(lfcore.render(lamp(), **options)) == pytest.approx(EXPECTED, rel=0.01)
    clipped = dataclasses.replace(lamp(), clip=True)
    assert disc(lfcore.render(clipped, **options)) == pytest.approx(EXPECTED / RADIANCE, rel=0.01)


def test_pq_is_the_standards():
    light = np.geomspace(1e-6, 1, 50)
    np.testing.assert_allclose(pq_encode(light), truth.pq(light), rtol=1e-9)
    np.testing.assert_allclose(pq_decode(pq_encode(light)), light, rtol=1e-6)
    # SMPTE ST 2084: 100 cd/m2 of 10,000.
    assert truth.pq(0.01) == pytest.approx(0.5081, abs=1e-4)


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("encoding", "views"),
    [
        ({}, None),
        ({"depth": False, "layout": "views"}, 8),
        ({"depth": False, "layout": "macropixels", "pixel_format": "yuv444p12le"}, 32),
    ],
)
def test_stored_light_fields_hold_a_lamp(tmp_path, encoding, views):
    spec = lfcore.Encoding("ffv1", **encoding)
    field = lfcore.record(lamp(), tmp_path / "a.mkv", pixels=PIXELS, views=views, encoding=spec)
    assert field.layout.peak == 64 and field.layout.format.bits >= 10
    middle = field.grid[0] // 2
    assert field.view(middle, middle).max() == pytest.approx(RADIANCE, rel=TEN_BITS)
    assert field.view(middle, middle, codes=True).max() == 255
    made = {"as stored": field.refocus()}
    if encoding:
        ways = {"shift-sum": {"method": "shift-sum"}, "bilinear": {"filter": "bilinear"}}
        made |= {name: field.refocus(1.0, **way) for name, way in ways.items()}
    for name, picture in made.items():
        assert picture.sum() / 3 == pytest.approx(RADIANCE * LAMP_PX**2, rel=2 * TEN_BITS), name
    if views != 8:  # whose rays leave gaps
        assert disc(made["as stored"]) == pytest.approx(EXPECTED, rel=2 * TEN_BITS)


@pytest.mark.kernels
def test_dim_scenes_are_stored_as_srgb(tmp_path):
    field = lfcore.record(lamp(0.9), tmp_path / "a.mkv", pixels=32, views=lfcore.Lattice(2))
    assert field.layout.peak is None and "peak" not in field.metadata.to_text()


def test_views_above_white_come_back(tmp_path):
    views = np.random.default_rng(1).uniform(0, 200, (2, 2, 16, 16, 3)).astype(np.float32)
    spec = lfcore.Encoding("ffv1", "yuv444p12le")
    field = lfcore.LightField.from_views(views, 0.01, tmp_path / "a.mkv", encoding=spec)
    assert field.layout.peak == pytest.approx(200, rel=0.01)
    np.testing.assert_allclose(field.views(0, 0, 2, 2), views, rtol=0.05, atol=0.5)


def test_exposure(tmp_path):
    light = np.float32([[[0.2, 0.1, 0.4], [8.0, 4.0, 2.0]]])
    np.testing.assert_allclose(lfcore.exposed(light, -1), light / 2)
    soft = lfcore.exposed(light, 0, True)
    np.testing.assert_array_equal(soft[0, 0], light[0, 0])
    np.testing.assert_allclose(soft[0, 1], np.array([1, 0.5, 0.25]) * (1 - 1 / 32))
    light = np.full((4, 4, 3), 8.0, np.float32)
    lfcore.write_picture(tmp_path / "a.png", light, exposure_ev=-4)
    np.testing.assert_array_equal(read_picture(tmp_path / "a.png"), srgb_codes(light / 16))
    lfcore.write_picture(tmp_path / "a.exr", light, exposure_ev=-4)
    assert read_exr_picture(tmp_path / "a.exr").max() == 8


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: lfcore.exposed(np.ones(3), float("nan")), "exposure_ev"),
        (lambda: lfcore.write_picture("a.png", np.ones((2, 2, 3)), exposure_ev=1e9), "exposure_ev"),
        (lambda: lfcore.Encoding(transfer="hlg"), "transfer"),
        (lambda: FrameLayout("views", 2, 16, peak=8.0), "pixel_format"),
        (lambda: FrameLayout("views", 2, 16, pixel_format="yuv444p10le", peak=1e9), "peak"),
    ],
)
def test_bad_input_is_refused(call, words):
    refused(words, call)

"""Pictures and files of an open shutter, against the mean of many instants."""

import dataclasses

import numpy as np
import pytest
from moving_scene import moving_squares
from plain_scenes import refused

import lfcore
from lfcore.colour import srgb_encode
from lfcore.optics import bundles
from lfcore.optics.slab import Slab
from lfcore.rendering.exposure import ray_times, view_times

PIXELS = 32


@pytest.fixture(scope="module")
def scene():
    return moving_squares()


def psnr(a, b):
    return -10 * np.log10(np.square(srgb_encode(a) - srgb_encode(b)).mean())


def lens(focus_m):
    return {"focus_m": focus_m, "f_number": 4.0, "pixels": PIXELS}


@pytest.mark.parametrize("views", [1, 2, 3, 4, 6])
def test_every_row_and_column_of_views_sees_all_of_the_time(views):
    times = view_times(views).reshape(views, views)
    np.testing.assert_allclose(np.sort(times, axis=None), (np.arange(views**2) + 0.5) / views**2)
    for strip in (*times, *times.T):
        assert sorted((strip * views).astype(int)) == list(range(views))


@pytest.mark.parametrize("views", [1, 2, 4, 6])
def test_every_place_in_squares_of_rays_sees_all_of_the_time(views):
    times = ray_times(views)
    count = max(views**2, 4)
    for place in times.reshape(-1, 4).T if views > 1 else times.reshape(1, 4):
        np.testing.assert_allclose(np.sort(place), (np.arange(count) + 0.5) / count)
    assert (np.ptp(np.sort(times.reshape(-1, 4), 1), 1) >= 0.5).all()


@pytest.mark.parametrize("band", [None, (2, 3), (1, 2)])
def test_every_second_ray_is_one_of_all(band):
    slab = Slab.of(lfcore.Camera(0.1, 0.08, 1.0, 2.5), 2, (7, 5))
    whole = bundles.views(slab, np.array([[0, 1], [1, 1]]))
    first, count = band or (0, whole.rows)
    rays = [each[:, first : first + count] for each in whole.rays()]
    seen = np.zeros((count, whole.columns), int)
    for row in (0, 1):
        for column in (0, 1):
            some = dataclasses.replace(whole, band=band).every_second(row, column)
            place = np.s_[(row - first) % 2 :: 2, column::2]
            seen[place] += 1
            for part, expected in zip(some.rays(), rays, strict=True):
                part = part[:, some.first_row :][:, : some.traced_rows]
                np.testing.assert_allclose(part, expected[:, *place], rtol=1e-6, atol=1e-7)
    assert (seen == 1).all()


def test_a_picture_is_near_the_mean_of_many_instants(scene):
    shutter = 0.1, 0.5
    instants = shutter[0] + (np.arange(48) + 0.5) / 48 * (shutter[1] - shutter[0])
    expected = np.mean([lfcore.render(scene.at(t), **lens(2.0)) for t in instants], axis=0)
    got = lfcore.render(scene.exposed(*shutter), **lens(2.0))
    still = lfcore.render(scene.at(0.3), **lens(2.0))
    # With whole views at an instant each it is 53.3 dB.
    assert psnr(got, expected) > 57 > 34 > psnr(still, expected)


def test_without_motion_nothing_changes(scene):
    still = scene.at(0.25)
    assert still.exposed(0, 1) is still
    before = lfcore.render(still, **lens(2.0))
    np.testing.assert_array_equal(lfcore.render(scene.exposed(0.25, 0.25), **lens(2.0)), before)
    # After the end of the motion all instants are the same.
    after = lfcore.render(scene.at(2), **lens(2.0))
    rests = lfcore.scene.model.replace(scene, animation=None, shutter=(0.0, 1.0))
    np.testing.assert_array_equal(
        lfcore.render(rests, **lens(2.0)), lfcore.render(scene.at(0), **lens(2.0))
    )
    assert np.abs(after - before).max() > 0.1


@pytest.mark.slow
def test_files_and_films_have_the_blur_of_pictures(scene, tmp_path):
    how = {"pixels": PIXELS, "encoding": lfcore.Encoding("ffv1")}
    field = lfcore.record(scene.exposed(0.1, 0.5), tmp_path / "one.mkv", **how)
    expected = lfcore.render(scene.exposed(0.1, 0.5), focus_m=2.5, pixels=PIXELS)
    assert field.content["shutter_s"] == [0.1, 0.5]
    assert psnr(field.refocus(focus_m=2.5), expected) > 40
    film = lfcore.record(scene.exposed(-0.1, 0.3), tmp_path / "film.mkv", times=[0, 0.2], **how)
    np.testing.assert_array_equal(film.at(1).views(0, 0, 4, 4), field.views(0, 0, 4, 4))


def test_what_an_open_shutter_excludes(scene, tmp_path):
    exposed, path = scene.exposed(0, 1), tmp_path / "no.mkv"
    refused("opens at 1 and closes at 0", scene.exposed, 1, 0)
    refused("filter 'nearest'", lfcore.render, exposed, filter="nearest", pixels=8)
    plain = lfcore.Encoding(depth=False)
    refused("without depth", lfcore.record, exposed, path, encoding=plain, pixels=8)
    refused("each instant", lfcore.record, exposed, path, times=[0], bake_each=True, pixels=8)
    refused("camera array does not show", lfcore.trace_array, exposed)

"""Light fields as tiled EXR: what comes back, and what is refused."""

import json

import numpy as np
import OpenEXR
import pytest
from plain_scenes import refused

from lfcore import CameraArray, OpticsError, StorageError, write_picture
from lfcore.exr import read_exr_picture
from lfcore.storage.tiled_exr import ATTRIBUTE, FORMAT, VERSION, read_array, write_array


@pytest.fixture
def array():
    return CameraArray.on_grid((4, 3), (-1, 1, -2, 2), 50.0, (32, 16), "cells")


@pytest.fixture
def image(array):
    width, height = array.image_size
    rng = np.random.default_rng(0)
    return (rng.random((height, width, 3)) * 1e4).astype(np.float32)


@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_radiance_and_geometry_come_back(tmp_path, array, image, dtype):
    path, half = tmp_path / "field.exr", dtype == np.float16
    write_array(path, image, array, half=half, extra={"scene": "chart"})
    found = read_array(path)
    np.testing.assert_array_equal(found.image, image.astype(dtype), strict=True)
    assert found.array == array and found.extra == {"scene": "chart"}
    with OpenEXR.File(str(path)) as file:
        tiles = file.header()["tiles"]
        assert (tiles.xSize, tiles.ySize) == array.tile
    assert [p.name for p in tmp_path.iterdir()] == ["field.exr"]


def test_single_channels_and_missing_channels(tmp_path):
    plane = np.random.default_rng(0).random((4, 6), np.float32)
    OpenEXR.File({}, {"Y": plane}).write(str(tmp_path / "y.exr"))
    np.testing.assert_array_equal(read_exr_picture(tmp_path / "y.exr")[..., 2], plane)
    OpenEXR.File({}, {"A": plane, "Z": plane}).write(str(tmp_path / "az.exr"))
    refused("channels", read_exr_picture, tmp_path / "az.exr")


def test_a_header_that_contradicts_the_picture(tmp_path, array, image):
    path = tmp_path / "field.exr"
    write_array(path, image, array)
    with OpenEXR.File(str(path)) as file:
        text = file.header()[ATTRIBUTE]
    OpenEXR.File({ATTRIBUTE: text}, {"RGB": image[:-2].copy()}).write(str(tmp_path / "cut.exr"))
    refused("lightfield: .*tiles", read_array, tmp_path / "cut.exr")


def test_nothing_is_left_when_writing_fails(tmp_path, array, image):
    with pytest.raises(OpticsError):
        write_array(tmp_path / "a.exr", image[:-1], array)
    refused("cannot be written", write_array, tmp_path / "no" / "a.exr", image, array)
    refused("picture", write_picture, tmp_path / "a.exr", image[..., :2])
    assert not list(tmp_path.iterdir())


def test_a_damaged_geometry_is_refused(tmp_path, array, image):
    """Each digit of the geometry in turn, but the last of long numbers, which change nothing."""
    path = tmp_path / "field.exr"
    write_array(path, image, array)
    whole, unlike = path.read_bytes(), 0
    start = whole.index(b'{"format"')
    for place in range(start, whole.index(b'"extra"', start)):
        if not chr(whole[place]).isdigit():
            continue
        flipped = bytearray(whole)
        flipped[place] ^= 1
        path.write_bytes(flipped)
        try:
            assert read_array(path).array == array
        except StorageError as error:
            assert "field.exr" in str(error)
            unlike += 1
    assert unlike > 20


def test_a_geometry_without_digest_is_read_and_a_foreign_exr_has_none(tmp_path, array, image):
    """As files were written before."""
    text = json.dumps({"format": FORMAT, "version": VERSION, "array": array.to_json()})
    for header, expected in (({ATTRIBUTE: text}, array), ({}, None)):
        OpenEXR.File(header, {"RGB": image}).write(str(tmp_path / "field.exr"))
        assert read_array(tmp_path / "field.exr").array == expected

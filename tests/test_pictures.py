"""Picture files: what is written is what comes back, and what is damaged is refused."""

import numpy as np
import pytest
from PIL import Image

from lfcore.colour import srgb_codes, srgb_decode
from lfcore.errors import LfcoreError
from lfcore.exchange.pictures import read_pfm
from lfcore.exr import read_exr_picture
from lfcore.pictures import read_codes, write_picture

CODES = np.random.default_rng(3).integers(0, 256, (13, 17, 3), np.uint8)
LIGHT = np.random.default_rng(4).random((13, 17, 3)).astype(np.float32)


@pytest.mark.parametrize("suffix", [".png", ".ppm", ".bmp", ".tif", ".tiff"])
def test_codes_come_back(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_picture(path, CODES)
    with Image.open(path) as image:  # an independent reader
        assert (np.asarray(image.convert("RGB")) == CODES).all()
    assert (read_codes(path) == CODES).all()
    write_picture(path, LIGHT)
    assert (read_codes(path) == srgb_codes(LIGHT)).all()


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bits_come_back(tmp_path, suffix):
    deep = CODES.astype(np.uint16) * 257 + 3
    write_picture(tmp_path / f"a{suffix}", deep)
    found = read_codes(tmp_path / f"a{suffix}")
    assert found.dtype == np.uint16 and (found == deep).all()


def test_light_comes_back_as_floats(tmp_path):
    write_picture(tmp_path / "a.npy", LIGHT)
    assert (np.load(tmp_path / "a.npy") == LIGHT).all()
    write_picture(tmp_path / "a.exr", LIGHT)
    assert (read_exr_picture(tmp_path / "a.exr") == LIGHT).all()
    write_picture(tmp_path / "a.pfm", LIGHT)
    data = (tmp_path / "a.pfm").read_bytes()
    values = np.frombuffer(data[-LIGHT.nbytes :], "<f4").reshape(LIGHT.shape)
    assert data.startswith(b"PF\n17 13\n-1.0\n") and (values[::-1] == LIGHT).all()


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(LfcoreError, match=r"none\.png: cannot be read: No such file"):
        read_codes(tmp_path / "none.png")
    with pytest.raises(LfcoreError, match=r"a\.gif: unknown format"):
        write_picture(tmp_path / "a.gif", CODES)
    with pytest.raises(LfcoreError, match=r"cannot be written as \.jpg"):
        write_picture(tmp_path / "a.jpg", np.zeros((2, 2, 7), np.uint8))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", [".exr", ".pfm"])
def test_codes_of_16_bits_become_linear_light(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    codes = np.full((4, 4, 3), 32768, np.uint16)
    write_picture(path, codes)
    read = read_exr_picture(path) if suffix == ".exr" else read_pfm(path)
    np.testing.assert_allclose(read, srgb_decode(np.float32(32768 / 65535)), rtol=1e-6)

"""The sensor: its linear model, repeatable noise, saturation, colour filter, files and refusals."""

import hashlib

import cv2
import numpy as np
import pytest
from plain_scenes import refused

import lfcore
from lfcore.cli import main


def flat(light, side=600):
    return np.full((side, side, 3), light, np.float32)


@pytest.mark.parametrize(
    ("sensor", "slope", "offset"),
    [
        # Electrons at white: 15000 by 100 / ISO; codes 64 to 4095.
        (lfcore.Sensor(iso=400, read_noise_e=3), 4031 / 3750, (4031 / 3750 * 3) ** 2 + 1 / 12),
        (lfcore.Sensor(photons=1000, quantum_efficiency=0.5, bits=10, black_level=0),
         1023 / 500, (2 * 1023 / 500) ** 2 + 1 / 12),
    ],
)  # fmt: skip
def test_variance_is_an_affine_function_of_the_mean(sensor, slope, offset):
    for number, light in enumerate(np.linspace(0.05, 0.8, 10)):
        raw = sensor.raw(flat(light), number).astype(float)
        signal = raw.mean() - sensor.black_level
        assert signal == pytest.approx(light * (sensor.white - sensor.black_level), rel=1e-3)
        assert raw.var() == pytest.approx(slope * signal + offset, rel=0.01)


def test_noise_depends_on_the_seed_and_the_pictures_number_alone():
    sensor, pictures = lfcore.Sensor(iso=1600, seed=3), np.stack([flat(0.3, 16)] * 3)
    whole = sensor.raw(pictures, 5)
    assert np.array_equal(whole[2], sensor.raw(pictures[2], 7))
    assert (whole[0] != whole[1]).any()
    other = lfcore.Sensor(iso=1600, seed=4).raw(pictures[0], 5)
    assert (other != whole[0]).any()
    # The bits of every machine.
    assert hashlib.sha256(whole.tobytes()).hexdigest()[:16] == "2df1bc453b0f5631"


def test_codes_saturate_and_black_is_at_its_level():
    sensor = lfcore.Sensor(read_noise_e=0)
    assert (sensor.raw(flat(0.0, 4)) == 64).all() and (sensor.raw(flat(50.0, 4)) == 4095).all()
    dim = lfcore.Sensor(photons=1e6, full_well_e=1000, read_noise_e=0)  # the well fills at .0017
    assert (dim.raw(flat(0.5, 4)) == 4095).all()
    assert sensor.developed(sensor.raw(flat(1.0)))[..., 1].mean() == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("bayer", ["RGGB", "GBRG"])
def test_a_bayer_pattern_samples_a_colour_per_pixel_and_is_demosaiced(bayer):
    pytest.importorskip("colour_demosaicing")
    sensor = lfcore.Sensor(bayer=bayer, full_well_e=1e7, bits=16)
    light = flat(1.0, 33) * np.array([0.2, 0.4, 0.6], np.float32)
    raw = sensor.raw(light)
    levels = dict(zip("RGB", (0.2, 0.4, 0.6), strict=True))
    for (y, x), letter in zip(np.ndindex(2, 2), bayer, strict=True):
        shares = (raw[y::2, x::2] - 64.0) / (65535 - 64)
        assert shares.mean() == pytest.approx(levels[letter], abs=1e-3)
    assert raw.shape == (33, 33)
    assert np.abs(sensor.developed(raw) - light).max() < 0.01


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"read_noise_e": -1}, "read_noise_e: must be a number from 0"),
        ({"bits": 0}, "bits: must be a whole number from 1 to 16, not 0"),
        ({"bits": 12.5}, "bits: must be a whole number"),
        ({"black_level": 4095}, "black_level: must be a whole number from 0 to 4094"),
        ({"iso": float("nan")}, "iso"),
        ({"iso": 100, "photons": 5}, "iso: excludes photons"),
        ({"bayer": "RGBG"}, "bayer: 'RGBG' is no pattern"),
        ({"izo": 100}, "izo: unknown key. Did you mean 'iso'"),
    ],
)
def test_what_no_sensor_is(keys, words, capsys):
    refused(words, lfcore.Sensor.of, keys)
    text = ",".join(f"{key}={value}" for key, value in keys.items())
    with pytest.raises(SystemExit):
        main(["render", "example", "-o", "a.png", "--sensor", text])
    said = capsys.readouterr().err
    assert words.split(":")[0] in said and said.count("\n") == 1


def test_raw_codes_are_in_tiff_and_dng(tmp_path):
    rawpy, _ = pytest.importorskip("rawpy"), pytest.importorskip("pidng")
    y, x = np.mgrid[:32, :48] / np.float32(48)
    light = np.stack([x, y, x * 0 + 0.3], -1)
    sensor = lfcore.Sensor(iso=200, bayer="GRBG")
    raw = sensor.raw(light)
    for name in ("a.tif", "a.dng"):
        sensor.write_raw(tmp_path / name, raw)
    assert np.array_equal(cv2.imread(str(tmp_path / "a.tif"), cv2.IMREAD_UNCHANGED), raw)
    with rawpy.imread(str(tmp_path / "a.dng")) as file:
        assert np.array_equal(file.raw_image, raw)
        assert file.black_level_per_channel[0] == 64 and file.white_level == 4095
        linear = {"gamma": (1, 1), "no_auto_bright": True, "output_bps": 16, "use_camera_wb": True}
        found = file.postprocess(**linear) / 65535
    assert np.abs(found - light)[4:-4, 4:-4].mean() < 0.01
    refused("holds a Bayer pattern", lfcore.Sensor().write_raw, tmp_path / "b.dng", raw)


def test_the_command_writes_raw_codes_and_developed_pictures(tmp_path, capsys):
    sensor = lfcore.Sensor(iso=400, seed=2)
    small = ["--pixels", "24", "--views", "2", "--sensor", "iso=400,seed=2"]
    for name in ("clean.npy", "a.tif", "a.npy"):
        words = ["render", "example", "-o", str(tmp_path / name), *small]
        assert main(words[:-2] if name == "clean.npy" else words) == 0
    light = np.load(tmp_path / "clean.npy")
    raw = cv2.imread(str(tmp_path / "a.tif"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert np.array_equal(raw, sensor.raw(light))
    assert np.array_equal(np.load(tmp_path / "a.npy"), sensor.exposed(light))
    capsys.readouterr()
    assert main(["render", "example", "-o", str(tmp_path / "a.tif"), *small[:-2]]) == 1
    assert main(["render", "example", "-o", str(tmp_path / "a.tif"), *small, "--bits", "16"]) == 1
    assert main(["render", "example", "-o", str(tmp_path / "a.dng"), *small]) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 3 and "'.tif'" in said[0] and "--bits" in said[1] and "bayer" in said[2]

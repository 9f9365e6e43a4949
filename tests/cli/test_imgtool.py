"""The imgtool command: both years' options, headers, contradictions."""

import io
from contextlib import redirect_stderr

import cv2
import numpy as np
import pytest

import lfcore
from lfcore import CameraArray, write_picture
from lfcore.cli import imgtool, main, parser
from lfcore.exr import read_exr_picture
from lfcore.storage.tiled_exr import write_array

GRID = (-0.6, 0.6, -0.4, 0.4)


@pytest.fixture(scope="module")
def array():
    return CameraArray.on_grid((4, 3), GRID, 50.0, (32, 32))


@pytest.fixture(scope="module")
def folder(array, tmp_path_factory):
    """Has a light field with geometry, and the same pixels as pbrt would write them."""
    folder = tmp_path_factory.mktemp("imgtool")
    image = np.random.default_rng(0).random((96, 128, 3)).astype(np.float16).astype(np.float32)
    write_array(folder / "ours.exr", image, array)
    write_picture(folder / "pbrt.exr", image, half=True)
    return folder


def run(*words):
    """Exit status of ``lfcore imgtool``, and what it said."""
    with redirect_stderr(io.StringIO()) as said:
        status = main(["imgtool", *(str(word) for word in words)])
    return status, said.getvalue()


FLAGS = ["--camsperdim", 4, 3, "--griddim", *GRID, "--inputfov", 50]


@pytest.mark.kernels
@pytest.mark.parametrize(
    "options",
    [
        ["--filterwidth", 0.3, "--focalplanez", 6.8, "--camerapos", -0.15, -0.2, -1.2],
        ["--montecarlo", "--lensradius", 0.1, "--samplesperpixel", 4, "--focalplanez", 3],
        ["--focaldistance", 6.8, "--camerarot", 5, -2.8, 0, "--samplesperpixel", 2],
        ["--sampler", "quadrature", "--lensradius", 0.1, "--samplesperpixel", 16],
        ["--focalsurface", "plane:0,0,5,0.3,0.1,1", "--filterwidth", 0.5],
        ["--focalsurface", "sphere:0,0,5,2", "--filterwidth", 0.5],
    ],
)
def test_header_and_flags_give_the_same_picture(folder, options):
    options = [*options, "--outputdim", 20, 14, "--outputfov", 40]
    assert run("lightfield", *options, folder / "ours.exr", folder / "a.exr")[0] == 0
    device = lfcore.open_device().name
    status, said = run(
        "lightfield", *options, *FLAGS, "--device", device, folder / "pbrt.exr",
        "-o", folder / "b.exr",
    )  # fmt: skip
    assert status == 0 and "outside the array" in said
    ours, pbrt = read_exr_picture(folder / "a.exr"), read_exr_picture(folder / "b.exr")
    assert ours.shape == (14, 20, 3) and ours.any()
    np.testing.assert_allclose(ours, pbrt, atol=1e-6)
    agree = run("lightfield", *options, *FLAGS, folder / "ours.exr", folder / "c.exr")
    assert agree[0] == 0


def test_top_left_tile_is_the_top_left_camera(folder, array):
    """With y up on the command line, camera (xmin, ymax) gives tile (0, 0)."""
    options = ["--camerapos", GRID[0], GRID[3], 0, "--outputfov", 50, "--outputdim", 32, 32]
    options += ["--filterwidth", 0.01]
    assert run("lightfield", *options, folder / "ours.exr", folder / "t.exr")[0] == 0
    corner = read_exr_picture(folder / "pbrt.exr")[:32, :32]
    np.testing.assert_allclose(read_exr_picture(folder / "t.exr"), corner, atol=1e-4)


@pytest.mark.parametrize(
    ("line", "method"),
    [
        ("--focalplanez 6.8 --camerapos -0.15 -0.2 -1.2 --inputfov 50 --outputfov 40 "
         "--filterwidth 0.3 --griddim -0.6 0.6 -0.4 0.4 --camsperdim 4 3 --outputdim 30 30",
         "isaksen"),
        ("--montecarlo --lensradius 0.15 --samplesperpixel 4 --focalplanez 6.8 --camerapos -0.15 "
         "-0.2 -1.2 --inputfov 50 --outputfov 40 --filterwidth 0.3 --griddim -0.6 0.6 -0.4 0.4 "
         "--camsperdim 4 3 --outputdim 30 30", "montecarlo"),
        ("--samplesperpixel 16 --focaldistance 6.8 --camerarot 5 -2.8 0 --camerapos 0.3 0.35 -0.8 "
         "--inputfov 50 --outputfov 40 --lensradius 0.3 --griddim -0.6 0.6 -0.4 0.4 "
         "--camsperdim 4 3 --outputdim 60 60", "montecarlo"),
    ],
)  # fmt: skip
def test_both_years_command_lines_are_taken_as_they_are(folder, line, method):
    """On an EXR without geometry, as pbrt writes it; of the handouts only the grid is smaller."""
    words = [*line.split(), str(folder / "pbrt.exr"), str(folder / "year.exr")]
    command = ["imgtool", "lightfield", *words]
    assert imgtool.chosen_method(parser(command).parse_args(command)) == method
    status, said = run("lightfield", *words)
    assert status == 0 and method in said and "outside the array" in said
    size = int(line.split()[-1])
    assert read_exr_picture(folder / "year.exr").shape == (size, size, 3)


@pytest.mark.parametrize(
    ("options", "file", "words"),
    [
        (["--camsperdim", 2, 3], "ours.exr", "--camsperdim: contradicts the header"),
        (["--inputfov", 51], "ours.exr", "--inputfov: contradicts"),
        (["--griddim", -1, 1, -1, 1], "ours.exr", "--griddim: contradicts"),
        (["--spacing", "cells"], "ours.exr", "--spacing: contradicts"),
        (["--lensradius", 0.1], "ours.exr", "--montecarlo"),
        (["--sampler", "quadrature", "--montecarlo"], "ours.exr", "exclude"),
        (["--focaldistance", 3, "--filterwidth", 0.1], "ours.exr", "Isaksen"),
        (["--focalplanez", -3], "ours.exr", "behind"),
        (["--filterwidth", 0.01], "ours.exr", "no pixel sees"),
        (["--camsperdim", 5, 3], "pbrt.exr", "do not divide"),
        ([], "text.exr", "text.exr"),
    ],
)
def test_contradictions_are_errors(folder, options, file, words):
    (folder / "text.exr").write_text("not a picture")
    status, said = run("lightfield", *options, folder / file, folder / "never.exr")
    assert status == 1 and words in said
    assert not (folder / "never.exr").exists()


def test_realistic_lens(folder, tmp_path):
    (tmp_path / "lens.dat").write_text("50 4 1.5 20\n-50 2 1 20\n0 45 0 16\n")
    lens = f"{tmp_path / 'lens.dat'},stop=8,film=20"
    options = ["--lens", lens, "--samplesperpixel", 8, "--outputdim", 12, 8, "--focaldistance", 5]
    assert run("lightfield", *options, folder / "ours.exr", folder / "r.exr")[0] == 0
    assert 0.2 < read_exr_picture(folder / "r.exr")[3:5, 5:7].mean() < 0.9


def test_convert(tmp_path):
    ramp = np.linspace(0, 8, 256, dtype=np.float32)[None, :, None].repeat(4, 0).repeat(3, 2)
    write_picture(tmp_path / "ramp.exr", ramp)
    for name, options in (("plain.png", []), ("mapped.png", ["--tonemap"])):
        words = ["convert", *options, tmp_path / "ramp.exr", tmp_path / name]
        assert run(*words)[0] == 0
    plain, mapped = (cv2.imread(str(tmp_path / n))[0, :, 0] for n in ("plain.png", "mapped.png"))
    # Clipping loses everything above one; the tone map keeps the order up to the brightest.
    assert (plain[33:] == 255).all() and mapped[128] < mapped[-1] == 255
    status, said = run("convert", tmp_path / "ramp.exr", "-o", tmp_path / "x.what")
    assert status == 1 and "unknown format" in said
    status, said = run("convert", tmp_path / "ramp.exr")
    assert status == 1 and "--output" in said

"""What is incomplete, contradicts itself or is not known: one line that names it, and no file."""

import json
from pathlib import Path

import numpy as np
import pytest
from noise_fields import noise, store
from PIL import Image
from plain_scenes import CHART

from lfcore.api import load_scene
from lfcore.cli import main
from lfcore.errors import DeviceError, LfcoreError
from lfcore.exchange import FORMATS, export_lightfield, import_lightfield
from lfcore.exchange.grid import Geometry, ReadOptions, WriteOptions
from lfcore.exchange.source import Selection


def refused(folder, *words, options=None, format=None):
    """The import fails with one line that has all the words, and leaves nothing behind."""
    with pytest.raises(LfcoreError) as error:
        import_lightfield(folder, folder.parent / "lf" / "x.mkv", format=format, options=options)
    text = str(error.value)
    assert "\n" not in text
    for word in words:
        assert word in text
    out = folder.parent / "lf"
    assert not out.exists() or not list(out.iterdir())


@pytest.fixture
def hci(square, tmp_path):
    export_lightfield(square.path, "hci", tmp_path / "hci")
    return tmp_path / "hci"


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (Path.unlink, ["9 views"]),
        (lambda file: Image.new("RGB", (15, 16)).save(file), ["16 x 16"]),
        (lambda file: file.write_bytes(file.read_bytes()[:300]), []),
    ],
)
def test_a_view_that_is_missing_or_unlike_the_others(hci, spoil, words):
    spoil(hci / "input_Cam004.png")
    refused(hci, "input_Cam004.png", *words)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("baseline_mm", "base", "extrinsics.baseline_mm"),
        ("num_cams_x = 3", "num_cams_x = many", "num_cams_x"),
        ("num_cams_x = 3", "num_cams_x = 0", "no views"),
        ("[extrinsics]", "[extrinsics", "parameters.cfg"),
        ("focal_length_mm = ", "focal_length_mm = -", "focal_length_mm"),
        ("baseline_mm = ", "baseline_mm = nan #", "baseline_mm"),
        ("baseline_mm = ", "baseline_mm = -", "--baseline"),
    ],
)
def test_parameters_that_make_no_sense(hci, old, new, word):
    config = hci / "parameters.cfg"
    config.write_text(config.read_text().replace(old, new))
    refused(hci, word)


def test_names_with_positions(square, tmp_path):
    export_lightfield(square.path, "stanford", tmp_path / "out")
    file = next((tmp_path / "out").glob("out_01_02_*"))
    file.unlink()
    refused(tmp_path / "out", "row 1 and column 2", "8 of 3 x 3")


def test_numbered_views(tmp_path):
    (tmp_path / "in").mkdir()
    for name in ("00_00", "00_01", "01_00"):
        Image.new("RGB", (16, 16)).save(tmp_path / "in" / f"{name}.png")
    refused(tmp_path / "in", "row 1 and column 1", "3 of 2 x 2")
    refused(tmp_path / "in", "holds 3 pictures", options=ReadOptions((2, 2)))
    refused(tmp_path / "in", "cannot be read as a picture", format="eslf")
    Image.new("RGB", (8, 16)).save(tmp_path / "in" / "01_01.png")
    refused(tmp_path / "in", "01_01.png", "8 x 16")


def test_ppm_that_is_cut_short_or_none(square, tmp_path):
    export_lightfield(square.path, "jpeg-pleno", tmp_path / "out")
    file = tmp_path / "out" / "002_001.ppm"
    whole = file.read_bytes()
    file.write_bytes(whole[:-1])
    refused(tmp_path / "out", "002_001.ppm", f"{len(whole)} expected")
    file.write_bytes(whole.replace(b"P6", b"P5"))
    refused(tmp_path / "out", "002_001.ppm")


def test_nothing_is_recognised(tmp_path):
    refused(tmp_path / "nowhere", "no such file")
    (tmp_path / "in").mkdir()
    refused(tmp_path / "in", "known format", "--format")
    (tmp_path / "in" / "notes.txt").write_text("views\n")
    (tmp_path / "in" / "more.txt").write_text("views\n")
    refused(tmp_path / "in", "known format")
    refused(tmp_path / "in", "'nex'", format="nex")
    refused(tmp_path / "in", "cannot be imported", format="plenoptic")
    for name in "hci nerfstudio stanford jpeg-pleno folder blender json llff colmap".split():
        refused(tmp_path / "in", "in", format=name)


@pytest.mark.parametrize("name", ["lf.mat", "lf.h5", "a_qs2x2a1.png", "b.eslf.png"])
def test_files_of_noise(name, tmp_path):
    if name.endswith("h5"):
        pytest.importorskip("h5py")
    (tmp_path / name).write_bytes(np.random.default_rng(1).bytes(999))
    refused(tmp_path / name, name)


def test_json_of_poses(square, tmp_path):
    export_lightfield(square.path, "nerfstudio", tmp_path / "out")
    file = tmp_path / "out" / "transforms.json"
    good = json.loads(file.read_text())

    def changed(words, change):
        data = json.loads(json.dumps(good))
        change(data)
        file.write_text(json.dumps(data))
        refused(tmp_path / "out", *words)

    changed(["view_001_001.png", "looks in another direction"],
            lambda d: d["frames"][4]["transform_matrix"][0].__setitem__(0, 0.9))  # fmt: skip
    changed(["before or behind"],
            lambda d: d["frames"][4]["transform_matrix"][1].__setitem__(3, 0.1))  # fmt: skip
    changed(["no full grid"], lambda d: d["frames"].pop())
    changed(["transform_matrix"], lambda d: d["frames"][2].pop("transform_matrix"))
    changed(["fl_x"], lambda d: d.pop("fl_x"))
    changed(["gone.png"], lambda d: d["frames"][2].update(file_path="gone.png"))
    file.write_text("[1, 2")
    refused(tmp_path / "out", "transforms.json")


def test_exports_that_cannot_be(unknown, square, tmp_path):
    def fails(words, path, format, **more):
        with pytest.raises(LfcoreError) as error:
            export_lightfield(path, format, tmp_path / "out", **more)
        for word in words:
            assert word in str(error.value)
        assert list(tmp_path.iterdir()) == []

    for name in ("hci", "nerfstudio", "colmap", "llff", "blender"):
        fails(["does not hold its geometry", "--baseline"], unknown.path, name)
    fails(["'folder' cannot be exported"], square.path, "folder")
    fails(["not a multiple of the 4 mm"], square.path, "hci", selection=Selection(baseline_m=0.006))
    fails(["--views"], square.path, "hci", selection=Selection((4, 4)))
    fails(["--crop"], square.path, "hci", selection=Selection(crop=(1, 1, 16, 16)))


def test_a_folder_that_is_there_is_left_alone(square, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("keep\n")
    with pytest.raises(LfcoreError, match="exists already"):
        export_lightfield(square.path, "json", tmp_path / "out")
    assert [file.name for file in tmp_path.iterdir()] == ["out"]


def test_another_scene_is_refused(square, tmp_path):
    chart = load_scene(CHART)
    with pytest.raises(LfcoreError, match="is not the scene of"):
        export_lightfield(square.path, "hci", tmp_path / "out", scene=chart)


def test_the_command_line(tmp_path, capsys):
    stored = store(tmp_path, noise(2, 2, 16, 16), Geometry())
    out = str(tmp_path / "out")
    assert main(["export", str(stored.path), "--format", "hci", "-o", out]) == 1
    assert "--field-of-view" in capsys.readouterr().err
    assert main(["export", str(stored.path), "--format", "stanford", "-o", out]) == 0
    lf = tmp_path / "lf.mkv"
    assert main(["import", out, "-o", str(lf), "--codec", "ffv1"]) == 0
    assert "geometry is not known" in capsys.readouterr().err
    command = ["import", out, "-o", str(lf), "--baseline", "6mm", "--field-of-view", "40"]
    assert main([*command, "--focus", "1.5"]) == 0
    assert "not known" not in capsys.readouterr().err
    assert main(["import", out, "-o", str(lf), "--order", "across"]) == 1
    assert "--order" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*command, "--focus", "x"])


def test_poses_of_others(square, tmp_path):
    export_lightfield(square.path, "colmap", tmp_path / "colmap")
    model = tmp_path / "colmap" / "sparse" / "0"
    cameras = (model / "cameras.txt").read_text()
    (model / "cameras.txt").write_text(cameras.replace("PINHOLE", "THIN_PRISM_FISHEYE"))
    refused(tmp_path / "colmap", "cameras.txt", "THIN_PRISM", "Models that can be")
    (model / "cameras.txt").write_text(cameras)
    (tmp_path / "colmap" / "images" / "view_001_001.png").unlink()
    refused(tmp_path / "colmap", "view_001_001.png", "images.txt asks")
    options = WriteOptions(near_m=1, far_m=2)
    export_lightfield(square.path, "llff", tmp_path / "llff", options=options)
    poses = tmp_path / "llff" / "poses_bounds.npy"
    rows = np.load(poses)
    np.save(poses, rows[:-1])
    refused(tmp_path / "llff", "8 poses for 9 pictures")
    rows[4, 0] = np.nan
    np.save(poses, rows)
    refused(tmp_path / "llff", "not finite")
    poses.write_bytes(b"no array")
    refused(tmp_path / "llff", "poses_bounds.npy")


def test_an_unknown_device_is_refused_by_every_format(square, tmp_path):
    for name in FORMATS:
        if FORMATS[name].exports:
            with pytest.raises(DeviceError, match="nosuch"):
                export_lightfield(square.path, name, tmp_path / "out", device="nosuch")
    assert not list(tmp_path.iterdir())


def test_notes_are_those_of_one_export(square, tmp_path):
    options = WriteOptions()
    first, second = (
        list(export_lightfield(square.path, "quilt", tmp_path / name, options=options))
        for name in "ab"
    )
    assert first and first == second

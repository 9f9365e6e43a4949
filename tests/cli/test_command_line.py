"""The ``lfcore`` command: what it writes, what it says, what it leaves behind when it fails."""

import argparse
import json
import os
import subprocess
import sys

import av
import numpy as np
import pytest
from PIL import Image
from plain_scenes import CHART, balls

import lfcore
from lfcore import load_scene, render
from lfcore.cli import COMMANDS, main, parser, values
from lfcore.colour import srgb_encode
from lfcore.exchange.pictures import read_pfm
from lfcore.exr import read_exr_picture
from lfcore.pictures import read_codes

SIZE, VIEWS = 24, 4


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A light field file of the chart."""
    path = tmp_path_factory.mktemp("cli") / "chart.mkv"
    options = ["--depth", "none", "--pixels", str(SIZE), "--views", str(VIEWS), "--codec", "ffv1"]
    assert main(["record", str(CHART), "-o", str(path), *options]) == 0
    return path


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_refocus_equals_the_library(recorded, tmp_path):
    out, field = tmp_path / "out.npy", lfcore.LightField.open(recorded)
    beyond = {"focus_m": field.distance_of(-0.5), "f_number": field.f_number_of(3)}
    assert 1 / beyond["focus_m"] < field.slab.camera.delta
    for options, settings in (
        ("--focus 1 --method slicing --filter nearest", {"focus_m": 1, "method": "slicing"}),
        ("--focus 1 --filter bilinear", {"focus_m": 1, "filter": "bilinear"}),
        ("--focus -0.5px --f-number 3views", beyond),
        ("--plane focus=-0.5px,f_number=3views", beyond),
        ("--focus 1.1 --f-number 2", {"focus_m": 1.1, "f_number": 2}),
    ):
        assert main(["refocus", str(recorded), *options.split(), "-o", str(out)]) == 0
        picture = field.refocus(**settings)
        assert picture.shape == (SIZE, SIZE, 3) and picture.dtype == np.float32
        np.testing.assert_array_equal(np.load(out), picture)
    assert main(["refocus", str(recorded), *options.split(), "-o", str(tmp_path / "a.exr")]) == 0
    np.testing.assert_array_equal(read_exr_picture(tmp_path / "a.exr"), picture)


def test_what_a_terminal_cannot_show_is_shown_as_its_code(recorded, tmp_path):
    path = tmp_path / "caf\N{LATIN SMALL LETTER E WITH ACUTE}.mkv"
    path.write_bytes(recorded.read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "lfcore.cli", "info", path], capture_output=True, timeout=60,
        env=os.environ | {"PYTHONIOENCODING": "ascii", "LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert rb"caf\xe9.mkv" in done.stdout


def test_many_planes_from_options_and_files(recorded, tmp_path):
    assert main(
        ["refocus", str(recorded), "--plane", "focus=1,aperture=square", "--aperture", "polygon:5"]
        + ["--plane", "focus=2,f_number=4,normalise=no", "-o", str(tmp_path / "a.png")]
    ) == 0  # fmt: skip
    assert names(tmp_path) == ["a_00_focus1m_f1_square.png", "a_01_focus2m_f4_polygon.png"]
    bright, dim = (np.asarray(Image.open(tmp_path / name)).mean() for name in names(tmp_path))
    assert dim < 0.6 * bright
    rows = tmp_path / "planes.csv"
    rows.write_text("focus,f_number,aperture\n1.0,1,circle\n1.5,,diamond\ninf,2,square\n")
    out = tmp_path / "b.npy"
    assert main(["refocus", str(recorded), "--plane", str(rows), "-o", str(out)]) == 0
    assert np.load(out).shape == (3, SIZE, SIZE, 3)
    rows = tmp_path / "planes.yaml"
    rows.write_text("- {focus: 1.0, f_number: 1.4}\n- {focus: 2, keep_magnification: true}\n")
    assert main(["refocus", str(recorded), "--plane", str(rows), "-o", str(out)]) == 0
    assert np.load(out).shape == (2, SIZE, SIZE, 3)


def test_info(recorded, capsys):
    assert main(["info", str(recorded), "--verify"]) == 0
    text = capsys.readouterr().out
    assert f"{SIZE} x {SIZE} pixels, {VIEWS} x {VIEWS} views" in text
    assert "120 mm f/1" in text
    assert main(["info", str(recorded), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["metadata"]["scene"]["name"] == "chart" and found["damage"] == []
    assert found["bytes"] == recorded.stat().st_size


def test_programs_are_told_in_one_line_of_json(recorded, tmp_path, capsys):
    """With ``--json`` there is one object on standard output and nothing on standard error."""
    picture, depth = tmp_path / "a.png", tmp_path / "d.npz"
    small = ["--pixels", "16", "--views", "2"]
    for command, files, rays in (
        (["render", CHART, *small, "-o", picture], [picture], (2 * 2 * 16) ** 2),
        (
            ["record", CHART, *small, "--focus", "inf", "-o", tmp_path / "t.mkv"],
            [tmp_path / "t.mkv"],
            (4 * 2 * 16) ** 2,
        ),
        (["depth", CHART, *small, "-o", depth], [depth], (2 * 16) ** 2),
        (["stack", recorded, "--focus", "1", "2", "--sheet", "-o", picture], [picture], None),
        (["refocus", recorded, "-o", picture], [picture], None),
        (["plenoptic", CHART, "--pixels", "8", "--views", "2", "-o", picture], [picture], None),
        (["view", recorded, "--grid", "2", "-o", picture], [picture], None),
        (["imgtool", "tiles", recorded, "-o", tmp_path / "t.exr"], [tmp_path / "t.exr"], None),
        (["info", tmp_path / "t.mkv", "--verify"], [], None),
    ):
        assert main([str(word) for word in (*command, "--json")]) == 0
        out, err = capsys.readouterr()
        assert err == "" and out.count("\n") == 1
        told = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
        assert told["command"] in command[:2]
        assert told["files"] == [{"file": str(f), "bytes": f.stat().st_size} for f in files]
        assert len(told["steps"]) == 1 and told["steps"][0]["seconds"] >= 0
        if rays:
            assert told["steps"][0]["rays"] == rays
            assert told["scene"]["triangles"] == 6
    # What JSON has no number for is text.
    assert told["metadata"]["slab"]["camera"]["focus_distance_m"] == "inf"


def test_a_folder_that_is_written_is_told_with_its_bytes(recorded, tmp_path, capsys):
    views, back = tmp_path / "views", tmp_path / "back.mkv"
    assert main(["export", str(recorded), "--format", "json", "-o", str(views), "--json"]) == 0
    size = sum(file.stat().st_size for file in views.rglob("*") if file.is_file())
    assert json.loads(capsys.readouterr().out)["files"] == [{"file": str(views), "bytes": size}]
    assert main(["import", str(views), "-o", str(back), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["files"][0]["bytes"] == back.stat().st_size


def test_view_macropixel_and_grid(recorded, tmp_path):
    field = lfcore.LightField.open(recorded)
    one, lens, grid = (tmp_path / name for name in ("one.png", "lens.ppm", "grid.png"))
    assert main(["view", str(recorded), "--view", "3", "0", "-o", str(one)]) == 0
    np.testing.assert_array_equal(np.asarray(Image.open(one)), field.view(3, 0, codes=True))
    assert main(["view", str(recorded), "--macropixel", "5", "7", "-o", str(lens)]) == 0
    np.testing.assert_array_equal(np.asarray(Image.open(lens)), field.macropixel(5, 7, codes=True))
    assert main(["view", str(recorded), "--grid", "2", "-o", str(grid)]) == 0
    sheet = np.asarray(Image.open(grid))
    np.testing.assert_array_equal(sheet[:SIZE, SIZE:], field.view(3, 0, codes=True))


def test_stacks(recorded, tmp_path):
    film, sheet = tmp_path / "film.mp4", tmp_path / "sheet.png"
    focus = ["--focus", "1:2:7"]
    assert main(["stack", str(recorded), *focus, "-o", str(film)]) == 0
    with av.open(str(film)) as container:
        assert sum(1 for _ in container.decode(video=0)) == 7
    lens = ["--f-number", "1", "2", "4", "8", "16", "--no-normalise", "--sheet"]
    assert main(["stack", str(recorded), *lens, "-o", str(sheet)]) == 0
    rows = np.asarray(Image.open(sheet).convert("L"))
    strip = (len(rows) - 4) // 2 - SIZE
    assert rows.shape[1] == 4 * SIZE + 12 and strip > 8
    labels = [rows[SIZE : SIZE + strip, x : x + SIZE] for x in range(0, 100, SIZE + 4)]
    assert all(label.min() < 180 and np.median(label) > 200 for label in labels)  # ink on paper
    assert (labels[0] != labels[1]).any()
    assert main(["stack", str(recorded), "--focus", "1", "2", "-o", str(tmp_path / "s.png")]) == 0
    assert len(list(tmp_path.glob("s_0*_focus*.png"))) == 2


NO_DEVICE = "--device: no OpenCL device is named like 'nosuch'"
REFUSED = [
    ("refocus FILE --f-number 0.5 -o a.png", "wider than the lens"),
    ("refocus FILE --focus 0.05 -o a.png", "inside the focal length"),
    ("refocus FILE --plane focus=1,colour=red -o a.png", "unknown key 'colour'"),
    ("refocus FILE --plane focus=nearest -o a.png", "--plane: focus: 'nearest' is no focus"),
    ("refocus FILE --method slicing --filter bilinear -o a.png", "no bilinear filter"),
    ("refocus FILE --plane missing.csv -o a.png", "missing.csv: No such file"),
    ("refocus FILE --device nosuch -o a.png", NO_DEVICE),
    ("view FILE -o a.png --device nosuch", NO_DEVICE),
    ("view FILE --grid 2 -o a.png --device nosuch", NO_DEVICE),
    ("view FILE -o a.html --device nosuch", NO_DEVICE),
    ("export FILE --format nerfstudio -o a --device nosuch", NO_DEVICE),
    ("stack FILE -o a.mp4 --device nosuch", NO_DEVICE),
    ("refocus FILE -o a.gif", ".png"),
    ("refocus FILE --bits 16 -o a.jpg", "16"),
    *((f"{command} {name} -o a.png", name)
      for command in ("refocus", "stack", "view") for name in ("CUT", "none.mkv", "CHART")),
    ("record none.glb -o a.mkv", "none.glb"),
    ("render none.glb -o a.png", "none.glb"),
    ("render CHART --quality-db 40 --views 4 -o a.png", "--quality-db: chooses the rays itself"),
    ("render CHART --quality-db 40 --filter nearest -o a.png", "--quality-db: chooses the rays"),
    ("render CHART --most-rays 9 -o a.png", "--quality-db: is what"),
    ("render CHART --pixels 16 --filter nearest --subpixels 0.5 -o a.png", "16 pixels is finer"),
    ("depth CHART -o a.png --format disparity", "--format: "),
    ("depth CHART -o a.npz --lightfield x.mkv --views 3", "--views: "),
    ("depth CHART", "--output: "),
    ("depth -o a.png", "scene: is missing. Give a scene, or"),
    ("depth --lightfield FILE -o a.png", "scene: holds no depth. Give the scene"),
    ("render CHART --views 0 -o a.png", "argument --views: "),
    ("render CHART --pixels 0 -o a.png", "argument --pixels: "),
    ("render CHART --subpixels -1 -o a.png", "argument --subpixels: "),
    ("render CHART --quality-db nan -o a.png", "argument --quality-db: "),
    ("render CHART --focus 0 -o a.png", "argument --focus: "),
    ("render CHART --samples 0 -o a.png", "argument --samples: "),
    ("render CHART --samples 4:0 -o a.png", "argument --samples: "),
    ("record CHART --views 1.5 -o a.png", "argument --views: "),
    ("record CHART --focus-range 1 -2 -o a.png", "argument --focus-range: "),
    ("record CHART --crf 99 -o a.png", "argument --crf: "),
    ("record CHART --codec ffv2 -o a.png", "argument --codec: "),
    ("record CHART --codec ffv1,pixel_format=rgb -o a.png", "argument --codec: "),
    ("import x --codec ffv1,layout=views -o a.png", "argument --codec: "),
    ("plenoptic CHART --pixels 8 --views 2 --view 0 2 b.png -o a.png", "from 0 to 1"),
    ("imgtool convert FOLDER -o a.png", "FOLDER"),
    ("imgtool tiles FOLDER -o a.exr", "FOLDER"),
    ("info FOLDER", "FOLDER"),
    ("render CHART --pixels 16 --views 2 -o /proc/none/a.png", "/proc/none"),
    ("view x.mkv --grid 0 -o a.png", "argument --grid: "),
    ("view x.mkv --jpeg-quality 101 -o a.png", "argument --jpeg-quality: "),
    ("refocus x.mkv --f-number 0views -o a.png", "argument --f-number: "),
    ("refocus x.mkv --aperture polygon:2 -o a.png", "argument --aperture: "),
    ("stack x.mkv --focus 1:2:1 -o a.png", "argument --focus: "),
    ("stack x.mkv --focus 1:2px:3 -o a.png", "argument --focus: "),
    ("stack x.mkv --fps 0 -o a.png", "argument --fps: "),
    ("export x.mkv --format hci --depth-range 0 1 -o a.png", "argument --depth-range: "),
    ("import x --baseline -6mm -o a.png", "argument --baseline: "),
    ("render CHART --focus nearest -o a.png", "argument --focus: "),
    ("render CHART --focus near --focus-at 0.5,0.5 -o a.png", "argument --focus-at: "),
    ("render CHART --focus-at 0.5 -o a.png", "argument --focus-at: "),
    ("render CHART --f-number 2 --blur 3% -o a.png", "argument --blur: "),
    ("render CHART --blur 0% -o a.png", "argument --blur: "),
    ("render MESH --from below -o a.png", "front"),
    ("render MESH --focus 0.5 -o a.png", "near or far"),
    ("render MESH --focus-at 0.01,0.01 -o a.png", "--focus-at: there is nothing"),
    ("info none.mkv --json", "none.mkv"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "said"), REFUSED)
def test_what_cannot_be_is_said_in_one_line_and_leaves_no_file(
    recorded, mesh, tmp_path, capsys, monkeypatch, line, said
):
    (tmp_path / "in").mkdir()
    cut = tmp_path / "in" / "cut.mkv"
    cut.write_bytes(recorded.read_bytes()[:-2000])
    places = {"FILE": str(recorded), "CUT": str(cut), "CHART": str(CHART / "scene.yaml"),
              "FOLDER": str(tmp_path / "in"), "MESH": str(mesh)}  # fmt: skip
    monkeypatch.chdir(tmp_path)
    try:
        status = main([places.get(word, word) for word in line.split()])
    except SystemExit as stop:
        status = stop.code
    out, err = capsys.readouterr()
    *before, message = err.splitlines()
    assert places.get(said, said) in message and names(tmp_path) == ["in"]
    assert status == (2 if said.startswith("argument") else 1)
    assert not (before and status == 2) and not ("--json" in line and (before or out))


@pytest.mark.kernels
def test_rays_of_whole_subpixels_are_counted(tmp_path, capsys):
    out = ["-o", str(tmp_path / "a.png"), "--pixels", "16"]
    words = ["render", str(CHART), "--filter", "nearest", "--subpixels", "2", *out, "--json"]
    assert main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["steps"][0]["rays"] == (16 * 32) ** 2  # 16 x 16 lens samples by 32 x 32 pixels
    assert main(["render", str(CHART), "--quality-db", "30", *out]) == 0
    assert "dB expected" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["render", "imgtool tiles"])
def test_an_unknown_option_names_its_command(capsys, command):
    with pytest.raises(SystemExit):
        main([*command.split(), "x", "-o", "y", "--sise", "4"])
    said = capsys.readouterr().err
    assert said.startswith(f"lfcore {command}: ") and "--sise" in said and said.count("\n") == 1


def test_export_reads_views_on_the_device_that_is_named(tmp_path, monkeypatch):
    """In Python, too, and without a scene to trace."""
    import lfcore.exchange.source as source

    device, used, file = lfcore.open_device(), [], tmp_path / "chart.mkv"
    words = ["--pixels", "8", "--views", "2", "--codec", "layout=macropixels", "-o", str(file)]
    assert main(["record", str(CHART), "--depth", "none", *words]) == 0

    def read_views(*_, device=None, **__):
        used.append(device)
        raise lfcore.StorageError("far enough")

    monkeypatch.setattr(source, "read_views", read_views)
    with pytest.raises(lfcore.StorageError, match="far enough"):
        lfcore.export_lightfield(file, "nerfstudio", tmp_path / "a", device=device)
    assert used == [device]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_help_teaches(name, capsys):
    with pytest.raises(SystemExit) as stop:
        main([name, "--help"])
    assert stop.value.code == 0
    text = capsys.readouterr().out
    assert f"lfcore {name}" in text
    for line in text.splitlines():
        if line.startswith("  lfcore "):  # an example, and perhaps what it does
            words = line.split("   ")[0].split()[1:] if "   " in line.strip() else line.split()[1:]
            assert parser(words).parse_args(words).command


def test_a_stack_without_a_number(recorded, tmp_path, monkeypatch, capsys):
    """From near to far, as the file holds them: evenly in dioptres."""
    field = lfcore.LightField.open(recorded)
    near, far = field.depth_range
    assert near == pytest.approx(1.0, rel=0.05)
    assert main(["info", str(recorded)]) == 0
    assert f"{near:.4g} to {far:.4g} m" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path)
    assert main(["stack", str(recorded), "--sheet"]) == 0
    assert Image.open("chart_stack.png").width == 4 * SIZE + 12
    assert main(["stack", str(recorded), "--focus", "near:far:4", "-o", "s.npy"]) == 0
    expected = [field.refocus(1 / d) for d in np.linspace(1 / near, 1 / far, 4)]
    np.testing.assert_array_equal(np.load("s.npy"), expected)


def test_pictures_of_other_formats(recorded, tmp_path):
    deep = tmp_path / "a.png"
    assert main(["refocus", str(recorded), "--bits", "16", "-o", str(deep)]) == 0
    codes = read_codes(deep)
    assert codes.dtype == np.uint16
    light = lfcore.LightField.open(recorded).refocus()
    np.testing.assert_array_equal(codes, np.rint(65535 * srgb_encode(light.astype(np.float64))))
    for name in ("a.jpg", "a.webp"):
        assert main(["refocus", str(recorded), "-o", str(tmp_path / name)]) == 0
        assert np.abs(np.asarray(Image.open(tmp_path / name)) - codes / 257).mean() < 8


def test_depth_to_look_at(tmp_path):
    command = ["depth", str(CHART), "--pixels", str(SIZE), "-o"]
    for name in ("d.pfm", "d.exr", "d.png"):
        assert main([*command, str(tmp_path / name)]) == 0
    depth = read_pfm(tmp_path / "d.pfm")
    np.testing.assert_array_equal(read_exr_picture(tmp_path / "d.exr")[..., 1], depth)
    look = np.asarray(Image.open(tmp_path / "d.png")).astype(int)
    near = depth == depth.min()
    assert (look[near][:, 0] > look[near][:, 2]).all()
    far = depth == depth[np.isfinite(depth)].max()
    assert (look[far][:, 0] < look[far][:, 2]).all()


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A large model: a ball of 800 m with a smaller one before it."""
    path = tmp_path_factory.mktemp("meshes") / "balls.ply"
    balls().apply_scale(800).export(path)
    return path


def made(command, mesh, out, *options):
    assert main([command, str(mesh), "-o", str(out), "--pixels", "32", *options]) == 0
    return np.load(out) if out.suffix == ".npy" else out


def test_words_give_the_pictures_of_the_library(mesh, tmp_path):
    side = {"view_from": "right", "zoom": 1.5}
    for options, view, settings in (
        ("--focus near", {}, {"focus_m": "near"}),
        ("--focus 40% --blur 3%", {}, {"focus_m": "40%", "blur": 0.03}),
        ("--focus-at 0.5,0.5", {}, {"focus_at": (0.5, 0.5)}),
        ("--plane focus=far,blur=3%", {}, {"focus_m": "far", "blur": 0.03}),
        ("--from right --zoom 1.5", side, {}),
    ):
        found = made("render", mesh, tmp_path / "a.npy", *options.split())
        np.testing.assert_array_equal(
            found, render(load_scene(mesh, **view), pixels=32, **settings)
        )
    assert np.abs(found - render(load_scene(mesh), pixels=32)).max() > 0.1


def test_distances_are_reported(mesh, tmp_path, capsys):
    scene = load_scene(mesh)
    near, far = scene.depth_range
    made("render", mesh, tmp_path / "a.png", "--focus", "near")
    assert (
        f"near {near:.4g} m" in (said := capsys.readouterr().err) and f"focus {near:.4g} m" in said
    )
    made("render", mesh, tmp_path / "a.png", "--focus", "near", "--json")
    found = json.loads(capsys.readouterr().out)
    assert (found["near_m"], found["far_m"]) == (near, far)
    assert found["planes"][0]["focus_m"] == near
    assert main(["info", str(mesh)]) == 0
    assert f"near {near:.4g} m" in capsys.readouterr().out
    assert main(["info", str(mesh), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["far_m"] == far


def test_a_pinhole_is_not_recorded_without_a_word(tmp_path, capsys):
    path = tmp_path / "hole.pbrt"
    path.write_text(
        'Camera "perspective" "float fov" [40]\nWorldBegin\n'
        'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [-3 -2 9  1 -2 8  -1 3 7]\n'
    )
    made("record", path, tmp_path / "a.mkv")
    assert "is a pinhole" in capsys.readouterr().err
    made("record", path, tmp_path / "b.mkv", "--blur", "3%", "--focus", "middle")
    assert "is a pinhole" not in capsys.readouterr().err
    made("plenoptic", path, tmp_path / "a.png", "--views", "4")
    assert "is a pinhole" in capsys.readouterr().err
    export = ["export", str(tmp_path / "a.mkv"), "--format", "hci", "--scene", str(path)]
    assert main([*export, "-o", str(tmp_path / "hci")]) == 0


def test_a_sky_on_the_command_line():
    dim = {"colour": "#0f0f0f", "strength": 2}
    for text, found in (
        ("#ffffff", {"sky": {"colour": "#ffffff"}}), (",bounces=2", {"bounces": 2}),
        ("#0f0f0f,strength=2,bounces=0", {"sky": dim, "bounces": 0}),
    ):  # fmt: skip
        assert values.sky(text) == found
    for text in ("#ffffff,bounce=1", ",bounces=-1", ",strength=2"):
        with pytest.raises(argparse.ArgumentTypeError):
            values.sky(text)

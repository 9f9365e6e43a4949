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
from lfcore.pictures import read_picture

SIZE, VIEWS = 24, 4


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """A light field file of the chart."""
    path = tmp_path_factory.mktemp("cli") / "chart.mkv"
    options = ["--depth", "none", "--pixels", str(SIZE), "--views", str(VIEWS), "--codec", "ffv1"]
    assert main(["record", str(CHART), "-o", str(path), *options]) == 0
    return path


@pytest.fixture(scope="module")
def mesh(tmp_path_factory):
    """A large model: a ball of 800 m with a smaller one before it."""
    path = tmp_path_factory.mktemp("meshes") / "balls.ply"
    balls().apply_scale(800).export(path)
    return path


@pytest.fixture
def run(recorded, mesh, tmp_path, monkeypatch):
    """A function that runs a command line in an empty folder, which must not fail."""
    monkeypatch.chdir(tmp_path)
    places = {"FILE": recorded, "CHART": CHART, "MESH": mesh}

    def run(line):
        assert main([str(places.get(word, word)) for word in line.split()]) == 0

    return run


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_refocus_equals_the_library(recorded, run):
    field = lfcore.LightField.open(recorded)
    beyond = {"focus_m": field.distance_of(-0.5), "f_number": field.f_number_of(3)}
    assert 1 / beyond["focus_m"] < field.slab.camera.delta
    for options, settings in (
        ("--focus 1 --method slicing --filter nearest", {"focus_m": 1, "method": "slicing"}),
        ("--focus 1 --filter bilinear", {"focus_m": 1, "filter": "bilinear"}),
        ("--focus -0.5px --f-number 3views", beyond),
        ("--plane focus=-0.5px,f_number=3views", beyond),
        ("--focus 1.1 --f-number 2", {"focus_m": 1.1, "f_number": 2}),
    ):
        run(f"refocus FILE {options} -o out.npy")
        picture = field.refocus(**settings)
        assert picture.shape == (SIZE, SIZE, 3) and picture.dtype == np.float32
        np.testing.assert_array_equal(np.load("out.npy"), picture)
    run(f"refocus FILE {options} -o a.exr")
    np.testing.assert_array_equal(read_exr_picture("a.exr"), picture)


def test_what_a_terminal_cannot_show_is_shown_as_its_code(recorded, tmp_path):
    path = tmp_path / "caf\N{LATIN SMALL LETTER E WITH ACUTE}.mkv"
    path.write_bytes(recorded.read_bytes())
    done = subprocess.run(
        [sys.executable, "-m", "lfcore", "info", path], capture_output=True, timeout=60,
        env=os.environ | {"PYTHONIOENCODING": "ascii", "LC_ALL": "C.UTF-8"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert rb"caf\xe9.mkv" in done.stdout


def test_many_planes_from_options_and_files(run, tmp_path):
    run(
        "refocus FILE --plane focus=1,aperture=square --aperture polygon:5 "
        "--plane focus=2,f_number=4,normalise=lens -o a.png"
    )
    assert names(tmp_path) == ["a_00_focus1m_f1_square.png", "a_01_focus2m_f4_polygon.png"]
    bright, dim = (np.asarray(Image.open(name)).mean() for name in names(tmp_path))
    assert dim < 0.6 * bright
    for file, text, planes in (
        ("a.csv", "focus,f_number,aperture\n1.0,1,circle\n1.5,,diamond\ninf,2,square\n", 3),
        ("a.yaml", "- {focus: 1.0, f_number: 1.4}\n- {focus: 2, keep_magnification: true}\n", 2),
    ):
        (tmp_path / file).write_text(text)
        run(f"refocus FILE --plane {file} -o b.npy")
        assert np.load("b.npy").shape == (planes, SIZE, SIZE, 3)


def test_info(recorded, run, capsys):
    run("info FILE --verify")
    text = capsys.readouterr().out
    assert f"{SIZE} x {SIZE} pixels, {VIEWS} x {VIEWS} views" in text
    assert "120 mm f/1" in text
    run("info FILE --json")
    found = json.loads(capsys.readouterr().out)
    assert found["metadata"]["scene"]["name"] == "chart" and found["damage"] == []
    assert found["bytes"] == recorded.stat().st_size


def test_programs_are_told_in_one_line_of_json(run, tmp_path, capsys):
    """With ``--json`` there is one object on standard output and nothing on standard error."""
    for line, rays in (
        ("render CHART --pixels 16 --views 2 -o a.png", (2 * 2 * 16) ** 2),
        ("record CHART --pixels 16 --views 2 --focus inf -o t.mkv", (4 * 2 * 16) ** 2),
        ("depth CHART --pixels 16 --views 2 -o d.npz", (2 * 16) ** 2),
        ("stack FILE --focus 1 2 --sheet -o a.png", None),
        ("refocus FILE -o a.png", None),
        ("plenoptic CHART --pixels 8 --views 2 -o a.png", None),
        ("view FILE --grid 2 -o a.png", None),
        ("imgtool tiles FILE -o t.exr", None),
        ("info t.mkv --verify", None),
    ):
        run(f"{line} --json")
        out, err = capsys.readouterr()
        assert err == "" and out.count("\n") == 1
        told = json.loads(out, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
        assert told["command"] in line.split()[:2]
        files = [tmp_path / file for file in line.split(" -o ")[1:]]
        assert told["files"] == [{"file": f.name, "bytes": f.stat().st_size} for f in files]
        assert len(told["steps"]) == 1 and told["steps"][0]["seconds"] >= 0
        if rays:
            assert told["steps"][0]["rays"] == rays
            assert told["scene"]["triangles"] == 6
    # What JSON has no number for is text.
    assert told["metadata"]["slab"]["camera"]["focus_distance_m"] == "inf"


def test_a_folder_that_is_written_is_told_with_its_bytes(run, tmp_path, capsys):
    run("export FILE --format json -o views --json")
    size = sum(file.stat().st_size for file in tmp_path.rglob("*") if file.is_file())
    assert json.loads(capsys.readouterr().out)["files"] == [{"file": "views", "bytes": size}]
    run("import views -o back.mkv --json")
    written = (tmp_path / "back.mkv").stat().st_size
    assert json.loads(capsys.readouterr().out)["files"][0]["bytes"] == written


def test_view_macropixel_and_grid(recorded, run):
    field = lfcore.LightField.open(recorded)
    view = field.view(3, 0, codes=True)
    for options, expected in (
        ("--view 3 0 -o a.png", view),
        ("--macropixel 5 7 -o a.ppm", field.macropixel(5, 7, codes=True)),
    ):
        run(f"view FILE {options}")
        np.testing.assert_array_equal(np.asarray(Image.open(options.split()[-1])), expected)
    run("view FILE --grid 2 -o a.png")
    np.testing.assert_array_equal(np.asarray(Image.open("a.png"))[:SIZE, SIZE:], view)


def test_stacks(run, tmp_path):
    run("stack FILE --focus 1:2:7 -o film.mp4")
    with av.open("film.mp4") as container:
        assert sum(1 for _ in container.decode(video=0)) == 7
    run("stack FILE --f-number 1 2 4 8 16 --normalise lens --sheet -o sheet.png")
    rows = np.asarray(Image.open("sheet.png").convert("L"))
    strip = (len(rows) - 4) // 2 - SIZE
    assert rows.shape[1] == 4 * SIZE + 12 and strip > 8
    labels = [rows[SIZE : SIZE + strip, x : x + SIZE] for x in range(0, 100, SIZE + 4)]
    assert all(label.min() < 180 and np.median(label) > 200 for label in labels)  # ink on paper
    assert (labels[0] != labels[1]).any()
    run("stack FILE --focus 1 2 -o s.png")
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
    ("render CHART --most-rays 9 -o a.png", "--quality-db: is missing"),
    ("render CHART --quality-db 99 --pixels 16 -o a.png", "or allow more rays (--most-rays)"),
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
    ("record CHART --frames 0:2 --fps 0 -o a.mkv", "argument --fps: "),
    ("record CHART --frames 5:2 -o a.mkv", "argument --frames: "),
    ("record CHART --frames 0:2000000000 -o a.mkv", "argument --frames: "),
    ("record CHART --shutter 0.2:0.1 -o a.mkv", "argument --shutter: "),
    ("render CHART --shutter 0:inf -o a.png", "argument --shutter: "),
    ("import x --baseline -6mm -o a.png", "argument --baseline: "),
    ("render CHART --focus nearest -o a.png", "argument --focus: "),
    ("render CHART --focus near --focus-at 0.5,0.5 -o a.png", "argument --focus-at: "),
    ("render CHART --focus-at 0.5 -o a.png", "argument --focus-at: "),
    ("render CHART --f-number 2 --blur 3% -o a.png", "argument --blur: "),
    ("render CHART --blur 0% -o a.png", "argument --blur: "),
    ("render MESH --from below -o a.png", "front"),
    ("render MESH --focus 0.5 -o a.png", "near or far"),
    ("render MESH --focus-at 0.01,0.01 -o a.png", "--focus-at: no surface"),
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
def test_rays_of_whole_subpixels_are_counted(run, capsys):
    run("render CHART --pixels 16 --filter nearest --subpixels 2 -o a.png --json")
    told = json.loads(capsys.readouterr().out)
    assert told["steps"][0]["rays"] == (16 * 32) ** 2  # 16 x 16 lens samples by 32 x 32 pixels
    run("render CHART --pixels 16 --quality-db 30 -o a.png")
    assert "dB expected" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["render", "imgtool tiles"])
def test_an_unknown_option_names_its_command(capsys, command):
    with pytest.raises(SystemExit):
        main([*command.split(), "x", "-o", "y", "--sise", "4"])
    said = capsys.readouterr().err
    assert said.startswith(f"lfcore {command}: ") and "--sise" in said and said.count("\n") == 1


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


def test_a_stack_without_a_number(recorded, run, capsys):
    """From near to far, as the file holds them: evenly in dioptres."""
    field = lfcore.LightField.open(recorded)
    near, far = field.depth_range
    assert near == pytest.approx(1.0, rel=0.05)
    run("info FILE")
    assert f"{near:.4g} to {far:.4g} m" in capsys.readouterr().out
    run("stack FILE --sheet")
    assert Image.open("chart_stack.png").width == 4 * SIZE + 12
    run("stack FILE --focus near:far:4 -o s.npy")
    expected = [field.refocus(1 / d) for d in np.linspace(1 / near, 1 / far, 4)]
    np.testing.assert_array_equal(np.load("s.npy"), expected)


def test_pictures_of_other_formats(recorded, run):
    run("refocus FILE --bits 16 -o a.png")
    codes = read_picture("a.png")
    assert codes.dtype == np.uint16
    light = lfcore.LightField.open(recorded).refocus()
    np.testing.assert_array_equal(codes, np.rint(65535 * srgb_encode(light.astype(np.float64))))
    for name in ("a.jpg", "a.webp"):
        run(f"refocus FILE -o {name}")
        assert np.abs(np.asarray(Image.open(name)) - codes / 257).mean() < 8


def test_depth_to_look_at(run, tmp_path):
    for name in ("d.pfm", "d.exr", "d.png"):
        run(f"depth CHART --pixels {SIZE} -o {name}")
    depth = read_pfm(tmp_path / "d.pfm")
    np.testing.assert_array_equal(read_exr_picture("d.exr")[..., 1], depth)
    look = np.asarray(Image.open("d.png")).astype(int)
    near = depth == depth.min()
    assert (look[near][:, 0] > look[near][:, 2]).all()
    far = depth == depth[np.isfinite(depth)].max()
    assert (look[far][:, 0] < look[far][:, 2]).all()


def test_words_give_the_pictures_of_the_library(mesh, run):
    side = {"view_from": "right", "zoom": 1.5}
    for options, view, settings in (
        ("--focus near", {}, {"focus_m": "near"}),
        ("--focus 40% --blur 3%", {}, {"focus_m": "40%", "blur": 0.03}),
        ("--focus-at 0.5,0.5", {}, {"focus_at": (0.5, 0.5)}),
        ("--plane focus=far,blur=3%", {}, {"focus_m": "far", "blur": 0.03}),
        ("--from right --zoom 1.5", side, {}),
    ):
        run(f"render MESH --bare --pixels 32 {options} -o a.npy")
        scene = load_scene(mesh, bare=True, **view)
        found, expected = np.load("a.npy"), render(scene, pixels=32, **settings)
        np.testing.assert_array_equal(found, expected)
    assert np.abs(found - render(load_scene(mesh, bare=True), pixels=32)).max() > 0.1


def test_distances_are_reported(mesh, run, capsys):
    near, far = load_scene(mesh).depth_range
    run("render MESH --pixels 32 --focus near -o a.png")
    said = capsys.readouterr().err
    assert f"near {near:.4g} m" in said and f"focus {near:.4g} m" in said
    run("render MESH --pixels 32 --focus near -o a.png --json")
    found = json.loads(capsys.readouterr().out)
    assert (found["near_m"], found["far_m"]) == (near, far)
    assert found["planes"][0]["focus_m"] == near
    run("info MESH")
    assert f"near {near:.4g} m" in capsys.readouterr().out
    run("info MESH --json")
    assert json.loads(capsys.readouterr().out)["far_m"] == far


def test_a_pinhole_is_not_recorded_without_a_word(run, tmp_path, capsys):
    (tmp_path / "hole.pbrt").write_text(
        'Camera "perspective" "float fov" [40]\nWorldBegin\n'
        'Shape "trianglemesh" "integer indices" [0 1 2] "point P" [-3 -2 9  1 -2 8  -1 3 7]\n'
    )
    for line, warned in (
        ("record hole.pbrt --pixels 32 -o a.mkv", True),
        ("record hole.pbrt --pixels 32 -o b.mkv --blur 3% --focus middle", False),
        ("plenoptic hole.pbrt --pixels 32 --views 4 -o a.png", True),
    ):
        run(line)
        assert ("is a pinhole" in capsys.readouterr().err) == warned
    run("export a.mkv --format hci --scene hole.pbrt -o hci")


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

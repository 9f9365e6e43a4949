"""What settings and sweeps ask for: scenes, tiles, planes, cases; and what cannot be."""

import math
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from plain_scenes import refused

from lfcore import Camera, Encoding, SensorPlane, Slab, open_device
from lfcore.cli import parser
from lfcore.cli.command import encoder
from lfcore.errors import SettingsError
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.evaluation.sweep import sweep_figure, sweep_rows
from lfcore.evaluation.table_files import read_rows, write_rows
from lfcore.rendering.prepared import open_tracer
from lfcore.storage import defaults
from lfcore.storage.layout import FrameLayout
from lfcore.workflow import cases, costs
from lfcore.workflow.plan import Plan
from lfcore.workflow.settings import check_settings, schema
from lfcore.workflow.sweep import joined, plan, read_sweep

ROOT = Path(__file__).resolve().parents[2]
CAMERA = Camera(0.05, 0.036, 2.0, 3.0)


def settings(**changes):
    return check_settings({"scenes": ["bike"], **changes})


@pytest.mark.parametrize("kind", ["macropixels", "views"])
@pytest.mark.parametrize("views", [2, 16, 100, 512])
def test_tiles_cover_all_rays_and_keep_to_their_bytes(kind, views):
    chosen = settings(layout={"kind": kind}, tile_mib=64)
    tiles = cases.tiles(chosen, views)
    assert sum(tile.rays for tile in tiles) == views**2 * 128**2
    assert max(tile.rays for tile in tiles) * 3 <= 64 * 2**20
    batches = costs.named_batches(chosen, views)
    assert sum(one.rays for one in batches.values()) == views**2 * 128**2
    assert next(iter(batches)) == "0000"


def test_what_is_said_goes_before_what_measured_best():
    macropixels = {"kind": "macropixels"}
    assert cases.frame_layout(settings(layout=macropixels), 16).pack == 8
    assert cases.frame_layout(settings(layout=macropixels | {"pack": 3}), 16).pack == 3
    assert cases.frame_layout(settings(layout=macropixels, pixels=16), 2).pack == 8
    spec = cases.encoding(settings(encoding={"crf": 12, "pixel_format": "yuv444p"}), 512)
    assert (spec.crf, spec.pixel_format) == (12, "yuv444p")
    assert spec.preset == defaults.chosen_encoding(512).preset
    slow = cases.encoding(settings(encoding={"preset": "slow"}), 512)
    assert (slow.preset, slow.bframes, slow.extra) == ("slow", None, ())
    assert slow.crf < defaults.chosen_encoding(512).crf  # which has no macroblock tree
    wide = defaults.chosen_encoding(4, Encoding(refs=2), width=defaults.WIDE + 1)
    assert (wide.bframes, wide.refs) == (0, 2)


@pytest.mark.parametrize(
    ("codec", "preset", "crf", "pixel_format"),
    [
        ("libx265", "fast", 34.0, "yuv444p"),
        ("libsvtav1", "8", 51.0, "yuv420p"),
        ("ffv1", None, 34.0, "yuv444p"),
    ],
)
def test_other_codecs_have_their_own_presets(codec, preset, crf, pixel_format):
    """The same, whether the workflow or the command line asks."""
    spec = cases.encoding(settings(encoding={"codec": codec}), 64)
    found = spec.codec, spec.preset, spec.crf, spec.pixel_format, spec.gop
    assert found == (codec, preset, crf, pixel_format, defaults.KEY_EVERY)
    assert spec == defaults.chosen_encoding(64, Encoding(codec))
    words = ["record", "scene", "-o", "x.mkv", "--codec", codec]
    assert spec == defaults.chosen_encoding(64, encoder(parser(words).parse_args(words)))


def test_frames_too_small_for_the_encoder_are_refused_before_a_run():
    small = {"encoding": {"codec": "libx265"}, "layout": {"kind": "macropixels", "pack": 4}}
    refused(r"codec: libx265 .* frames of 64 x 64", cases.tiles, settings(**small), 16)
    small["layout"]["pack"] = 5
    assert cases.frame_layout(settings(**small), 16).frame_width == 80


@pytest.mark.parametrize("change", [{"preset": "bogus"}, {"codec": "libx265", "tune": "bogus"}])
def test_what_the_encoder_does_not_know_is_refused_before_a_run(change):
    words = "configuration: encoding: .*preset and tune"
    refused(words, Plan.of, {"encoding": change}, ["quality"])


def test_scenes_by_name_and_by_path(tmp_path):
    names = ["teapot-2.1_final+", "größe", "-1", "2024"]
    odd = {"a b": "a_b", "it's": "it_s", ".hidden": "_hidden", "{n}": "_n_", "u\u0308ber": "über",
           "a; touch x;": "a__touch_x_"}  # fmt: skip
    meshes = [tmp_path / f"{name}.glb" for name in [*names, *odd]]
    for file in (*meshes, tmp_path / "bike.yaml"):
        file.touch()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scene.yaml").touch()
    found = cases.scene_files(["bike", *map(str, meshes), str(tmp_path / "mine")])
    assert list(found) == ["bike", *names, *odd.values(), "mine"]
    assert found["bike"].endswith("scenes/bike/scene.yaml")
    refused(r"scenes: there is no scene 'bikke'", cases.scene_files, ["bikke"])
    with pytest.raises(SettingsError, match="two scenes are called 'bike'"):
        cases.scene_files(["bike", str(tmp_path / "bike.yaml")])


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("x" * 101 + ".ply", "too long for a folder of results. Rename"),
        ("tables.obj", "results/tables/ .*Rename"),
        ("datasets.obj", "results/datasets/ .*Rename"),
        ("Assignment.ply", "results/Assignment/ .*Rename"),
        ("chart.obj", "'chart' is a scene of this project.*Rename"),
        ("sphere/scene.yaml", "'sphere' is a scene of this project.*Rename"),
    ],
)
def test_names_that_no_scene_can_have(tmp_path, file, words):
    """They would be written outside their folder, or into another's."""
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    path.touch()
    caught = refused(words, cases.scene_files, [str(path)])
    assert "configuration: scenes" in str(caught) and str(path) in str(caught)


def test_scenes_are_beside_the_workflow_where_the_library_has_none(tmp_path, monkeypatch):
    """As a wheel has none."""
    monkeypatch.setenv(cases.SCENES, str(tmp_path / "none"))
    refused("no scene 'bike'.*run the workflow in a checkout", cases.scene_files, ["bike"])
    monkeypatch.setenv(cases.SCENES, str(ROOT / "scenes"))
    assert list(cases.scene_files(["bike"])) == ["bike"]


def test_scenes_may_be_called_by_numbers():
    assert check_settings({"scenes": [2024]})["scenes"] == ["2024"]


def test_planes_of_the_scene_or_of_the_configuration():
    planes = cases.sensor_planes("scene", CAMERA, (2.0, 4.0))
    assert planes == [SensorPlane(2.0, 2.0), SensorPlane(4.0, 2.0)]
    given = [{"focus_m": 2.5}, {"focus_m": 3, "f_number": 8, "aperture": "square"}]
    planes = cases.sensor_planes(given, CAMERA, ())
    assert planes == [SensorPlane(2.5, 2.0), SensorPlane(3, 8, aperture="square")]
    given = [{"focus_m": "near"}, {"focus_m": "50%", "blur": "0.3%"}, {"focus_m": "far"}]
    near, middle, far = cases.sensor_planes(given, CAMERA, (2.0, 3.0, 4.0))
    assert (near.focus_m, far.focus_m) == (2.0, 4.0) and near.f_number == CAMERA.f_number
    assert middle.focus_m == pytest.approx(1 / 0.375)
    diameter = CAMERA.focal_length_m / middle.f_number
    assert diameter * (0.375 - 0.25) / CAMERA.field_width == pytest.approx(0.003)


@pytest.mark.parametrize(
    ("plane", "words"),
    [
        ({"focus_m": 0.04}, r"planes\.1\.focus_m.*inside the focal length"),
        ({"focus_m": 2, "f_number": 1.4}, r"planes\.1\.f_number.*wider than the lens"),
        ({"focus_m": 2, "f_number": 4, "blur": "3%"}, r"planes\.1\.blur.*excludes f_number"),
        ({"focus_m": "near"}, r"planes\.1\.focus_m.*Give metres"),
    ],
)
def test_planes_that_the_lens_cannot_form(plane, words):
    refused(words, cases.sensor_planes, [{"focus_m": 2}, plane], CAMERA, ())


def test_an_aperture_stack_closes_by_stops():
    planes = cases.aperture_stack([0, 2], CAMERA, 3.0)
    assert [plane.normalise for plane in planes] == ["lens", "lens", "aperture", "aperture"]
    assert [plane.f_number for plane in planes] == pytest.approx([2, 4, 2, 4])
    areas = [math.pi / 4 * (0.05 / plane.f_number) ** 2 for plane in planes[:2]]
    assert areas[0] == pytest.approx(4 * areas[1])


def tiles(views, pixels, most_rays):
    return FrameLayout("macropixels", views, pixels).tiles(most_rays)


@given(st.integers(2, 64), st.integers(16, 96), st.integers(1, 1 << 18), st.floats(1e-4, 60))
def test_batches_are_all_tiles_in_order(views, pixels, most_rays, minutes):
    cut = tiles(views, pixels, most_rays)
    batches = costs.batches(cut, minutes)
    assert [k for one in batches for k in range(one.start, one.stop)] == list(range(len(cut)))
    for one in batches:
        assert one.rays == sum(tile.rays for tile in cut[one.start : one.stop])
    seconds = sum(tile.rays for tile in cut) * costs.nanoseconds_per_ray(views) * 1e-9
    least = 2 if seconds >= costs.SHARED_SECONDS else 1
    assert len(batches) >= min(least, len(cut)) and len(batches) <= costs.MOST_BATCHES
    sizes = [one.stop - one.start for one in batches]
    assert max(sizes) - min(sizes) <= 1


def test_a_hundred_thousand_tiles_are_a_plan_of_hundreds_of_jobs():
    cut = tiles(512, 4096, (128 << 20) // 3)
    assert len(cut) > 100_000
    batches = costs.batches(cut, 10)
    assert 200 < len(batches) < 1000
    minutes = costs.trace_minutes(batches[0].rays, 512)
    assert 10 * costs.MARGIN <= minutes <= 10 * costs.MARGIN + 2


def load(name):
    return yaml.safe_load((ROOT / "config" / name).read_text())


def test_the_files_of_the_project_hold_every_key_and_its_default():
    given = load("config.yaml")
    settings = check_settings(given)
    assert settings == check_settings({}) and given == load("config.yaml"), "it is not changed"
    assert settings["layout"] == check_settings({"layout": {"order": "serpentine"}})["layout"]
    assert VALIDATOR.is_valid(given)


@pytest.mark.parametrize("name", ["config.yaml", "thesis.yaml", "smoke.yaml", "micro.yaml"])
def test_the_configurations_of_the_project(name):
    settings = Plan.of(load("config.yaml") | load(name), RECORDS | {"quality": {}}).settings
    assert settings["pixels"] == load(name).get("pixels", 128)


RECORDS = yaml.safe_load((ROOT / "workflow/reports.yaml").read_text())
SIZES = {"default", "thesis", "smoke", "micro"}


@pytest.mark.parametrize("name", RECORDS)
def test_a_report_is_a_record_with_a_caption(name):
    assert set(RECORDS[name]) <= {"title", "table", "figures", "with", "settings"}
    assert (ROOT / f"workflow/report/{name}.rst").is_file()
    settings = RECORDS[name].get("settings", {"default": {}})
    assert set(settings) <= SIZES
    for size in settings.values():
        assert set(size) <= set(settings["default"])


VALIDATOR = jsonschema.Draft202012Validator(schema())
REFUSED = [
    ({"pixles": 64}, "pixles: unknown key. Did you mean 'pixels'"),
    ({"encoding": {"crff": 3}}, r"encoding\.crff: unknown key. Did you mean 'crf'"),
    ({"pixels": "abc"}, "pixels: 'abc' is not a value of this key. .* or a width and height"),
    ({"pixels": 0}, "pixels.*greater than or equal to 16"),
    ({"pixels": "1920x"}, "pixels"),
    ({"pixels": float("inf")}, "pixels"),
    ({"views": [16, 0]}, r"views\.1"),
    ({"views": []}, "views"),
    ({"views": [16, 16]}, "views.*twice"),
    ({"scenes": "bike"}, "scenes"),
    ({"layout": {"kind": "both"}}, r"layout\.kind.*macropixels"),
    ({"encoding": {"crf": 64}}, r"encoding\.crf"),
    ({"encoding": None}, "encoding"),
    ({"picture_format": "jpeg"}, "picture_format: 'jpeg' is unknown. Known are png, ppm"),
    ({"planes": [{"focus_m": 2}] * 101}, "planes"),
    ({"planes": [{"focus_m": -1}]}, r"planes.*0\.focus_m"),
    ({"planes": [{"focus_m": 1, "colour": 1}]}, r"planes.*0\.colour"),
    ({"analysis": {}}, "analysis: unknown key"),
    ({"studies": "huge"}, "studies: 'huge' is unknown. Known are default, thesis, smoke, micro"),
]


@pytest.mark.parametrize(("change", "words"), REFUSED, ids=range(len(REFUSED)))
def test_impossible_settings_are_refused_in_one_line_that_names_the_key(change, words):
    """By the schema that Snakemake validates with, too."""
    caught = refused(words, check_settings, change)
    assert len(str(caught)) < 1000
    infinite = change == {"pixels": float("inf")}  # which JSON does not have
    assert infinite or not VALIDATOR.is_valid(change)


def test_a_report_that_there_is_not():
    words = "reports: there is no report 'equivalnce'. Did you mean 'equivalence'"
    refused(words, Plan.of, {"reports": ["equivalnce"]}, RECORDS)


def sweep_of(tmp_path, text):
    (tmp_path / "s.tsv").write_text(text)
    return plan(tmp_path / "s.tsv", load("config.yaml"))


@pytest.mark.parametrize("name", ["crf", "layout"])
def test_the_sweeps_of_the_project(name):
    sweep = plan(ROOT / "config" / "sweeps" / f"{name}.tsv", load("config.yaml"))
    assert len(sweep.settings) >= 4
    # Five rate factors share one tracing; layouts and pixel formats share none.
    assert len(sweep.members) == {"crf": 1, "layout": 16}[name]


def test_cases_share_a_tracing_when_they_differ_in_the_encoder_alone(tmp_path):
    text = """case\tscenes\tviews\tencoding.crf\tpixels
a\t[chart]\t[4, 8]\t20\t16
b\t[chart]\t[4]\t30\t16
c\t[chart]\t[4]\t20\t32
"""
    sweep = sweep_of(tmp_path, text)
    (group,) = {group for (group, _, n), cases in sweep.members.items() if cases == ["a", "b"]}
    assert sorted(case for one in sweep.members.values() for case in one) == ["a", "a", "b", "c"]
    assert sweep.scenes == ["chart"]
    assert [one["encoding"]["crf"] for one in sweep.study(group, "chart", 4).values()] == [20, 30]


def test_a_sweep_is_measured_and_joined(tmp_path):
    text = "case\tscenes\tviews\tpixels\tencoding.crf\n"
    text += "fine\t[chart]\t[4]\t16\t10\ncoarse\t[chart]\t[4]\t16\t45\n"
    sweep = sweep_of(tmp_path, text)
    triangles = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]
    scene = bare_scene(np.float32(triangles), ambient=(0.5, 0.4, 0.3), name="chart")
    tracer = open_tracer(scene, open_device(threads=1))
    ((group, *_),) = sweep.members
    study = sweep.study(group, "chart", 4)
    slab, planes = Slab(scene.camera, 4, 16), [SensorPlane(2.0, 2.0)]
    specs = {case: cases.encoding(settings, 4) for case, settings in study.items()}
    rows = sweep_rows(tracer, slab, cases.tiles(study["fine"], 4), planes, specs, tmp_path)
    table = joined(sweep.overrides, [row | {"made_of": ""} for row in rows[::-1]])
    assert table.case.tolist() == ["fine", "coarse"]
    assert table.columns[:4].tolist() == ["case", "pixels", "encoding.crf", "scene"]
    assert table.video_bytes[0] > table.video_bytes[1] and table.psnr_db[0] > table.psnr_db[1]
    assert [path.name for path in tmp_path.iterdir()] == ["s.tsv"]
    axis = sweep_figure(table).axes[0]
    assert sorted(axis.lines[0].get_xdata()) == sorted(table.bits_per_ray)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("name\tcrf\na\t1\n", "column 'case'"),
        ("case\tencoding.crf\na\t1\na\t2\n", "two cases are called 'a'"),
        ("case\tfigures.make\na\t[]\n", "figures.make: .*Vary scenes"),
        ("case\tencoding.crf\na\t[1\n", "encoding.crf: '\\[1' is no YAML"),
        ("case\tviews.x\na\t1\n", r"s\.tsv: views\.x: 'views' has no keys within it"),
        ("case\tencoding.crf.x\na\t1\n", r"encoding\.crf\.x: 'crf' has no keys"),
        ("case\tencoding\tencoding.crf\na\t3\t1\n", r"encoding\.crf: 'encoding' has no keys"),
        ("case\tencoding.crf\tencoding.crf\na\t1\t2\n", r"encoding\.crf: two columns have"),
        ("case\tviews\tpixels\na\t[4]\n", "'a' has 2 cells, and the table 3 columns"),
        ("case\tviews\na\t[4]\t16\n", "'a' has 3 cells, and the table 2 columns"),
        ('case\tviews\na\t"[4]\n', "cannot be read"),
        ("# only a comment\n", "column 'case'"),
        ("case\tencoding.crf\na\t400\n", r"s\.tsv: case a: encoding.crf: '400': must be less"),
    ],
)
def test_sweeps_say_what_is_wrong(tmp_path, text, words):
    refused(words, sweep_of, tmp_path, text)


@pytest.mark.parametrize("ends", ["\n", "\t\n", "\r\n"])
def test_cells_keep_their_columns_and_hashes(tmp_path, ends):
    table = ["# scenes", "case\tscenes\tviews", "a#1\t[chart]\t[4]", "", 'b\t"[bike]"\t[8]']
    (tmp_path / "s.tsv").write_text(ends.join([*table, ""]), newline="")
    wanted = {"a#1": {"scenes": ["chart"], "views": [4]}, "b": {"scenes": ["bike"], "views": [8]}}
    assert read_sweep(tmp_path / "s.tsv") == wanted


@pytest.mark.workflow
def test_a_changed_row_leaves_the_others(project_copy):
    """Planted seconds stay in the row that did not change, and are measured in the others."""
    checkout, planted = project_copy("sweep"), 123.0
    table = checkout.folder / "config" / "sweeps" / "s.tsv"
    for rows in ("a\t20\nb\t30\n", "new\t25\na\t20\nb\t31\n"):
        table.write_text("case\tencoding.crf\n" + rows)
        checkout.made(
            "--configfile", "config/micro.yaml", "--config", "scenes=[chart]", "views=[4]",
            "sweep=config/sweeps/s.tsv", "--", "sweep",
        )  # fmt: skip
        files = list((checkout.folder / "results/sweeps/s").rglob("*.json"))
        made = read_rows(files)
        for file in files:
            write_rows(file, [row | {"trace_seconds": planted} for row in read_rows([file])])
    assert {row["case"] for row in made} == {"new", "a", "b"}
    for row in made:
        assert (row["trace_seconds"] == planted) == (row["case"] == "a")
        assert row["video_bytes"] > 0

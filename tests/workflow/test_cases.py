"""What settings ask for: scenes, tiles, planes; and what a rule's sources are."""

from __future__ import annotations

import math
import shutil

import pytest

from lfcore.cli import parser
from lfcore.cli.imgtool_store import asked
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.storage import defaults
from lfcore.storage.pixels import PIXEL_FORMATS
from workflow import cases
from workflow.settings import SettingsError, check_settings
from workflow.sources import source_digest
from workflow.sweep import ROOT, join_tables, nested

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
    assert cases.tile_names(chosen, views)[0] == "0000"


def test_layout_and_encoder_follow_what_measured_best():
    for views in (16, 64, 512):
        layout, spec = cases.frame_layout(settings(), views), cases.codec_spec(settings(), views)
        assert layout.kind == defaults.default_kind(views, 128)
        assert layout.pack == defaults.default_pack(views, 128)
        assert spec == defaults.default_spec(views)
        assert layout.pixel_format == spec.pixel_format


def test_what_is_said_goes_before_what_measured_best():
    macropixels = {"kind": "macropixels"}
    assert cases.frame_layout(settings(layout=macropixels), 16).pack == 8
    assert cases.frame_layout(settings(layout=macropixels | {"pack": 3}), 16).pack == 3
    assert cases.frame_layout(settings(layout=macropixels, spatial_resolution=16), 2).pack == 8
    spec = cases.codec_spec(settings(encoder={"crf": 12, "pixel_format": "yuv444p"}), 512)
    assert (spec.crf, spec.pixel_format) == (12, "yuv444p")
    assert spec.preset == defaults.default_spec(512).preset
    slow = cases.codec_spec(settings(encoder={"preset": "slow"}), 512)
    assert (slow.preset, slow.bframes, slow.refs) == ("slow", None, None)
    assert slow.lookahead is None and spec.lookahead == defaults.default_spec(512).lookahead


@pytest.mark.parametrize("name", sorted(PIXEL_FORMATS))
def test_every_pixel_format_of_the_store_can_be_said(name):
    encoder = {"codec": "ffv1", "pixel_format": name}
    assert cases.frame_layout(settings(encoder=encoder), 16).pixel_format == name


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
    spec = cases.codec_spec(settings(encoder={"codec": codec}), 64)
    assert (spec.codec, spec.preset, spec.crf) == (codec, preset, crf)
    assert (spec.pixel_format, spec.gop) == (pixel_format, defaults.KEY_EVERY)
    assert spec == defaults.codec_spec(64, codec)
    words = ["trace", "scene", "-o", "x.mkv", "--codec", codec]
    assert spec == defaults.codec_spec(64, **asked(parser(words).parse_args(words)))


def test_scenes_by_name_and_by_path(tmp_path):
    mesh = tmp_path / "teapot.glb"
    mesh.touch()
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "scene.yaml").touch()
    found = cases.scene_files(["bike", str(mesh), str(tmp_path / "mine")], ROOT)
    assert list(found) == ["bike", "teapot", "mine"]
    assert found["bike"].endswith("scenes/bike/scene.yaml")


def test_a_scene_that_is_not_there(tmp_path):
    with pytest.raises(SettingsError, match=r"scenes: there is no scene 'bikke'"):
        cases.scene_files(["bikke"], ROOT)
    (tmp_path / "bike.yaml").touch()
    with pytest.raises(SettingsError, match="two scenes are called 'bike'"):
        cases.scene_files(["bike", str(tmp_path / "bike.yaml")], ROOT)


@pytest.mark.parametrize(
    ("file", "words"),
    [
        ("...obj", r"'\.\.' cannot be a folder of results\. Rename the folder or the file;"),
        (".hidden.obj", r"'\.hidden' cannot be a folder"),
        ("a b.ply", "'a b' cannot be a folder"),
        ("{n}.ply", r"'\{n\}' cannot be a folder"),
        ("a'; touch x;.ply", "cannot be a folder"),
        ("x" * 101 + ".ply", "cannot be a folder"),
        ("tables.obj", "results/tables/ is not a scene's. Rename"),
        ("Assignment.ply", "results/Assignment/ is not a scene's. Rename"),
        ("chart.obj", "'chart' is a scene of this project.*Rename"),
        ("sphere/scene.yaml", "'sphere' is a scene of this project.*Rename"),
    ],
)
def test_names_that_no_scene_can_have(tmp_path, file, words):
    """They would be written outside their folder, or into another's."""
    path = tmp_path / file
    path.parent.mkdir(exist_ok=True)
    path.touch()
    with pytest.raises(SettingsError, match=words) as caught:
        cases.scene_files([str(path)], ROOT)
    assert "configuration: scenes" in str(caught.value) and str(path) in str(caught.value)


@pytest.mark.parametrize("file", ["teapot-2.1_final+.glb", "größe.ply", "-1.obj"])
def test_names_that_scenes_have(tmp_path, file):
    (tmp_path / file).touch()
    assert list(cases.scene_files([str(tmp_path / file)], ROOT)) == [file.rsplit(".", 1)[0]]


def test_the_project_s_own_scenes_by_path():
    assert list(cases.scene_files(["chart", str(ROOT / "scenes" / "book")], ROOT)) == [
        "chart", "book",
    ]  # fmt: skip


def test_planes_of_the_scene_or_of_the_configuration():
    assert cases.sensor_planes("scene", CAMERA, (2.0, 4.0)) == [
        SensorPlane(2.0, 2.0),
        SensorPlane(4.0, 2.0),
    ]
    given = [{"focus_distance_m": 2.5}, {"focus_distance_m": 3, "f_number": 8, "shape": "square"}]
    assert cases.sensor_planes(given, CAMERA, ()) == [
        SensorPlane(2.5, 2.0),
        SensorPlane(3, 8, shape="square"),
    ]


@pytest.mark.parametrize(
    ("plane", "words"),
    [
        ({"focus_distance_m": 0.04}, r"planes\.1\.focus_distance_m.*inside the focal length"),
        ({"focus_distance_m": 2, "f_number": 1.4}, r"planes\.1\.f_number.*wider than the lens"),
    ],
)
def test_planes_that_the_lens_cannot_form(plane, words):
    with pytest.raises(SettingsError, match=words):
        cases.sensor_planes([{"focus_distance_m": 2}, plane], CAMERA, ())


def test_an_aperture_stack_closes_by_stops():
    planes = cases.aperture_stack([0, 2], CAMERA, 3.0)
    assert [plane.normalise for plane in planes] == ["lens", "lens", "aperture", "aperture"]
    assert [plane.f_number for plane in planes] == pytest.approx([2, 4, 2, 4])
    areas = [math.pi / 4 * (0.05 / plane.f_number) ** 2 for plane in planes[:2]]
    assert areas[0] == pytest.approx(4 * areas[1])


def test_lossless_storage_takes_no_preset():
    spec = cases.codec_spec(settings(encoder={"codec": "ffv1"}), 16)
    assert spec.lossless and spec.preset is None and spec.threads == 1


@pytest.fixture
def project(tmp_path):
    ignored = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")
    for name in ("lfcore", "workflow"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignored)
    return tmp_path


@pytest.mark.parametrize(
    ("edited", "rerun"),
    [
        ("lfcore/tracing/kernels/slab.cl", {"trace.py", "trace_views.py", "retrieve.py"}),
        ("lfcore/tracing/tracer.py", {"trace.py", "trace_views.py"}),
        ("lfcore/storage/segment.py", {"trace.py", "join.py"}),
        ("lfcore/evaluation/metrics.py", {"evaluate.py"}),
        ("lfcore/evaluation/page.css", {"page.py"}),
        ("lfcore/evaluation/thesis_tables.csv", {"evaluate.py", "tables.py"}),
        ("lfcore/scene/procedural/textures.py", set()),
        ("workflow/sweep.py", set()),
    ],
)
def test_an_edit_changes_the_digests_of_those_who_use_it(project, edited, rerun):
    scripts = ["trace.py", "trace_views.py", "join.py", "retrieve.py", "evaluate.py", "page.py"]
    scripts += ["tables.py", "build.py"]
    folder = project / "workflow" / "scripts"
    before = {script: source_digest(folder / script, project) for script in scripts}
    # Another copy: digests are cached by path within a run of Snakemake.
    other = project.with_name(project.name + "_edited")
    shutil.copytree(project, other)
    with (other / edited).open("a") as file:
        file.write("\n")
    folder = other / "workflow" / "scripts"
    after = {script: source_digest(folder / script, other) for script in scripts}
    changed = {script for script in scripts if before[script] != after[script]}
    assert rerun <= changed
    unaffected = {"build.py", "tables.py", "page.py"} - rerun
    if edited.startswith("lfcore/evaluation/thesis"):
        unaffected -= {"page.py"}
    assert not unaffected & changed


def test_a_builder_belongs_to_the_scenes_that_name_it(tmp_path):
    names = [path.stem for path in cases.builders_of_scene(ROOT / "scenes/bike/scene.yaml", ROOT)]
    assert names == ["bike"]


def test_tables_of_a_sweep_are_joined(tmp_path):
    for case, value in (("a", "1.5"), ("b", "2.5")):
        folder = tmp_path / case / "results" / "tables"
        folder.mkdir(parents=True)
        (folder / "t.csv").write_text(f"scene,seconds\nbike,{value}\n")
    cases_of_sweep = {"a": {"encoder.crf": 1, "scene": "x"}, "b": {"encoder.crf": 2, "scene": "y"}}
    assert join_tables(tmp_path, cases_of_sweep) == [tmp_path / "t.csv"]
    assert (tmp_path / "t.csv").read_text() == (
        "case,encoder.crf,config.scene,scene,seconds\na,1,x,bike,1.5\nb,2,y,bike,2.5\n"
    )


def test_dotted_keys_nest():
    assert nested({"a.b": 1, "a.c": 2, "d": 3}) == {"a": {"b": 1, "c": 2}, "d": 3}

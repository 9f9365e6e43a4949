"""Formats out and in again, and one way; what others write; refusals that name what is wrong.

Most light fields are of noise, which is its own ground truth.
"""

import configparser
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import plain_scenes
import pytest
from PIL import Image
from plain_scenes import CHART, refused
from stored_fields import LOSSLESS, tile_frames, write_field

from lfcore import Encoding, LightField, load_scene, record
from lfcore.cli import main
from lfcore.colour import srgb_codes
from lfcore.exchange.exporting import export_lightfield
from lfcore.exchange.grid import Geometry, Order, ReadOptions, ViewGrid, WriteOptions
from lfcore.exchange.importing import check_order, import_lightfield, read_grid, store_grid
from lfcore.exchange.pictures import read_pfm
from lfcore.exchange.source import Selection, Source
from lfcore.exchange.table import FORMATS
from lfcore.pictures import read_picture
from lfcore.rendering.depth import depth_of_views, disparity
from lfcore.rendering.prepared import open_tracer
from lfcore.storage.layout import FrameLayout
from robustness.targets.exchange import llff_poses

KNOWN = Geometry(pitch_m=0.004, pixel_pitch=0.02, delta=0.5, sensor_m=0.036)


def noise(rows, columns, height, width, seed=1):
    """(rows, columns, height, width, 3) uint8."""
    shape = (rows, columns, height, width, 3)
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


@dataclass
class Noise:
    path: Path
    views: np.ndarray

    @property
    def field(self) -> LightField:
        return LightField.open(self.path)


def store(folder, views, geometry=KNOWN, name="noise") -> Noise:
    path = folder / f"{name}.mkv"
    store_grid(path, ViewGrid.of_array(views, name, format="test", geometry=geometry), LOSSLESS)
    return Noise(path, views)


def pictures(folder, views, name):
    """The views (rows, columns, ...) as files, which ``name(row, column)`` calls."""
    folder.mkdir(parents=True)
    for row, column in np.ndindex(views.shape[:2]):
        Image.fromarray(views[row, column]).save(folder / name(row, column))


def taken_back(source, folder, **more):
    """The light field file of what was exported, exact."""
    options = more.pop("options", None) or ReadOptions()
    output = folder / "back.mkv"
    field = import_lightfield(source, output, encoding=Encoding("ffv1"), options=options, **more)
    return read_grid(Path(source), more.get("format"), options), field


def all_views(field):
    columns, rows = field.grid
    return field.views(0, 0, columns, rows, codes=True)


@pytest.fixture(scope="module")
def square(tmp_path_factory):
    """3 x 3 views of 16 x 16 pixels, with a geometry."""
    return store(tmp_path_factory.mktemp("square"), noise(3, 3, 16, 16))


@pytest.fixture(scope="module")
def wide(tmp_path_factory):
    """4 columns and 2 rows of 22 x 16 pixels, with a geometry."""
    return store(tmp_path_factory.mktemp("wide"), noise(2, 4, 16, 22))


def test_quilts_go_from_bottom_left(wide, tmp_path):
    options = WriteOptions()
    first, second = (
        list(export_lightfield(wide.path, "quilt", tmp_path / name, options=options))
        for name in ("out", "again")
    )
    assert first and first == second, "a second export repeated the notes"
    (file,) = (tmp_path / "out").iterdir()
    assert file.name == "noise_qs2x2a1.375.png"
    quilt = read_picture(file)
    np.testing.assert_array_equal(quilt[16:, :22], wide.views[1, 0])
    np.testing.assert_array_equal(quilt[:16, 22:], wide.views[1, 3])
    grid, field = taken_back(file, tmp_path)
    assert (grid.format, field.grid) == ("quilt", (4, 1))
    np.testing.assert_array_equal(all_views(field), wide.views[1:])
    more = {"options": WriteOptions(tiles=(5, 1))}
    refused("there are 4 in a row", export_lightfield, wide.path, "quilt", tmp_path / "b", **more)
    assert not (tmp_path / "b").exists()


def test_colmap_projects_as_the_slab_does(wide, tmp_path):
    export_lightfield(wide.path, "colmap", tmp_path / "out")
    model = tmp_path / "out" / "sparse" / "0"
    lens = np.loadtxt(model / "cameras.txt", usecols=range(4, 8))
    poses = np.loadtxt(model / "images.txt", usecols=range(1, 8))
    point = np.array([0.03, -0.02, 1.7])
    slab = wide.field.slab
    s = slab.lens_positions()[np.arange(4)]
    t = slab.lens_positions()[slab.extent.views[1] + np.arange(2)]
    for k, (row, column) in enumerate(np.ndindex(2, 4)):
        there = point + poses[k, 4:]
        found = lens[k, :2] * there[:2] / there[2] + lens[k, 2:]
        place = np.array([s[column], t[row]])
        tangent = (point[:2] - place) / point[2] + place * slab.camera.delta
        middle = slab.pixels / 2 - np.array(slab.extent.pixels[:2])
        np.testing.assert_allclose(found, tangent / slab.pixel_pitch + middle, atol=1e-9)
    np.testing.assert_array_equal(
        read_picture(tmp_path / "out" / "images" / "view_001_002.png"), wide.views[1, 2]
    )


@pytest.fixture
def stored(tmp_path):
    """Views whose axis moves a pixel from one to the next."""
    geometry = Geometry(pitch_m=0.04, pixel_pitch=0.02, delta=0.5)
    return store(tmp_path, noise(3, 3, 16, 16), geometry)


def check_parallel_cameras(stored, format, folder):
    """Back in, the views are those that were cropped, of parallel cameras."""
    grid, field = taken_back(folder / "out", folder)
    assert (grid.format, field.slab.camera.delta) == (format, 0)
    assert field.slab.lens_pitch_m == pytest.approx(0.04)
    assert field.slab.pixel_pitch == pytest.approx(0.02)
    np.testing.assert_array_equal(field.view(1, 2, codes=True), stored.views[2, 1, 2:16, 1:15])
    return field


@pytest.mark.parametrize("order", ["rows", "columns", "rows-up", "columns-left-up", "rows-snake"])
def test_folders_in_any_order(order, wide, tmp_path):
    parsed, numbers = Order.parse(order), {}
    for index in range(8):
        column, row = parsed.place(index, 4, 2)
        column, row = 3 - column if "left" in order else column, 1 - row if "up" in order else row
        numbers[row, column] = index
    pictures(tmp_path / "in", wide.views, lambda *place: f"shot {numbers[place]}.png")
    options = ReadOptions((4, 2), parsed)
    grid, field = taken_back(tmp_path / "in", tmp_path, options=options)
    assert grid.format == "folder"
    np.testing.assert_array_equal(all_views(field), wide.views)


def test_jpeg_pleno_in_the_other_order_and_by_hand(wide, tmp_path):
    rows = Order.parse("rows")
    export_lightfield(wide.path, "jpeg-pleno", tmp_path / "out", options=WriteOptions(order=rows))
    data = (tmp_path / "out" / "001_003.ppm").read_bytes()
    assert data.startswith(b"P6\n22 16\n1023\n")
    codes = np.frombuffer(data[14:], ">u2").reshape(16, 22, 3)
    np.testing.assert_array_equal(codes, np.rint(wide.views[1, 3] * (1023 / 255)))
    _, field = taken_back(tmp_path / "out", tmp_path, options=ReadOptions(order=rows))
    np.testing.assert_array_equal(all_views(field), wide.views)


def test_hci_as_published(wide, tmp_path):
    """Without our own keys, focused at infinity, comments and other spacing."""
    export_lightfield(wide.path, "hci", tmp_path / "out")
    config = tmp_path / "out" / "parameters.cfg"
    text = config.read_text().replace(" = ", "=").split("[meta]")[0]
    config.write_text(text.replace("focus_distance_m=2.0", "focus_distance_m=0") + "[meta]\n")
    _, field = taken_back(tmp_path / "out", tmp_path)
    assert field.slab.camera.delta == 0
    assert field.metadata.scene["name"] == "out"


def test_hci_disparity_is_the_benchmarks(square):
    """beta = b f w; disparity (beta F / Z - beta) / (F S), in mm, as the benchmark states it."""
    source = Source(square.field, Selection())
    b, size, focus, sensor = 4.0, 16, 2000.0, 36.0
    focal = sensor / (0.02 * size)
    beta = b * focal * size
    depth = np.array([1.0, 2.0, 3.7])
    expected = (beta * focus / (1e3 * depth) - beta) / (focus * sensor)
    np.testing.assert_allclose(source.disparity(depth), expected, rtol=1e-6, atol=1e-7)


def test_stanford_positions_decide(square, tmp_path):
    """Columns counted from the right, rows from the bottom: the names' coordinates tell."""

    def name(row, column):
        return f"out_{2 - row:02d}_{2 - column:02d}_{50 * row - 900}_{50 * column + 3.25}_.png"

    pictures(tmp_path / "in", square.views, name)
    grid, field = taken_back(tmp_path / "in", tmp_path)
    assert (grid.format, grid.geometry) == ("stanford", Geometry(pitch_m=0.05))
    np.testing.assert_array_equal(all_views(field), square.views)


def test_a_plane_of_blenders_is_taken_back(stored, tmp_path):
    notes = export_lightfield(stored.path, "blender", tmp_path / "out")
    assert any("cropped to 14 x 14" in note for note in notes)
    data = json.loads((tmp_path / "out" / "lightfield.json").read_text())
    assert (data["lf_type"], data["resolution"]) == ("PLANE", [14, 14])
    # Column 2 stands to the right of column 0, row 2 below row 0, where z is up.
    first, right, below = (np.array(data["frames"][k]["world_matrix"]) for k in (0, 2, 6))
    np.testing.assert_allclose(right[:3, 3] - first[:3, 3], [0.08, 0, 0], atol=1e-12)
    np.testing.assert_allclose(below[:3, 3] - first[:3, 3], [0, 0, -0.08], atol=1e-12)
    tangent = data["sensor_size"][0] / data["camera"]["focal_length"] / 14
    assert tangent == pytest.approx(0.02)
    check_parallel_cameras(stored, "blender", tmp_path)


@pytest.mark.parametrize("matrices", [True, False])
def test_idlab_planes(matrices, wide, tmp_path):
    from scipy.spatial.transform import Rotation

    angles = [0.4, -0.2, 1.1]
    turn, frames = Rotation.from_euler("xyz", angles), []
    for row, column in np.ndindex(2, 4):
        pose = np.eye(4)
        pose[:3, :3] = turn.as_matrix()
        pose[:3, 3] = turn.apply([0.01 * column, -0.01 * row, 0.0]) + [3, 4, 5]
        frame = {"name": f"view_{4 * row + column:04d}f", "position": pose[:3, 3].tolist()}
        frame |= {"rotation": angles} | ({"world_matrix": pose.tolist()} if matrices else {})
        frames.append(frame)
    pictures(
        tmp_path / "in" / "png", wide.views, lambda row, column: f"view_{4 * row + column:04d}f.png"
    )
    data = {
        "camera": {"type": "PERSP", "lens_unit": "MILLIMETERS", "focal_length": 50.0},
        "lf_type": "PLANE", "resolution": [22, 16], "sensor_size": [36.0, 36.0 * 16 / 22],
        "frames": frames,
    }  # fmt: skip
    (tmp_path / "in" / "lightfield.json").write_text(json.dumps(data))
    _, field = taken_back(tmp_path / "in", tmp_path)
    assert field.metric
    assert field.slab.lens_pitch_m == pytest.approx(0.01)
    assert field.slab.pixel_pitch == pytest.approx(36 / 50 / 22)
    np.testing.assert_array_equal(all_views(field), wide.views)


def test_sixteen_bits_grey_and_alpha(tmp_path):
    codes = noise(1, 1, 16, 16)[0, 0].astype(np.uint16) * 257
    (tmp_path / "in").mkdir()
    cv2.imwrite(str(tmp_path / "in" / "0.png"), codes[..., ::-1])
    grey = Image.fromarray(np.arange(256, dtype=np.uint8).reshape(16, 16))
    grey.save(tmp_path / "in" / "1.png")
    clear = np.dstack([codes >> 8, np.full((16, 16), 9)]).astype(np.uint8)
    Image.fromarray(clear, "RGBA").save(tmp_path / "in" / "2.png")
    Image.fromarray((codes >> 8).astype(np.uint8)).save(tmp_path / "in" / "3.png")
    _, field = taken_back(tmp_path / "in", tmp_path)
    np.testing.assert_array_equal(field.view(0, 0, codes=True), codes >> 8)
    np.testing.assert_array_equal(field.view(1, 0, codes=True)[..., 1], np.asarray(grey))
    np.testing.assert_array_equal(field.view(0, 1, codes=True), codes >> 8)


def test_macropixels_are_exported_as_their_views(tmp_path):
    """A store of macropixels is decoded once for many views; some of them, and a part of each."""
    views, slab = noise(4, 4, 16, 16), KNOWN.slab(4, 4, 16, 16)
    layout, file = FrameLayout("macropixels", 4, 16, pixel_format="gbrp"), tmp_path / "lf.mkv"
    write_field(file, slab, layout, lambda tile: tile_frames(views, tile))
    np.testing.assert_array_equal(LightField.open(file).view(1, 2, codes=True), views[2, 1])
    selection = Selection((2, 2), 0.008, (3, 2, 8, 6))
    export_lightfield(file, "hci", tmp_path / "out", selection=selection)
    _, field = taken_back(tmp_path / "out", tmp_path)
    np.testing.assert_array_equal(all_views(field), views[1::2, 1::2, 2:8, 3:11])
    assert field.slab.lens_pitch_m == pytest.approx(0.008)
    assert field.slab.pixel_pitch == pytest.approx(0.02)


def test_a_wrong_order_is_told(tmp_path):
    """Rows that run the other way than columns give a note, right ones none."""
    y, x = np.mgrid[0:64, 0:64] / 64.0

    def view(column, row):
        moved = np.sin(9 * (x + 0.02 * column)) * np.cos(8 * (y + 0.02 * row))
        return np.repeat(np.uint8(127 + 100 * moved)[..., None], 3, -1)

    views = np.array([[view(i, j) for i in range(3)] for j in range(3)])
    grid = ViewGrid.of_array(views, "waves")
    assert check_order(grid) is None
    assert "the order of one of them is wrong" in check_order(grid.turned(up=True))
    assert check_order(grid.turned(left=True, up=True)) is None


def test_plenoptic_raw_pictures_with_their_calibration(tmp_path):
    stored = store(tmp_path, noise(5, 5, 16, 18))
    export_lightfield(stored.path, "plenoptic", tmp_path / "out")
    raw, white = (
        cv2.imread(str(tmp_path / "out" / f"noise_{name}.png"), cv2.IMREAD_UNCHANGED)
        for name in ("raw", "white")
    )
    assert (raw.shape, raw.dtype, white.dtype) == ((80, 90, 3), np.uint16, np.uint16)
    # The white image divided out gives every view again.
    for row, column, off in ((2, 2, 0), (1, 3, 0), (0, 0, 1)):
        light = raw[row::5, column::5, ::-1] / white[row::5, column::5, None]
        np.testing.assert_allclose(
            srgb_codes(light).astype(int), stored.views[row, column], atol=off
        )
    assert white[0, 0] < white[1, 1] < white[2, 1] < white[2, 2] == 65535
    calibration = json.loads((tmp_path / "out" / "noise_white.json").read_text())
    y, x, row, column = calibration["mic_list"][18 * 3 + 7]
    assert (row, column, calibration["ptc_mean"]) == (3, 7, [5, 5])
    cell = white[15:20, 35:40].astype(float)
    v, u = np.mgrid[15:20, 35:40]
    centre = np.sum(v * cell) / cell.sum(), np.sum(u * cell) / cell.sum()
    np.testing.assert_allclose(centre, (y, x), atol=1e-9)


@pytest.fixture(scope="module")
def chart():
    return load_scene(CHART)


@pytest.fixture(scope="module")
def traced(chart, tmp_path_factory):
    """5 x 5 views of 32 x 32 pixels of the chart, exact."""
    path = tmp_path_factory.mktemp("traced") / "chart.mkv"
    record(chart, path, views=5, pixels=32, encoding=Encoding("ffv1", "gbrp", depth=False))
    return path


def test_hcis_range_of_disparities_holds_the_sky(tmp_path, device):
    """Where a ray misses, the maps have the disparity of infinity."""
    card = np.float32([[[-1, -1, 4], [1, -1, 4], [0, 1, 4]]])
    scene = plain_scenes.scene(card)
    field = record(scene, tmp_path / "card.mkv", views=3, pixels=16)
    export_lightfield(field, "hci", tmp_path / "out", scene=scene, device=device)
    maps = [read_pfm(path) for path in (tmp_path / "out").glob("gt_disp_lowres_*.pfm")]
    config = configparser.ConfigParser()
    config.read(tmp_path / "out" / "parameters.cfg")
    ends = [float(config["meta"][f"disp_{end}"]) for end in ("min", "max")]
    assert ends == pytest.approx([np.min(maps), np.max(maps)])


def test_hci_has_every_views_depth_and_disparity(chart, traced, tmp_path, device):
    out, more = tmp_path / "out", {"scene": chart, "device": device}
    selection = Selection((3, 3), crop=(4, 2, 20, 24))
    assert export_lightfield(traced, "hci", out, selection=selection, **more) == []
    slab = LightField.open(traced).slab
    samples = np.array([(2 * i, 2 * j) for j in range(3) for i in range(3)])
    expected = depth_of_views(open_tracer(chart, device), slab, samples)[:, 2:26, 4:24]
    for index in range(9):
        depth = read_pfm(out / f"gt_depth_lowres_Cam{index:03d}.pfm")
        np.testing.assert_array_equal(depth, expected[index])
        found = read_pfm(out / f"gt_disp_lowres_Cam{index:03d}.pfm")
        moved = 2 * disparity(slab, expected[index])
        np.testing.assert_allclose(found, moved, rtol=1e-6, atol=1e-6)
        ids = cv2.imread(str(out / f"objectids_highres_Cam{index:03d}.png"), -1)
        assert ids.dtype == np.uint16
        assert (ids > 0).all() == np.isfinite(depth).all()
    np.testing.assert_array_equal(read_pfm(out / "gt_depth_lowres.pfm"), expected[4])
    # OpenCV reads the float maps as they are meant.
    seen = cv2.imread(str(out / "gt_disp_lowres.pfm"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(seen, read_pfm(out / "gt_disp_lowres.pfm"))
    lines = (out / "parameters.cfg").read_text().splitlines()
    values = dict(line.split(" = ") for line in lines if " = " in line)
    near, far = (end(expected[np.isfinite(expected)]) for end in (np.min, np.max))
    ends = 2 * disparity(slab, np.array([far, near]))
    assert [float(values["disp_min"]), float(values["disp_max"])] == pytest.approx(ends.tolist())
    back = import_lightfield(out, tmp_path / "back.mkv", encoding=Encoding("ffv1"))
    assert back.depth_range == pytest.approx((near, far), rel=0.2)
    assert back.metric


def test_nerfstudio_has_millimetres_and_without_the_scene_it_is_said(chart, traced, tmp_path):
    export_lightfield(traced, "nerfstudio", tmp_path / "out", scene=chart)
    data = json.loads((tmp_path / "out" / "transforms.json").read_text())
    frame = data["frames"][7]
    mm = cv2.imread(str(tmp_path / "out" / frame["depth_file_path"]), cv2.IMREAD_UNCHANGED)
    field = LightField.open(traced)
    depth = depth_of_views(open_tracer(chart), field.slab, np.array([[2, 1]]))[0]
    expected = np.where(np.isfinite(depth), np.rint(1e3 * depth), 0)
    np.testing.assert_array_equal(mm, expected)
    for name in ("hci", "nerfstudio"):
        (note,) = export_lightfield(traced, name, tmp_path / name)
        assert "give the scene" in note
        assert not list((tmp_path / name).glob("gt_*"))


@pytest.mark.parametrize(
    "format", "hci stanford nerfstudio colmap json jpeg-pleno mosaic eslf mat hdf5".split()
)
@pytest.mark.parametrize("shape", ["square", "wide"])
def test_folders(format, shape, tmp_path, request):
    if format == "hdf5":
        pytest.importorskip("h5py")
    stored = request.getfixturevalue(shape)
    export_lightfield(stored.path, format, tmp_path / "out")
    rows, columns = stored.views.shape[:2]
    options = ReadOptions((columns, rows)) if format in ("mosaic", "eslf") else None
    grid, field = taken_back(tmp_path / "out", tmp_path, options=options)
    assert grid.format == format
    assert field.picture_size == stored.views.shape[3:1:-1]
    np.testing.assert_array_equal(all_views(field), stored.views)
    assert field.metric == (format in ("hci", "nerfstudio", "colmap", "json"))
    if field.metric:
        ours, theirs = field.slab, stored.field.slab
        assert ours.lens_pitch_m == pytest.approx(theirs.lens_pitch_m, rel=1e-5)
        assert ours.pixel_pitch == pytest.approx(theirs.pixel_pitch, rel=1e-5)
        assert ours.camera.delta == pytest.approx(theirs.camera.delta, rel=1e-5, abs=1e-9)


FULL_DISK = """
import resource, sys
from pathlib import Path
from lfcore import LfcoreError, export_lightfield
resource.setrlimit(resource.RLIMIT_FSIZE, (100, -1))  # refused as on a full disk
for format in sys.argv[2:]:
    try:
        export_lightfield(sys.argv[1], format, format)
    except LfcoreError as error:
        print(error)
print(*Path().iterdir())
"""


def test_an_export_to_a_full_disk_is_one_line_and_leaves_nothing(square, tmp_path):
    pytest.importorskip("h5py")
    formats = "hci json mosaic mat hdf5".split()
    done = subprocess.run(
        [sys.executable, "-c", FULL_DISK, square.path, *formats], cwd=tmp_path,
        capture_output=True, text=True, timeout=200,
    )  # fmt: skip
    *said, left = done.stdout.split("\n")[:-1]
    assert left == "" and not done.stderr
    for format, line in zip(formats, said, strict=True):
        assert line.startswith(f"{format}: cannot be written: File too large")


def test_what_is_asked_for_by_name_completes_the_geometry(square, tmp_path):
    export_lightfield(square.path, "stanford", tmp_path / "out")
    options = ReadOptions(geometry=Geometry(delta=0.5), fov_deg=18.180)
    _, field = taken_back(tmp_path / "out", tmp_path, options=options)
    assert field.metric
    assert field.slab.lens_pitch_m == pytest.approx(0.004)
    assert field.slab.pixel_pitch == pytest.approx(0.02, rel=1e-3)
    assert field.refocus(focus_m=2.5).shape == (16, 16, 3)


def import_fails(folder, *words, **more):
    """The error has all the words, and nothing is left behind."""
    out = folder.parent / "lf"
    text = str(refused(None, import_lightfield, folder, out / "x.mkv", **more))
    assert all(word in text for word in words), text
    assert not out.exists() or not list(out.iterdir())


def test_numbered_views(tmp_path):
    (tmp_path / "in").mkdir()
    for name in ("00_00", "00_01", "01_00"):
        Image.new("RGB", (16, 16)).save(tmp_path / "in" / f"{name}.png")
    import_fails(tmp_path / "in", "row 1 and column 1", "3 of 2 x 2")
    import_fails(tmp_path / "in", "holds 3 pictures", options=ReadOptions((2, 2)))
    import_fails(tmp_path / "in", "picture cannot be read", format="eslf")
    Image.new("RGB", (8, 16)).save(tmp_path / "in" / "01_01.png")
    import_fails(tmp_path / "in", "01_01.png", "8 x 16")


def test_nothing_is_recognised(tmp_path):
    import_fails(tmp_path / "nowhere", "no such file")
    (tmp_path / "in").mkdir()
    import_fails(tmp_path / "in", "known format", "Name its format")
    for name in ("notes.txt", "more.txt"):
        (tmp_path / "in" / name).write_text("views\n")
    import_fails(tmp_path / "in", "known format")
    import_fails(tmp_path / "in", "'nex'", format="nex")
    import_fails(tmp_path / "in", "cannot be imported", format="plenoptic")
    for name in "hci nerfstudio stanford jpeg-pleno folder blender json llff colmap".split():
        import_fails(tmp_path / "in", "in", format=name)
    for name in ("lf.mat", "lf.h5", "a_qs2x2a1.png", "b.eslf.png"):
        (tmp_path / name).write_bytes(np.random.default_rng(1).bytes(999))
        import_fails(tmp_path / name, name)


def edited(old, new):
    """A change of a text file."""
    return lambda file: file.write_bytes(file.read_bytes().replace(old.encode(), new.encode()))


def cut_short(end):
    return lambda file: file.write_bytes(file.read_bytes()[:end])


def posed(change):
    """A change of a file of poses."""

    def spoil(file):
        data = json.loads(file.read_text())
        change(data)
        file.write_text(json.dumps(data))

    return spoil


def in_matrix(row, column, value):
    return posed(lambda d: d["frames"][4]["transform_matrix"][row].__setitem__(column, value))


VIEW, CONFIG, POSES = "input_Cam004.png", "parameters.cfg", "transforms.json"
SPOILT = [
    ("hci", VIEW, Path.unlink, [VIEW, "9 views"]),
    ("hci", VIEW, lambda file: Image.new("RGB", (15, 16)).save(file), [VIEW, "16 x 16"]),
    ("hci", VIEW, cut_short(300), [VIEW]),
    ("hci", CONFIG, edited("baseline_mm", "base"), ["extrinsics.baseline_mm"]),
    ("hci", CONFIG, edited("num_cams_x = 3", "num_cams_x = many"), ["num_cams_x"]),
    ("hci", CONFIG, edited("num_cams_x = 3", "num_cams_x = 0"), ["no views"]),
    ("hci", CONFIG, edited("[extrinsics]", "[extrinsics"), [CONFIG]),
    ("hci", CONFIG, edited("focal_length_mm = ", "focal_length_mm = -"), ["focal_length_mm"]),
    ("hci", CONFIG, edited("baseline_mm = ", "baseline_mm = nan #"), ["baseline_mm"]),
    ("hci", CONFIG, edited("baseline_mm = ", "baseline_mm = -"), ["pitch_m"]),
    ("stanford", "out_01_02_*", Path.unlink, ["row 1 and column 2", "8 of 3 x 3"]),
    ("jpeg-pleno", "002_001.ppm", cut_short(-1), ["002_001.ppm", "1550 expected"]),
    ("jpeg-pleno", "002_001.ppm", edited("P6", "P9"), ["002_001.ppm"]),
    ("nerfstudio", POSES, in_matrix(0, 0, 0.9),
     ["view_001_001.png", "looks in another direction"]),
    ("nerfstudio", POSES, in_matrix(1, 3, 0.1), ["before or behind"]),
    ("nerfstudio", POSES, posed(lambda d: d["frames"].pop()), ["no full grid"]),
    ("nerfstudio", POSES, posed(lambda d: d["frames"][2].pop("transform_matrix")),
     ["transform_matrix"]),
    ("nerfstudio", POSES, posed(lambda d: d.pop("fl_x")), ["fl_x"]),
    ("nerfstudio", POSES, posed(lambda d: d["frames"][2].update(file_path="gone.png")),
     ["gone.png"]),
    ("nerfstudio", POSES, cut_short(6), [POSES]),
    ("colmap", "sparse/0/cameras.txt", edited("PINHOLE", "THIN_PRISM_FISHEYE"),
     ["cameras.txt", "THIN_PRISM", "Models that can be"]),
    ("colmap", "images/view_001_001.png", Path.unlink, ["view_001_001.png", "images.txt asks"]),
]  # fmt: skip


@pytest.mark.parametrize(("format", "name", "spoil", "words"), SPOILT)
def test_what_was_spoilt_is_refused(square, tmp_path, format, name, spoil, words):
    export_lightfield(square.path, format, tmp_path / "out")
    (file,) = (tmp_path / "out").glob(name)
    spoil(file)
    import_fails(tmp_path / "out", *words)


@pytest.mark.parametrize(
    ("change", "words"),
    [(lambda rows: rows[:-1], "8 poses for 9 pictures"), (lambda rows: rows[:, :5], "17 numbers"),
     (lambda rows: np.where(rows == 2, np.nan, rows), "not finite")],
)  # fmt: skip
def test_spoilt_poses_of_llff_are_refused(square, tmp_path, change, words):
    pictures(tmp_path / "in" / "images", square.views, lambda row, column: f"{row}_{column}.png")
    np.save(tmp_path / "in" / "poses_bounds.npy", change(llff_poses(3, 3)))
    import_fails(tmp_path / "in", "poses_bounds.npy", words)


def test_exports_that_cannot_be(square, chart, tmp_path):
    unknown = store(tmp_path, noise(3, 3, 16, 16), Geometry())

    def fails(words, path, format, **more):
        refused(words, export_lightfield, path, format, tmp_path / "out", **more)
        assert list(tmp_path.iterdir()) == [unknown.path]

    for name in ("hci", "nerfstudio", "colmap", "blender"):
        fails("does not hold its geometry.*baseline", unknown.path, name)
    for name in ("folder", "llff"):
        fails(f"'{name}' cannot be exported", square.path, name)
    fails("not a multiple of the 4 mm", square.path, "hci", selection=Selection(baseline_m=0.006))
    fails("mkv: views:", square.path, "hci", selection=Selection((4, 4)))
    fails("mkv: crop:", square.path, "hci", selection=Selection(crop=(1, 1, 16, 16)))
    fails("is not the scene of", square.path, "hci", scene=chart)
    for name in (name for name in FORMATS if FORMATS[name].exports):
        fails("nosuch", square.path, name, device="nosuch")


def test_a_folder_that_is_there_is_left_alone(square, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("keep\n")
    refused("exists already", export_lightfield, square.path, "json", tmp_path / "out")
    assert [file.name for file in tmp_path.iterdir()] == ["out"]


def test_the_command_line(tmp_path, capsys):
    stored = store(tmp_path, noise(2, 2, 16, 16), Geometry())
    out = str(tmp_path / "out")
    assert main(["export", str(stored.path), "--format", "hci", "-o", out]) == 1
    assert "field of view" in capsys.readouterr().err
    assert main(["export", str(stored.path), "--format", "stanford", "-o", out]) == 0
    lf = tmp_path / "lf.mkv"
    assert main(["import", out, "-o", str(lf), "--codec", "ffv1"]) == 0
    assert "geometry is not known" in capsys.readouterr().err
    command = ["import", out, "-o", str(lf), "--baseline", "6mm", "--field-of-view", "40"]
    assert main([*command, "--focus", "1.5"]) == 0
    assert "not known" not in capsys.readouterr().err
    assert main(["import", out, "-o", str(lf), "--order", "across"]) == 1
    assert capsys.readouterr().err.startswith("--order: unknown order")
    export = ["export", str(stored.path), "--format", "json", "-o", str(tmp_path / "json")]
    for option, value in (("--views", "4x4"), ("--crop", "9x9+9+9"), ("--pixels", "8")):
        assert main([*export, option, value]) == 1
        assert f": {option}: " in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*command, "--focus", "x"])


def test_a_mat_file_with_an_unknown_type_ends_no_process(tmp_path):
    """scipy.io reads beyond a table of sizes, and crashes."""
    from scipy.io import savemat

    file = tmp_path / "a.mat"
    savemat(file, {"LF": np.zeros((3, 3, 16, 16, 3), np.uint8)})
    data = bytearray(file.read_bytes())
    at = data.index(b"LF") + 4  # the tag of the values
    data[at : at + 4] = (514).to_bytes(4, "little")
    file.write_bytes(data)
    refused(
        r"a\.mat: .*unknown type 514", import_lightfield, file, tmp_path / "a.mkv", format="mat"
    )

"""Slicing by depth from files: the same pictures as on the fly, up to what the codec changed."""

import itertools
import re

import numpy as np
import pytest
from plain_scenes import CHART, refused
from plain_scenes import scene as plain_scene
from slicing_reference import slice_by_depth
from stored_fields import LOSSLESS

from lfcore import Camera, Encoding, LightField, SensorPlane, Slab
from lfcore.cli import main
from lfcore.colour import srgb_encode
from lfcore.evaluation.metrics import psnr
from lfcore.exchange.pictures import read_pfm
from lfcore.optics.bundles import Bundles
from lfcore.optics.ray_cells import views_of
from lfcore.pictures import read_picture
from lfcore.refocus import depth_slicing, stored_depth
from lfcore.refocus.depth_slicing import DepthSlicer
from lfcore.refocus.free_views import inverse_depth
from lfcore.refocus.stored_views import read_views
from lfcore.rendering import by_depth
from lfcore.rendering.by_depth import trace_by_depth, traced_views
from lfcore.rendering.depth import depth_of_views
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.record_depth import DepthStore, record_by_depth
from lfcore.storage.defaults import frame_layout
from lfcore.storage.depth_stream import sweep_step

pytestmark = pytest.mark.kernels

CAMERA = Camera(0.4, 0.3, 1.0, 4.0)
SLAB, TALL = Slab(CAMERA, 3, 20), Slab.of(CAMERA, 3, (12, 20))
PIXELS = 10
PLANES = [
    SensorPlane(2.5, 1.0, "square"),
    SensorPlane(4.0, 1.4),
    SensorPlane(9.0, 2.0, "polygon", keep_magnification=True),
    SensorPlane(3.0, 4.0, normalise="lens"),
]


def patches(z, x0, x1, count, rng):
    """A wall at depth z from x0 to x1, of triangles of any colours, in columns."""
    edges = np.linspace(x0, x1, count + 1)
    for a, b in itertools.pairwise(edges):
        corners = [(a, -3, z), (b, -3, z), (b, 3, z), (a, 3, z)]
        for three in ((0, 1, 2), (0, 2, 3)):
            yield [corners[k] for k in three], rng.random((3, 3))


@pytest.fixture(scope="module")
def tracer():
    """A rod before a wall, with sky beside it."""
    rng = np.random.default_rng(3)
    made = [*patches(3.0, -0.2, 0.1, 2, rng), *patches(8.0, -3.0, 2.0, 9, rng)]
    triangles, colours = (np.array(each, np.float32) for each in zip(*made, strict=True))
    scene = plain_scene(triangles, colours=colours, camera=CAMERA, ambient=(1.0, 1.0, 1.0))
    return open_tracer(scene)


def stored(path, tracer, kind, displaced=True, spec=LOSSLESS, slab=SLAB, pack=1):
    layout = frame_layout(slab.views, slab.size, spec.pixel_format, kind=kind, pack=pack)
    record_by_depth(path, tracer, slab, DepthStore(layout, spec, displaced, PIXELS))
    return LightField.open(path)


def traced(tracer, displaced, slab=SLAB):
    parts = list(traced_views(tracer, views_of(slab, displaced=displaced), PIXELS))
    return (np.concatenate([part[2][0][k] for part in parts]) for k in (0, 1))


@pytest.mark.parametrize(("displaced", "slab"), [(True, SLAB), (False, SLAB), (True, TALL)])
def test_without_loss_the_store_gives_what_is_made_on_the_fly(
    tmp_path, tracer, displaced, slab, monkeypatch
):
    """Views, some rows of them at a time and macropixels alike, to the last bit."""
    light, depth = traced(tracer, displaced, slab)
    views, pictures = views_of(slab, displaced=displaced), []
    for kind, pack in (("views", 1), ("views", 2), ("macropixels", 4)):
        path = tmp_path / f"{kind}{pack}.mkv"
        field = stored(path, tracer, kind, displaced, slab=slab, pack=pack)
        there = field.views(0, 0, 3, 3, codes=True).reshape(light.shape)
        assert np.abs(there - 255 * srgb_encode(light)).max() < 0.502
        for rays in (1 << 22, 3 * slab.size.width):
            monkeypatch.setattr(stored_depth, "VIEWS_RAYS", rays)
            pictures.append(field.refocus_many(PLANES))
            assert pictures[-1].shape == (4, PIXELS, slab.size.width // 2, 3)
    codes = field.metadata.depth.codes
    held = codes.depth(codes.of_depth(depth))
    samples = np.stack(np.meshgrid(range(3), range(3)), -1).reshape(-1, 2)
    decoded = read_views(field, samples)
    slicer = DepthSlicer(views, PLANES, PIXELS)
    slicer.add(slice(0, 9), decoded, held)
    expected = slicer.pictures()
    for picture in pictures:
        np.testing.assert_array_equal(picture, expected)
        for plane, bounds_px, made in zip(PLANES, slicer.bounds_px, picture, strict=True):
            right = slice_by_depth(
                views, plane, decoded, held, PIXELS,
                least_px=0.25, bounds_px=bounds_px, edge_steps=256,
            )  # fmt: skip
            if plane.normalise == "lens":
                right *= (CAMERA.f_number / plane.f_number) ** 2 * np.pi / 4
            # An edge within float32's rounding of the middle between two steps may go either way.
            assert np.abs(made - right).max() < 2 / (256 * 0.25) / 9 + 2e-3 * right.max()


def test_rows_of_a_file_with_a_quarter_of_the_chroma_give_the_picture_of_whole_views(
    tmp_path, tracer, monkeypatch
):
    spec = Encoding("ffv1", "yuv420p", preset=None, tune=None)
    field = stored(tmp_path / "a.mkv", tracer, "views", spec=spec)
    whole = field.refocus(2.5)
    monkeypatch.setattr(stored_depth, "VIEWS_RAYS", 3 * SLAB.pixels)
    np.testing.assert_array_equal(field.refocus(2.5), whole)


def test_rows_traced_at_a_time_give_the_picture_of_whole_views(tracer, monkeypatch):
    """To the last bit, in strips of another height, too."""
    views = views_of(Slab(CAMERA, 2, 150), displaced=True)
    whole = trace_by_depth(tracer, views, PLANES, 75)
    monkeypatch.setattr(by_depth, "RAYS_AT_A_TIME", 1)
    monkeypatch.setattr(depth_slicing, "STRIP_ROWS", 9)
    np.testing.assert_array_equal(trace_by_depth(tracer, views, PLANES, 75), whole)


def test_any_size_and_a_stack_from_one_file(tmp_path, tracer):
    tall = stored(tmp_path / "tall.mkv", tracer, "views", slab=TALL)
    assert tall.refocus(2.5, pixels=5).shape == tall.refocus(2.5, pixels=(3, 5)).shape == (5, 3, 3)
    shape = "5 x 5 pixels has another shape than the views, 3 x 5"
    refused(shape, tall.refocus, 2.5, pixels=(5, 5))
    field = stored(tmp_path / "a.mkv", tracer, "views")
    assert field.refocus(2.5).shape == (PIXELS, PIXELS, 3)
    assert field.refocus(2.5, pixels=7, filter="depth").shape == (7, 7, 3)
    stack = field.stack([2.5, 9.0], [1.0, 2.0], "square", pixels=13)
    assert stack.shape == (4, 13, 13, 3)
    np.testing.assert_array_equal(stack[3], field.refocus(9.0, 2.0, "square", pixels=13))
    refused("pixels: must be a whole number from 1", field.refocus, 2.5, pixels=0)


def test_displaced_views_serve_slicing_by_depth_alone(tmp_path, tracer):
    """Nothing takes them for views of one grid, and says how to trace such."""
    field = stored(tmp_path / "a.mkv", tracer, "views")
    for wrong in (
        lambda: field.refocus(2.5, filter="nearest"),
        lambda: field.refocus(2.5, filter="bilinear"),
        lambda: field.stack([2.5, 3.0], fast=True),
    ):
        refused(r"a.mkv: .*displaced.*record", wrong)
    plain = stored(tmp_path / "plain.mkv", tracer, "views", False)
    assert plain.refocus(2.5, filter="nearest").shape == (20, 20, 3)
    assert plain.refocus(2.5).shape == (PIXELS, PIXELS, 3)


def test_a_file_without_depth_says_how_to_trace_one(tmp_path, capsys):
    plain, depth = str(tmp_path / "plain.mkv"), str(tmp_path / "depth.mkv")
    record, out = ["record", str(CHART), "--pixels", "16"], ["-o", str(tmp_path / "a.png")]
    assert main([*record, "--views", "2", "--depth", "none", "-o", plain]) == 0
    for options, words in (
        (["--filter", "depth"], "holds no depth"), (["--pixels", "17"], "at most 16"),
    ):  # fmt: skip
        assert main(["refocus", plain, *options, *out]) == 1
        assert words in capsys.readouterr().err
    assert main(["refocus", plain, "--pixels", "8", *out]) == 0
    assert main([*record, "--subpixels", "1.5", "-o", depth]) == 0
    assert main(["info", depth]) == 0
    said = capsys.readouterr().out
    assert "24 x 24 pixels, 4 x 4 views" in said and "views displaced" in said
    assert main(["refocus", depth, "--pixels", "20", *out]) == 0
    assert main([*record, "--depth", "none", "--subpixels", "2", "-o", plain]) == 1
    assert "--subpixels: is for views with depth" in capsys.readouterr().err


def seen_from(point, pixels, over=4):
    """(pixels over)^2 rays from one point."""
    pitch = CAMERA.field_width / (pixels * over)
    middle = np.float32([[*point, *(-np.asarray(point) * CAMERA.delta)]])
    return Bundles(middle, np.float32([0, 0, pitch, pitch]), pixels * over, pixels * over, pitch)


def truth_from(tracer, point):
    """The picture of 24 x 24 pixels from one point, each of 16 rays: rod and wall are flat."""
    light = tracer.bundle_radiance(seen_from(point, 24))[0]
    return np.minimum(light, 1).reshape(24, 4, 24, 4, 3).mean((1, 3))


@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_a_view_from_between_those_stored_is_what_is_seen_from_there(tmp_path, tracer, kind):
    slab = Slab(CAMERA, 4, 48)
    field = stored(tmp_path / "a.mkv", tracer, kind, slab=slab, pack=1 if kind == "views" else 8)
    points = np.array([(0, 0), (0.3, -0.2), (1.5, 1.5), (-1.9, 1.1)]) * slab.lens_pitch_m
    made = field.views_at(points, 24)
    assert made.shape == (4, 24, 24, 3)
    corner = field.views_at(np.array([[1.9, -1.9]]) * slab.lens_pitch_m, 24)[0]
    for point, picture in zip(points, made, strict=True):
        truth = truth_from(tracer, point)
        # The wall's colours have edges, which 16 rays a pixel round off.
        found = psnr(picture[3:-3, 3:-3], truth[3:-3, 3:-3], peak=1)
        assert found > 26
        assert psnr(corner[3:-3, 3:-3], truth[3:-3, 3:-3], peak=1) < found - 3
    seen = inverse_depth(field, 24)
    depth = tracer.bundle_hits(seen_from((0, 0), 24, over=1))[1][0]
    near = np.where(np.isfinite(depth), 1 / depth, 0)
    assert np.median(np.abs(seen - near)) < 2 * sweep_step(slab)
    refused("outside the lens", field.views_at, np.array([[0.0, CAMERA.lens_radius_m * 1.01]]))


def test_a_file_of_few_views_gives_any(tmp_path, tracer, capsys):
    """Exports, arrays, sheets and sharp pictures; their quality is said, and is what truth says."""
    field = stored(tmp_path / "a.mkv", tracer, "views", slab=Slab(CAMERA, 4, 48))
    export = ["export", str(field.path), "--pixels", "24"]
    assert main([*export, "--format", "hci", "--views", "5x5", "-o", str(tmp_path / "hci")]) == 0
    said = capsys.readouterr().err
    (expected,) = re.findall(r"([\d.]+) dB expected", said)
    assert ("Below 35 dB" in said) == (float(expected) < 35)
    worst, apart = np.inf, 0.0
    for number, (j, i) in enumerate(np.ndindex(5, 5)):
        point = (np.array([i, j]) - 2) / 2 * 0.75 * CAMERA.lens_radius_m
        truth = truth_from(tracer, point)
        view = read_picture(tmp_path / "hci" / f"input_Cam{number:03d}.png") / 255
        worst = min(worst, psnr(view, srgb_encode(truth), peak=1))
        found = read_pfm(tmp_path / "hci" / f"gt_depth_lowres_Cam{number:03d}.pfm")
        right = tracer.bundle_hits(seen_from(point, 24, over=1))[1][0]
        assert (np.isinf(found) == np.isinf(right)).mean() > 0.95
        both = np.isfinite(found) & np.isfinite(right)
        apart = max(apart, np.mean(np.abs(1 / found[both] - 1 / right[both]) > 0.02))
    assert abs(worst - float(expected)) < 4 and apart < 0.06
    assert main([*export, "--format", "quilt:8x6", "-o", str(tmp_path / "q")]) == 0
    assert read_picture(tmp_path / "q" / "test_qs8x6a1.png").shape == (6 * 24, 8 * 24, 3)
    # Depth without the scene is the file's own.
    depth = tmp_path / "depth.npz"
    assert main(["depth", "--lightfield", str(field.path), "-o", str(depth)]) == 0
    found, right = np.load(depth)["depth_m"], depth_of_views(tracer, field.made_views)
    assert found.shape == right.shape and np.mean(np.abs(1 / found - 1 / right) > 0.02) < 0.06
    middle = field.views_at(np.zeros((1, 2)))[0]
    np.testing.assert_array_equal(field.all_in_focus(), middle)
    array = pytest.importorskip("xarray") and field.to_xarray()
    assert array.shape == (4, 4, PIXELS, PIXELS, 3)
    made = field.views_at(np.array([[array.s_m.values[1], array.t_m.values[2]]]))[0]
    np.testing.assert_allclose(array.isel(row=2, column=1).values, made, atol=1e-6)
    sheet = tmp_path / "sheet.png"
    assert main(["view", str(field.path), "--grid", "3", "-o", str(sheet)]) == 0
    far = [*export, "--views", "5x5", "--format", "json", "--baseline", "9m", "-o", "x"]
    assert main(far) == 1
    assert "--baseline: 5 views 9000 mm apart do not fit" in capsys.readouterr().err

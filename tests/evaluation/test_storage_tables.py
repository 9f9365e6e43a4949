"""Tables of the store: samples hold what the slab holds, and numbers mean what they say."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from stored_fields import LOSSLESS, write_field

from lfcore import Encoding, Slab
from lfcore.evaluation.metrics import psnr, ssim
from lfcore.evaluation.storage import rate_distortion, retrieval
from lfcore.evaluation.storage.figures import (
    layouts_figure,
    rate_distortion_figure,
    retrieval_figure,
)
from lfcore.evaluation.storage.rate_distortion import (
    Frames,
    frame_quality,
    own_planes,
    store,
    trace_sample,
    window_camera,
    window_side,
)
from lfcore.evaluation.table_files import TableError, read_rows, table_of, write_rows
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.tiles import trace_tile
from lfcore.storage.defaults import default_kind, default_pack
from lfcore.storage.layout import FrameLayout
from lfcore.storage.ycbcr import rgb_from_frames
from lfcore.workflow.settings import check_settings

CONFIGURATIONS = Path(__file__).parents[2] / "config"
REPORTS = CONFIGURATIONS.parent / "workflow" / "reports.yaml"


@pytest.fixture(scope="module")
def sample(chart):
    planes = own_planes(chart.scene)[:2]
    return trace_sample(chart, planes, views=8, pixels=64, most_rays=1)


def test_a_window_has_the_rays_of_the_middle_of_the_picture(chart):
    camera = chart.scene.camera
    whole, window = Slab(camera, 8, 64), Slab(window_camera(camera, 64, 16), 8, 16)
    assert np.allclose(window.pixel_tangents(), whole.pixel_tangents()[24:40], rtol=1e-12)
    assert np.array_equal(window.lens_positions(), whole.lens_positions())


@pytest.mark.parametrize(
    ("views", "pixels", "rays", "window"),
    [(8, 64, 1, 16), (8, 64, 1 << 30, 64), (8, 100, 64 * 41**2, 40), (64, 128, 2359296, 24)],
)
def test_a_window_is_as_large_as_its_rays_allow(views, pixels, rays, window):
    assert window_side(views, pixels, rays) == window


@pytest.mark.kernels
def test_pictures_are_those_formed_while_tracing(sample, chart):
    assert sample.rgb.max() <= 1 and sample.pictures.max() > 0.1
    traced = trace_planes(chart, sample.slab, sample.planes)
    assert np.array_equal(sample.pictures, traced)


def test_frames_of_both_layouts_hold_each_ray_once(sample):
    for kind, pack, order in (("views", 1, "hilbert"), ("macropixels", 4, "raster")):
        frames = Frames(sample, FrameLayout(kind, 8, 16, order, pack, "yuv444p"))
        held = frames.rgb[:, frames.used]
        assert held.size == sample.rgb.size
        assert np.array_equal(np.sort(held, axis=None), np.sort(sample.rgb, axis=None))


@pytest.mark.kernels
def test_lossless_storage_costs_rounding_alone(sample, chart):
    layout = FrameLayout("macropixels", 8, 16, "serpentine", 4, "gbrp")
    stored = store(Frames(sample, layout), LOSSLESS, chart.device)
    # Rounding to codes is at most half a code off: 54 dB; 59 dB where errors are uniform.
    assert min(stored["psnr_frames_db"], stored["psnr_pictures_db"]) > 54
    assert min(stored["ssim_frames"], stored["ssim_pictures"]) > 0.995
    assert stored["encode_seconds"] > 0 and stored["decode_seconds"] > 0


def test_frames_are_compared_a_few_at_a_time_as_all_at_once(monkeypatch, sample):
    frames = Frames(sample, FrameLayout("macropixels", 8, 16, "raster", 1, "yuv420p"))
    assert frames.rgb.shape == (256, 16, 16, 3) and frames.used.sum() == 8 * 8
    decoded = frames.codes.copy()
    decoded[:, ::5] += np.arange(256, dtype=np.uint8)[:, None]
    module, area = "lfcore.evaluation.storage.rate_distortion", 16 * 16
    monkeypatch.setattr(f"{module}.SSIM_PX", 85 * area)
    found = rgb_from_frames(decoded, "yuv420p", 16, 16)
    looked_at = zip(found[::3], frames.rgb[::3], strict=True)
    expected = {
        "psnr_frames_db": psnr(found[:, frames.used], frames.rgb[:, frames.used], peak=1),
        "ssim_frames": np.mean([ssim(a, b, peak=1) for a, b in looked_at]),
    }
    assert frame_quality(frames, decoded) == pytest.approx(expected, abs=1e-5)


@given(views=st.integers(4, 512), pixels=st.integers(16, 128))
def test_every_layout_is_shown_once_and_the_default_is_among_them(views, pixels):
    found = list(rate_distortion.layouts(views, pixels, [1, 2, 4, 8]))
    assert len(set(found)) == len(found)
    assert sum(rate_distortion.is_default(layout, pixels) for layout in found) == 1
    assert {layout.order for layout in found if layout.kind == "views"} == {
        "raster", "serpentine", "hilbert"
    }  # fmt: skip


def curve(rates, decibels):
    return pd.DataFrame({"bits_per_ray": rates, "psnr_frames_db": decibels})


def test_delta_rates():
    rates, decibels = np.array([0.1, 0.2, 0.4, 0.8]), np.array([30.0, 34.0, 37.0, 39.0])
    anchor = curve(rates, decibels)

    def delta(one, other):
        return rate_distortion.delta_rate(one, other, "psnr_frames_db")

    assert delta(anchor, anchor) == (pytest.approx(0, abs=1e-9), 1)
    assert delta(anchor, curve(rates / 2, decibels))[0] == pytest.approx(-50)
    # A point that costs more and gives less takes no part.
    worse = curve(np.append(rates, 1.0), np.append(decibels, 38.0))
    assert delta(anchor, worse)[0] == pytest.approx(0)
    # Curves that hardly meet have none.
    assert delta(anchor[:3], curve(rates[:3], [35.0, 39.0, 42.0])) == (None, pytest.approx(2 / 7))
    assert delta(anchor, anchor[:2]) == (None, 0.0)


@pytest.mark.kernels
def test_rate_and_distortion_of_a_scene(chart, tmp_path, drawn, shows):
    names = (rate_distortion.ANCHOR, "x264 veryfast 4:2:0", "FFV1 RGB, lossless")
    curves = {name: rate_distortion.CURVES[name] for name in names}
    study = {"views": [16], "rays": 1, "crfs": [12, 24, 36], "curves": curves}
    rows = rate_distortion.rate_rows(chart, 32, **study)
    points = table_of(rows, rate_distortion.COLUMNS)
    assert points.curve.tolist() == ["default", *[names[0]] * 3, *[names[1]] * 3, names[2]]
    lossy = points[points.curve == names[0]]
    assert lossy.bits_per_ray.is_monotonic_decreasing
    assert lossy.psnr_frames_db.is_monotonic_decreasing
    assert np.allclose(points.ratio_float32, 96 / points.bits_per_ray, rtol=1e-4)
    deltas = table_of(rate_distortion.bd_rows(points))
    assert deltas.curve.tolist() == list(names[:2])
    assert deltas.bd_rate_frames_percent[0] == pytest.approx(0, abs=1e-6)
    rate_distortion_figure(tmp_path / "rd.png", points, deltas)
    assert shows(drawn[0].axes[0], lossy[["bits_per_ray", "psnr_frames_db"]].to_numpy())


@pytest.mark.kernels
def test_layouts_of_a_scene(chart, tmp_path, drawn, shows):
    rows = rate_distortion.layout_rows(chart, 32, views=[16], rays=1, packs=[1, 2])
    table = table_of(rows, rate_distortion.LAYOUT_COLUMNS)
    assert len(table) == 3 + 3 + 2 and table.is_default.sum() == 1
    assert (table.raw_bytes_float32 == 12 * 256 * 256).all() and (table.psnr_frames_db > 20).all()
    layouts_figure(tmp_path / "layouts.png", table)
    assert shows(drawn[0].axes[0], table[["bits_per_ray", "psnr_pictures_db"]].to_numpy())


@pytest.fixture(scope="module", params=["macropixels", "views"])
def file(request, chart, tmp_path_factory):
    """A light field of four segments of chart."""
    file = tmp_path_factory.mktemp(request.param) / "f.mkv"
    slab, spec = Slab(chart.scene.camera, 16, 32), Encoding(pixel_format="yuv444p", bframes=0)
    layout = FrameLayout(request.param, 16, 32, pixel_format="yuv444p")

    def frames(tile):
        return np.concatenate([chunk.frames.copy() for chunk in trace_tile(chart, slab, tile)])

    write_field(file, slab, layout, frames, spec=spec, tiles=layout.tiles(1 << 16, least=4))
    return file, request.param


@pytest.mark.kernels
def test_reading_costs(file, chart, tmp_path, drawn, shows):
    path, kind = file
    study = {"planes": [1, 5], "rays": 1 << 14, "repeats": 2}
    rows = retrieval.retrieval_rows(path, "chart", (1.0, 2.0), chart.device, **study)
    table = pd.DataFrame(rows).set_index("what")
    assert table.index[0] == retrieval.DECODING and "5 planes" in table.index
    assert table.ratio_to_decoding.iloc[0] == 1 and (table.seconds > 0).all()
    # Planes: 2^14 of 2^18 rays; whole views or macropixels from the first of four segments.
    assert np.allclose(table.measured_share.iloc[:3], 1 / 16)
    everywhere = "a view" if kind == "macropixels" else "a macropixel"
    alone = "a macropixel" if kind == "macropixels" else "a view"
    assert table.measured_share[everywhere] == 0.25
    assert table.decoded_frames_share[everywhere] == 1
    assert table.measured_share[alone] == 1 and table.decoded_frames_share[alone] < 0.25
    retrieval_figure(tmp_path / "r.png", table.reset_index())
    assert shows(drawn[0].axes[0], table[["N", "seconds"]].to_numpy())


def test_planes_are_even_in_dioptres(file):
    field = retrieval.LightFieldFile.open(file[0])
    planes = retrieval.focal_planes(field, (1.0, 2.0), 3)
    assert [plane.delta for plane in planes] == pytest.approx([1, 0.75, 0.5])
    assert retrieval.focal_planes(field, (1.0, 2.0), 1)[0].delta == pytest.approx(0.75)


def test_rows_survive_a_file(tmp_path):
    rows = [{"a": 1, "b": math.inf, "c": None}, {"a": 2, "b": 1.234567, "c": math.nan}]
    write_rows(tmp_path / "r.json", rows)
    again = read_rows([tmp_path / "r.json"])
    assert again == [rows[0], rows[1] | {"c": None}]
    table = table_of(again, ["a", "b", "c"])
    assert table.b.tolist() == [math.inf, 1.2346]
    with pytest.raises(TableError, match="of: c, d"):
        table_of(rows, ["a", "b", "d"])


@pytest.mark.parametrize("name", ["config", "smoke", "micro", "thesis"])
def test_every_curve_of_a_configuration_has_frames_that_its_encoder_takes(name):
    said = yaml.safe_load((CONFIGURATIONS / f"{name}.yaml").read_text(encoding="utf-8"))
    settings = check_settings({"scenes": ["chart"], **said})
    sizes = yaml.safe_load(REPORTS.read_text(encoding="utf-8"))["rate_distortion"]["settings"]
    pixels, study = settings["pixels"], sizes["default"] | sizes.get(settings["studies"], {})
    for views in study["views"]:
        window = window_side(views, pixels, study["rays"])
        kind, pack = default_kind(views, pixels), min(default_pack(views, pixels), window)
        for _, spec in rate_distortion.specs(study["crfs"], rate_distortion.CURVES):
            layout = FrameLayout(kind, views, window, pack=pack, pixel_format=spec.pixel_format)
            spec.check_frame(layout.frame_width, layout.frame_height)

"""What our pictures stand beside: plenoptic cameras, other renderers, and a shorter program."""

import dataclasses
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from lfcore import OpticsError, SensorPlane
from lfcore.colour import srgb_decode
from lfcore.evaluation import renderers
from lfcore.evaluation.equivalence import equivalence
from lfcore.evaluation.left_out import (
    COLUMNS,
    FEATURES,
    LeftOutError,
    check_identical,
    full_needs,
    left_out,
    same,
)
from lfcore.evaluation.plenoptic_figure import detail, panels, plenoptic_sheet, reduced, take
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.evaluation.table_files import table_of
from lfcore.opencl.device import open_device
from lfcore.pictures import write_picture
from lfcore.scene.appearance import DIRECTIONAL, Light, Material
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.surfaces import pack_surfaces

PLANES = [SensorPlane(1.33, 1.0), SensorPlane(1.2, 1.4, "square"), SensorPlane(1.6, 1.0)]


@pytest.fixture(scope="module")
def result(chart):
    return equivalence(chart, PLANES, views=16, pixels=64, reference_views=32)


def of(result, method, filter):
    found = [m for m in result.made if m.method.startswith(method) and m.filter == filter]
    assert len(found) == 1
    return found[0].pictures


@pytest.mark.kernels
def test_one_filter_one_picture(result):
    """Slicing, views and photograph see the same rays: only 8-bit frames lie between."""
    slicing = of(result, "slicing", "nearest")
    for method in ("shift-sum on views", "shift-sum on the plenoptic"):
        difference = np.abs(of(result, method, "nearest") - slicing)
        assert difference.max() < 0.015
        assert difference.mean() < 0.002
    bilinear = [of(result, f"shift-sum on {what}", "bilinear") for what in ("views", "the p")]
    assert np.abs(bilinear[0] - bilinear[1]).max() < 0.015


@pytest.mark.kernels
def test_table_is_whole_and_plausible(result):
    table = pd.DataFrame(result.rows)
    assert len(table) == 3 * 6
    ours = table[table.method != "traced directly"]
    assert (ours.psnr_db > 20).all() and (ours.psnr_inside_db > 26).all()
    assert ours.ssim.between(0.5, 1).all()
    # Errors of resampling gather at edges; at the recorded focus nothing is resampled.
    assert (ours[ours.focus_m != 1.33].error_at_edges > 0.1).all()
    assert (table.seconds > 0).all()
    own = table[table.method == "traced directly"]
    assert np.isinf(own.psnr_db).all() and (own.rays_per_pixel == 1024).all()
    # At the recorded focus nothing has to be resampled: only the number of rays differs.
    assert (ours[ours.focus_m == 1.33].psnr_db > 30).all()
    assert all(errors.max() > 0 for _, errors in result.errors())


def test_what_was_not_recorded_is_refused(chart):
    with pytest.raises(OpticsError, match="wider"):
        equivalence(chart, [SensorPlane(2.0, 0.5)], views=4, pixels=32)


@pytest.fixture(scope="module")
def pictures(chart):
    return [take(chart, focus, 64, 8) for focus in (2.0, 1.33)]


def spread(picture):
    """How much the pixels of a microlens differ, over the upper half, where the far plane is."""
    cells = picture[: len(picture) // 2].astype(float)
    cells = cells.reshape(-1, 8, 64, 8, 3)
    return cells.std(axis=(1, 3)).mean()


@pytest.mark.kernels
def test_a_microlens_in_focus_is_of_one_colour(pictures):
    (camera, in_focus), (other, out_of_focus) = pictures
    assert in_focus.shape == (512, 512, 3)
    # What differs in focus are the nearer plane's edge and 8-bit codes.
    assert spread(in_focus) < 0.25 * spread(out_of_focus)
    assert camera.camera.field_width == pytest.approx(other.camera.field_width)


def test_reduced_and_detail(pictures):
    pixels = pictures[1][1]
    cell = srgb_decode(pixels[8:16, 40:48]).mean((0, 1))
    assert np.allclose(reduced(pixels, 8)[1, 5], cell, atol=1e-6)
    shown = detail(pixels, 8)
    assert shown.shape == (384, 384, 3)  # 24 x 24 microlenses of 8 pixels, twice as large
    assert np.array_equal(shown[0, 0], srgb_decode(pixels[160, 160]))


def test_sheet_and_whole_photograph(pictures, chart, tmp_path):
    shown, labels = panels(chart, *pictures[1], (1.0, 2.0))
    assert len(shown) == len(labels) == 6
    # Refocused, the text of the far plane comes back.
    sharp, blurred = (np.abs(np.diff(p[:32].mean(-1), axis=1)).mean() for p in (shown[5], shown[0]))
    assert sharp > 1.3 * blurred
    plenoptic_sheet(tmp_path / "sheet.png", [(shown, labels)])
    assert Image.open(tmp_path / "sheet.png").width > 6 * 384
    write_picture(tmp_path / "photo.png", pictures[1][1])
    assert np.array_equal(np.asarray(Image.open(tmp_path / "photo.png")), pictures[1][1])


@pytest.mark.kernels
def test_missing_renderers_are_left_out_aloud(monkeypatch, chart, tmp_path):
    monkeypatch.setattr(renderers.shutil, "which", lambda name: None)
    monkeypatch.setattr(renderers.importlib.util, "find_spec", lambda name: None)
    rows, rendered = renderers.compare(chart, (1.0, 2.0), pixels=32, views=4)
    table = table_of(rows, renderers.COLUMNS)
    assert len(table) == 8
    missing = table[table.method.isin(["POV-Ray", "Mitsuba 3"])]
    assert missing.note.str.startswith("left out").all() and missing.psnr_db.isna().all()
    assert missing.note.str.contains("not installed").all()
    ours = table[table.method.str.startswith("lfcore")]
    assert (ours.psnr_db > 20).all() and (ours.mrays_per_second > 0).all()
    # Rays spread over the pixels are nearer the reference.
    assert ours.psnr_db.iloc[1] > ours.psnr_db.iloc[0]
    renderers.renderers_sheet(tmp_path / "sheet.png", rendered, (1.0, 2.0))
    with Image.open(tmp_path / "sheet.png") as sheet:
        assert sheet.width < 2.5 * 256 and sheet.height > 4 * 256


TRIANGLES = np.array(
    [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]], np.float32
)
BEHIND = [[[-1, -1, -2], [1, -1, -2], [0, 1, -2]]]


@pytest.fixture(scope="module")
def plain():
    """A scene that needs nothing but one light, and has a triangle that nobody can see.

    The light casts no shadow: of the programs with all that the scene lacks, those with shadows are
    the dearest to build, and now two have them.
    """
    light = Light(DIRECTIONAL, (0.0, -0.6, -0.8), (1.0, 1.0, 1.0), casts_shadows=False)
    triangles = [*TRIANGLES, *BEHIND]
    return bare_scene(triangles, lights=[light], materials=[Material("grey")], ambient=(0.0,) * 3)


def test_every_feature_has_its_place():
    """A new field of Needs, or a new define, fails here until the registry says what it saves."""
    scene = bare_scene(TRIANGLES)
    assert {feature.field for feature in FEATURES} == {f.name for f in dataclasses.fields(Needs)}
    defines = {define for feature in FEATURES for define in feature.defines}
    assert defines == set(pack_surfaces(scene, Needs.of(scene)).defines)


@pytest.mark.parametrize("feature", FEATURES, ids=lambda feature: feature.field)
def test_the_full_program_is_fuller(feature):
    """Filling in a feature switches its define on: else full and lean would be one program."""
    scene = bare_scene(TRIANGLES, ambient=(0.0,) * 3)
    needs, filled = Needs.of(scene), feature.fill(scene)
    assert feature.missing(needs)
    lean = pack_surfaces(scene, needs).defines
    full = pack_surfaces(filled, full_needs(filled, feature.field)).defines
    assert all(full[define] > lean[define] for define in feature.defines)
    assert all(full[define] >= lean[define] for define in full)


@pytest.mark.kernels
def test_pictures_are_identical_without_what_is_left_out(plain):
    device = open_device(threads=1)
    bvh = build_bvh(plain.triangles)
    made = left_out(plain, bvh, device, views=16, pixels=16, repeats=1)
    assert all(set(row) == set(COLUMNS) for row in made)
    found = {row["feature"]: row for row in made}
    assert set(found) == {f.field for f in FEATURES} - {"directional_lights"} | {
        "frames", "planes", "lens_blocks", "triangles", "dark_lights",
    }  # fmt: skip
    assert [name for name, row in found.items() if not row["identical"]] == []
    assert found["vertex_colours"]["bytes_saved"] >= 4 * 9 * len(plain.triangles)
    assert found["triangles"]["what"].startswith("1 of 3 triangles")
    assert all(row["bytes_saved"] >= 0 for row in made)


def test_a_picture_loads_no_video_library_and_none_that_filters_textures():
    program = f"""if True:
        import sys, lfcore
        scene = lfcore.Scene.from_triangles({TRIANGLES.tolist()})
        assert lfcore.render(scene, pixels=16, views=2, filter="nearest").any()
        print({{"av", "cv2"}} & set(sys.modules))
        """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


def test_what_differs_is_not_called_identical():
    zero, one = np.zeros(3), np.array([0.0, 0.0, 1e-30])
    assert same([zero], [zero.copy()])
    assert not same([zero], [one]) and not same([zero], [zero, zero])


def test_a_row_that_differs_is_an_error():
    rows = [{"scene": "s", "feature": name, "identical": name != "fog"} for name in ("a", "fog")]
    check_identical(rows[:1])
    with pytest.raises(LeftOutError, match="s, fog"):
        check_identical(rows)

"""Out and in again: every view to the last bit, and the geometry where the format holds it."""

import numpy as np
import pytest
from noise_fields import all_views, taken_back

from lfcore import Geometry, ReadOptions, Selection, export_lightfield

FOLDERS = "hci stanford nerfstudio colmap json jpeg-pleno mosaic eslf mat hdf5".split()
WHOLE = {"hci", "nerfstudio", "colmap", "json"}
"""Formats that hold the whole geometry."""
ONE_PICTURE = {"mosaic", "eslf"}


def check_geometry(found, expected, whole):
    if not whole:
        assert not found.metric
        return
    assert found.metric
    ours, theirs = found.slab, expected.slab
    assert ours.lens_pitch_m == pytest.approx(theirs.lens_pitch_m, rel=1e-5)
    assert ours.pixel_pitch == pytest.approx(theirs.pixel_pitch, rel=1e-5)
    assert ours.camera.delta == pytest.approx(theirs.camera.delta, rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("format", FOLDERS)
@pytest.mark.parametrize("shape", ["square", "wide"])
def test_folders(format, shape, tmp_path, request):
    if format == "hdf5":
        pytest.importorskip("h5py")
    stored = request.getfixturevalue(shape)
    export_lightfield(stored.path, format, tmp_path / "out")
    rows, columns = stored.views.shape[:2]
    options = ReadOptions((columns, rows)) if format in ONE_PICTURE else None
    grid, field = taken_back(tmp_path / "out", tmp_path, options=options)
    assert grid.format == format
    assert field.picture_size == stored.views.shape[3:1:-1]
    np.testing.assert_array_equal(all_views(field), stored.views)
    check_geometry(field, stored.field, format in WHOLE)


def test_a_part_of_it(square, tmp_path):
    selection = Selection((2, 2), 0.008, (3, 2, 8, 6))
    export_lightfield(square.path, "hci", tmp_path / "out", selection=selection)
    _, field = taken_back(tmp_path / "out", tmp_path)
    np.testing.assert_array_equal(all_views(field), square.views[::2, ::2, 2:8, 3:11])
    assert field.slab.lens_pitch_m == pytest.approx(0.008)
    assert field.slab.pixel_pitch == pytest.approx(0.02)


def test_what_is_asked_for_by_name_completes_the_geometry(square, tmp_path):
    export_lightfield(square.path, "stanford", tmp_path / "out")
    options = ReadOptions(geometry=Geometry(delta=0.5), fov_deg=18.180)
    _, field = taken_back(tmp_path / "out", tmp_path, options=options)
    assert field.metric
    assert field.slab.lens_pitch_m == pytest.approx(0.004)
    assert field.slab.pixel_pitch == pytest.approx(0.02, rel=1e-3)
    assert field.refocus(focus_m=2.5).shape == (16, 16, 3)

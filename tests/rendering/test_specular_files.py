"""Files with specular light apart: pictures, views and depths are those of the scene."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from mirror_room import CAMERA, PIXELS, PLANES, make_scene, mirror_room, wall
from stored_fields import LOSSLESS

from lfcore import Encoding, LightField, SensorPlane
from lfcore.evaluation.metrics import psnr
from lfcore.optics.slab import Lattice
from lfcore.refocus.free_views import FreeViews
from lfcore.rendering.by_depth import trace_by_depth
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.record_depth import depth_store, record_by_depth
from lfcore.storage.depth_stream import DepthCodes
from lfcore.storage.metadata import TWO_PARTS

pytestmark = pytest.mark.kernels
LATTICE = Lattice(4, 2)


@pytest.fixture(scope="module")
def tracer():
    return open_tracer(mirror_room())


def recorded(path, tracer, spec=LOSSLESS, lattice=LATTICE, **layout):
    slab, store = depth_store(CAMERA, lattice, PIXELS, spec, **layout)
    record_by_depth(path, tracer, slab, store)
    return LightField.open(path)


@pytest.fixture(scope="module")
def field(tmp_path_factory, tracer):
    return recorded(tmp_path_factory.mktemp("specular") / "field.mkv", tracer)


def test_a_file_has_two_more_streams_only_with_specular_surfaces(field, tmp_path):
    assert field.metadata.version == TWO_PARTS and len(field.metadata.streams) == 4
    field.verify()
    matt = make_scene([(*wall(4.0, -6, 6, 5, np.random.default_rng(1)), {})])
    plain = recorded(tmp_path / "plain.mkv", open_tracer(matt))
    assert plain.metadata.version < TWO_PARTS and plain.specular is None


def test_the_small_reader_refuses_a_file_that_it_would_read_in_part(field):
    script = Path(__file__).parents[2] / "docs/examples/read_light_field.py"
    with pytest.raises(ValueError, match="specular light"):
        runpy.run_path(str(script))["read"](field.path)


@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_pictures_are_those_of_traced_rays(tmp_path, tracer, kind):
    stored = recorded(tmp_path / "field.mkv", tracer, kind=kind)
    views = stored.require_depth().views(stored.require_slab())
    traced = trace_by_depth(tracer, views, PLANES, PIXELS)
    for found, right in zip(stored.refocus_many(PLANES), traced, strict=True):
        assert psnr(found, right, peak=1) > 45


def test_lossy_files_hold_both_parts(tmp_path, tracer, field):
    lossy = recorded(tmp_path / "lossy.mkv", tracer, Encoding(crf=16, pixel_format="yuv444p10le"))
    for found, right in zip(lossy.refocus_many(PLANES), field.refocus_many(PLANES), strict=True):
        assert psnr(found, right, peak=1) > 36


def test_views_have_all_light_and_depth_is_the_surfaces(field):
    both, alone = field.views(0, 0, 2, 1), field.specular.views(0, 0, 2, 1)
    assert alone.max() > 0.3 and (both >= alone - 1e-6).all()
    views = FreeViews(field)
    inverse = views.inverse_depth(views.views.positions[5])
    assert abs(1 / inverse[16, 12] - 4.0) < 0.1  # the mirror, not its image


def test_virtual_depth_is_that_of_the_image(field, tracer):
    """Of a plane mirror at 4 m, that of the wall as far before it as behind the lens."""
    for depths in (field.depth(virtual=True), field.depth(tracer.scene, virtual=True)):
        assert abs(np.median(depths[5, 12:20, 10:14]) - 12.0) < 0.2
    assert abs(np.median(field.depth()[5, 12:20, 10:14]) - 4.0) < 0.1


def test_a_view_from_a_point_shows_what_the_mirror_shows(field):
    views = FreeViews(field)
    made = views.picture(views.views.positions[5])
    assert psnr(made, views.only(5), peak=1) > 28


def test_gaps_are_codes_without_depth():
    slab, _ = depth_store(CAMERA, LATTICE, PIXELS, LOSSLESS)
    codes = DepthCodes.of_range(slab, 0.0, 0.4, gaps=True)
    depth = np.float32([0.0, np.inf, 2.5, 10.0])
    found = codes.depth(codes.of_depth(depth))
    assert found[0] == 0 and np.isinf(found[1])
    np.testing.assert_allclose(found[2:], depth[2:], rtol=0.02)
    assert codes.of_depth(depth)[2] < codes.absent < codes.last


def test_nearest_pictures_add_both_parts(tmp_path, tracer):
    plain = Lattice(4, 1, displaced=False)
    field = recorded(tmp_path / "plain.mkv", tracer, lattice=plain)
    views = field.views(0, 0, 4, 4).mean((0, 1))
    middle = slice(8, 24)
    for how in ({"filter": "nearest"}, {"method": "shift-sum"}):
        made = field.refocus_many([SensorPlane(4.0, 1.0, "square")], **how)[0]
        assert abs(made[middle, middle].mean() - views[middle, middle].mean()) < 0.02

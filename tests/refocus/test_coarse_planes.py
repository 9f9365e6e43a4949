"""Pictures coarser than the slab: every ray on the pixel of its exact place, whoever adds it."""

from dataclasses import replace

import numpy as np
import pytest

from lfcore.api import render
from lfcore.errors import OpticsError
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.lightfield import LightField
from lfcore.opencl.device import open_device
from lfcore.optics import bundles
from lfcore.optics.lattice import Lattice
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.oracle.planes import form_plane
from lfcore.refocus.shift_sum import shift_sum
from lfcore.refocus.slicing import form_planes
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.record import record_slab
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding
from lfcore.storage.layout import FrameLayout

pytestmark = pytest.mark.kernels

TRIANGLES = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]
VIEWS, PIXELS = 6, 24
KINDS = ("macropixels", "views")


@pytest.fixture(scope="module")
def tracer():
    scene = bare_scene(TRIANGLES, ambient=(0.5, 0.4, 0.3))
    return open_tracer(scene, open_device(threads=1))


def planes_of(tracer, side):
    f_number = tracer.scene.camera.f_number
    return [
        SensorPlane(2.0, f_number, "square", pixels=side),
        SensorPlane(3.1, 1.4 * f_number, pixels=side),
        SensorPlane(1.3, f_number, pixels=side, normalise="lens", keep_magnification=True),
    ]


@pytest.mark.parametrize("side", [PIXELS, 12, 8, 7, 1])
def test_the_tracer_adds_what_the_reference_scatters(tracer, side):
    slab, planes = Slab(tracer.scene.camera, VIEWS, PIXELS), planes_of(tracer, side)
    places = np.stack(np.meshgrid(np.arange(PIXELS), np.arange(PIXELS)), -1).reshape(-1, 2)
    light = tracer.bundle_radiance(bundles.macropixels(slab, places), places).clip(0, 1)
    rays = light.reshape(PIXELS, PIXELS, VIEWS, VIEWS, 3).astype(float)
    made = trace_planes(tracer, slab, planes)
    assert made.shape == (3, side, side, 3)
    for plane, picture in zip(planes, made, strict=True):
        np.testing.assert_allclose(picture, form_plane(slab, plane, rays), atol=2e-6)


def test_as_many_pixels_as_the_slab_change_no_bit(tracer):
    slab, planes = Slab(tracer.scene.camera, VIEWS, PIXELS), planes_of(tracer, PIXELS)
    plain = [replace(plane, pixels=None) for plane in planes]
    np.testing.assert_array_equal(
        trace_planes(tracer, slab, planes), trace_planes(tracer, slab, plain)
    )


def test_macropixels_and_views_give_the_same_integers(tracer, tmp_path):
    """Lossless files of the same codes, whose sums are compared bit by bit."""
    slab, spec = Slab(tracer.scene.camera, VIEWS, PIXELS), chosen_encoding(VIEWS, Encoding("ffv1"))
    planes, sums = planes_of(tracer, 7), []
    for kind in KINDS:
        file = tmp_path / f"{kind}.mkv"
        layout = FrameLayout(kind, VIEWS, PIXELS, pixel_format=spec.pixel_format)
        record_slab(file, [tracer], slab, layout, spec)
        sums.append(form_planes(file, planes).sums)
    np.testing.assert_array_equal(sums[0].sums[:, :, :7, :7], sums[1].sums[:, :, :7, :7])
    traced = trace_planes(tracer, slab, planes)
    assert np.abs(sums[0].pictures() - traced).max() < 0.01, "8 bits a ray"
    with LightField.open(tmp_path / "views.mkv") as field:
        plane = replace(planes[0], pixels=None)
        (picture,) = field.refocus_many([plane], pixels=7)
        np.testing.assert_array_equal(picture, sums[0].pictures()[0])
        with pytest.raises(OpticsError, match="formed by slicing"):
            field.refocus_many([plane], pixels=7, method="shift-sum")
        with pytest.raises(OpticsError, match="finer than the slab's 24"):
            field.refocus_many([plane], pixels=25)
        with pytest.raises(OpticsError, match="formed by slicing"):
            shift_sum(field, planes)


def test_coarse_pictures_are_rendered(tracer):
    camera = tracer.scene.camera
    slab = Slab(camera, VIEWS, PIXELS)
    plane = SensorPlane(camera.focus_m, camera.f_number)
    (coarse,) = trace_planes(tracer, slab, [replace(plane, pixels=8)])
    asked = {"pixels": 8, "filter": "nearest", "device": tracer.device}
    rendered = render(tracer.scene, views=Lattice(VIEWS, 3, displaced=False), **asked)
    np.testing.assert_array_equal(rendered, coarse)
    one = render(tracer.scene, views=VIEWS, **asked)
    assert np.abs(one - coarse).max() > 0.01, "one place of a pixel is not its mean"


def test_planes_of_several_sizes_are_refused(tracer):
    slab = Slab(tracer.scene.camera, VIEWS, PIXELS)
    planes = [SensorPlane(2.0, 50.0, pixels=side) for side in (6, 8)]
    with pytest.raises(OpticsError, match="6 and 8 pixels cannot be formed together"):
        trace_planes(tracer, slab, planes)
    with pytest.raises(OpticsError, match="pixels: must be a whole number"):
        SensorPlane(2.0, 50.0, pixels=0)

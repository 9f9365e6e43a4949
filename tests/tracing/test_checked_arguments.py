"""What comes from outside is checked before a kernel sees it, and results follow from the job."""

import dataclasses
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from tracing_scenes import CAMERA, painted_soup

from lfcore.errors import DeviceError, OpticsError, SceneError
from lfcore.opencl import device as devices
from lfcore.opencl.device import open_device
from lfcore.optics import bundles as rays
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import chunks
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.device_scene import MOST_NUMBERS, check_indices
from lfcore.tracing.job import PacketJob
from lfcore.tracing.tracer import Tracer

SLAB = Slab(CAMERA, 8, 40)
PIXELS = np.stack(np.meshgrid(np.arange(4), np.arange(4)), -1).reshape(-1, 2)


@pytest.fixture(scope="module")
def tracer():
    world = painted_soup()
    return Tracer(world, build_bvh(world.triangles))


@pytest.mark.parametrize("threads", [-1, 0])
def test_a_device_has_at_least_one_thread(threads):
    with pytest.raises(DeviceError, match="threads"):
        open_device(threads=threads)


@pytest.mark.parametrize("outer", [0, 3, 8])
def test_a_block_spans_1_2_or_4_elements(outer):
    world = painted_soup()
    with pytest.raises(OpticsError, match="outer"):
        Tracer(world, build_bvh(world.triangles), outer=outer)


@pytest.mark.parametrize("shape", [(15, 8, 8, 3), (16, 8, 8), (17, 8, 8, 3)])
def test_radiance_goes_to_memory_of_its_size(tracer, shape):
    bundles = rays.macropixels(SLAB, PIXELS)
    with pytest.raises(OpticsError, match="out"):
        tracer.bundle_radiance(bundles, PIXELS, out=np.zeros(shape, np.float32))


@pytest.mark.parametrize("across", [-4, 0, 3, 32])
def test_tiles_of_an_image_fill_whole_rows(tracer, across):
    with pytest.raises(OpticsError, match="across"):
        tracer.mosaic_radiance([rays.macropixels(SLAB, PIXELS)], PIXELS, across)


def test_sets_of_an_image_have_one_shape(tracer):
    sets = [rays.macropixels(SLAB, PIXELS), rays.macropixels(SLAB, PIXELS[:8])]
    with pytest.raises(OpticsError, match="sets"):
        tracer.mosaic_radiance(sets, PIXELS, 4)


@pytest.mark.parametrize("name, wrong", [
    ("elements", np.zeros((16, 4))), ("elements", np.zeros((16, 3), np.float32)),
    ("step", np.zeros(4)), ("columns", 0),
])  # fmt: skip
@pytest.mark.parametrize("method", ["bundle_hits", "bundle_radiance"])
def test_bundles_have_the_numbers_that_kernels_read(tracer, method, name, wrong):
    bundles = dataclasses.replace(rays.macropixels(SLAB, PIXELS), **{name: wrong})
    with pytest.raises(OpticsError, match="sets" if name == "columns" else name):
        getattr(tracer, method)(bundles)


@pytest.mark.parametrize("method", ["bundle_hits", "bundle_radiance"])
@pytest.mark.parametrize(
    "coordinates", [PIXELS[[0] * len(PIXELS)], PIXELS[[*range(15), 0]], PIXELS[:15], PIXELS[:, :1]]
)
def test_places_are_given_once_for_each_element(method, coordinates):
    world = painted_soup()
    tracer = Tracer(world, build_bvh(world.triangles), outer=2)
    with pytest.raises(OpticsError, match="coordinates"):
        getattr(tracer, method)(rays.macropixels(SLAB, PIXELS), coordinates)


PACKED = FrameLayout("macropixels", 4, 50, pack=8, pixel_format="yuv444p")
"""The last frame of each row has slots without a ray."""


def packed_frames(tracer):
    chunks = tracer.trace_tile(Slab(CAMERA, 4, 50), PACKED.tile(0, 0, 50, 50))
    return [chunk.frames.copy() for chunk in chunks]


@pytest.fixture
def small_chunks(monkeypatch):
    monkeypatch.setattr(chunks, "CHUNK_BYTES", 5 * PACKED.frame_bytes)
    for name, value in (("ENCODER_FRAMES", 0), ("LEAST_FRAMES", 1), ("GROUPED_SHARE", 0)):
        monkeypatch.setattr(chunks, name, value)


def test_frames_do_not_depend_on_how_much_is_made_at_once(tracer, request):
    (whole,) = packed_frames(tracer)
    request.getfixturevalue("small_chunks")
    parts = packed_frames(tracer)
    assert len(parts) > 5
    np.testing.assert_array_equal(np.concatenate(parts), whole)


def test_no_kernel_is_launched_while_frames_are_mapped(tracer, small_chunks, monkeypatch):
    mapped, launch, views = devices.Device.mapped, PacketJob.launch, []

    @contextmanager
    def counted(*arguments, **options):
        with mapped(*arguments, **options) as view:
            views.append(view)
            yield view
            views.pop()

    def checked(*arguments, **sink):
        assert not views
        launch(*arguments, **sink)

    monkeypatch.setattr(devices.Device, "mapped", counted)
    monkeypatch.setattr(PacketJob, "launch", checked)
    assert len(packed_frames(tracer)) > 5


def test_planes_hold_the_rays_of_rows_beyond_32768():
    """The recorded focus puts each ray into its own pixel: a tile fills all of its own."""
    world = dataclasses.replace(painted_soup(), background=(1.0, 1.0, 1.0))
    slab = Slab(CAMERA, 2, 40_000)
    tracer = Tracer(world, build_bvh(world.triangles))
    tile = FrameLayout("macropixels", 2, 40_000, pixel_format="yuv444p").tile(0, 39_000, 64, 64)
    plane = SensorPlane(CAMERA.focus_m, CAMERA.f_number)
    tracing = tracer.trace_tile(slab, tile, [plane], frames=False)
    list(tracing)
    assert tracing.plane_sums.sums[0].any(axis=0).sum() == 64 * 64


def test_what_was_traced_before_changes_nothing():
    """The same call is planned in the same way, whatever elements were asked for earlier."""
    world = painted_soup()
    bvh = build_bvh(world.triangles)
    slab = Slab(CAMERA, 16, 64)
    everywhere = np.stack(np.meshgrid(np.arange(64), np.arange(64)), -1).reshape(-1, 2)
    parts = [everywhere[:64], everywhere[2000:2064], everywhere]
    for part in parts:
        fresh, used = Tracer(world, bvh), Tracer(world, bvh)
        for other in parts:
            used.bundle_hits(rays.macropixels(slab, other), other)
        for ours, again in zip(
            fresh.bundle_hits(rays.macropixels(slab, part), part),
            used.bundle_hits(rays.macropixels(slab, part), part),
            strict=True,
        ):
            np.testing.assert_array_equal(ours, again)


def test_plans_are_remembered_with_the_elements_they_are_for(monkeypatch):
    """A plan for one place is not used for another."""
    world = painted_soup()
    tracer = Tracer(world, build_bvh(world.triangles))
    answers = iter([1, 4])
    monkeypatch.setattr("lfcore.tracing.plan.best_outer", lambda *_: next(answers))
    slab = Slab(CAMERA, 16, 64)
    found = [tracer.plan.outer(rays.macropixels(slab, PIXELS + 20 * k), "HITS") for k in (0, 1, 0)]
    assert found == [1, 4, 1]


def test_arrays_beyond_32_bit_indices_are_refused():
    limit = SimpleNamespace(size=MOST_NUMBERS)
    check_indices([limit])
    with pytest.raises(SceneError, match="too large"):
        check_indices([limit, SimpleNamespace(size=MOST_NUMBERS + 1)])


def test_a_device_without_float64_is_named_in_the_log(monkeypatch, caplog):
    real = open_device().device
    fake = SimpleNamespace(
        name="plain", type=real.type, double_fp_config=0, native_vector_width_float=16
    )
    monkeypatch.setattr(devices, "_choose", lambda name: fake)
    monkeypatch.setattr(devices, "_context", lambda device: devices.cl.Context([real]))
    open_device()
    assert "float64" in caplog.text

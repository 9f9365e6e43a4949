"""Arguments are checked, host and kernels agree about records, and results follow from the job."""

import dataclasses
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from plain_scenes import refused
from tracing_scenes import CAMERA, painted_soup

import lfcore
from lfcore import SensorPlane, Slab, open_device
from lfcore.opencl import device as devices
from lfcore.optics.bundles import macropixels
from lfcore.rendering import tiles
from lfcore.rendering.tiles import chunk_cuts, trace_tile
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import layouts
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.device_scene import MOST_NUMBERS, check_indices
from lfcore.tracing.job import PacketJob
from lfcore.tracing.packets import ranks
from lfcore.tracing.tracer import Tracer

SLAB = Slab(CAMERA, 8, 40)
PIXELS = np.stack(np.meshgrid(np.arange(4), np.arange(4)), -1).reshape(-1, 2)


def painted_tracer(**options):
    world = painted_soup()
    return Tracer(world, build_bvh(world.triangles), **options)


@pytest.fixture(scope="module")
def tracer():
    return painted_tracer()


ALL = macropixels(SLAB, PIXELS)


def test_arguments_that_cannot_be_are_refused(tracer):
    for threads in (-1, 0):
        refused("threads", open_device, threads=threads)
    for across in (-4, 0, 3, 32):
        refused("across", tracer.mosaic_radiance, [ALL], across)
    refused("sets", tracer.mosaic_radiance, [ALL, macropixels(SLAB, PIXELS[:8])], 4)
    spanning = painted_tracer(spanning=True)
    for method in ("bundle_hits", "bundle_radiance"):
        for name, wrong, words in (
            ("elements", np.zeros((16, 4)), "elements"), ("step", np.zeros(4), "step"),
            ("elements", np.zeros((16, 3), np.float32), "elements"), ("columns", 0, "sets"),
        ):  # fmt: skip
            refused(words, getattr(tracer, method), dataclasses.replace(ALL, **{name: wrong}))
        # Places are given once for each element.
        for places in (PIXELS[[0] * 16], PIXELS[[*range(15), 0]], PIXELS[:15], PIXELS[:, :1]):
            refused("coordinates", getattr(spanning, method), ALL, places)


PACKED = FrameLayout("macropixels", 4, 50, pack=8, pixel_format="yuv444p")
"""The last frame of each row has slots without a ray."""


def packed_frames(tracer):
    chunks = trace_tile(tracer, Slab(CAMERA, 4, 50), PACKED.tile(0, 0, 50, 50))
    return [chunk.frames.copy() for chunk in chunks]


@pytest.fixture
def small_chunks(monkeypatch):
    monkeypatch.setattr(tiles, "CHUNK_RAYS", 5 * 64 * 4**2)


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
    tracing = trace_tile(tracer, slab, tile, [plane], frames=False)
    list(tracing)
    assert tracing.plane_sums.sums[0].any(axis=0).sum() == 64 * 64


def test_arrays_beyond_32_bit_indices_are_refused():
    limit = SimpleNamespace(size=MOST_NUMBERS)
    check_indices([limit])
    refused("too large", check_indices, [limit, SimpleNamespace(size=MOST_NUMBERS + 1)])


def test_a_device_without_float64_is_named_in_the_log(monkeypatch, caplog):
    real = open_device().device
    fake = SimpleNamespace(
        name="plain", type=real.type, double_fp_config=0, native_vector_width_float=16
    )
    monkeypatch.setattr(devices, "_choose", lambda name: fake)
    monkeypatch.setattr(devices, "_context", lambda device: devices.cl.Context([real]))
    open_device()
    assert "float64" in caplog.text


@pytest.mark.kernels
def test_a_kernel_takes_every_argument_by_name(tracer):
    kernel = tracer.job("HITS", macropixels(Slab(CAMERA, 16, 16), np.zeros((1, 2), int))).kernel
    name, unused = layouts.SINKS["HITS"]
    known = layouts.KERNELS[name].keys() - set(unused)
    with pytest.raises(TypeError, match="depth"):
        kernel(1, **dict.fromkeys(known - {"depth"}))
    with pytest.raises(TypeError, match="frames"):
        kernel(1, **dict.fromkeys([*known, "frames"]))


def test_no_elements_are_no_chunks():
    assert [len(part) for part in ranks(np.zeros(0, np.int64))] == [0, 0]
    for frames in (None, np.zeros(0, np.int64)):
        assert chunk_cuts(np.zeros((0, 2), np.int64), frames, 4, 2).tolist() == [0]


def test_pictures_larger_than_the_memory_are_refused_by_a_parameter_of_render():
    refused("^pixels: sums of .* Ask for fewer", lfcore.render, painted_soup(), 2.0, pixels=30000)

"""Planes formed of macropixels, table by table, are every ray's light thrown to its pixel."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from plain_scenes import refused
from scattered_planes import form_plane, scattered_sums
from stored_fields import write_field

from lfcore import Camera, Lattice, SensorPlane, Slab, open_device, render
from lfcore.colour import srgb_decode
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.lightfield import LightField
from lfcore.opencl.device import cl
from lfcore.optics import bundles
from lfcore.optics.plane_sums import FIXED_ONE
from lfcore.refocus.plane_former import PlaneFormer
from lfcore.refocus.shift_sum import shift_sum
from lfcore.refocus.slicing import form_planes
from lfcore.refocus.stored_views import FrameUnpacker, frame_chunks
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.prepared import open_tracer
from lfcore.rendering.record import record_slab
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding, frame_layout
from lfcore.storage.frame_memory import tile_ends
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile

pytestmark = pytest.mark.kernels

CAMERA = Camera(0.05, 0.004, 2.0, 3.0)
PLANES = [
    SensorPlane(1.1, 2.0, "square"),
    SensorPlane(3.0, 2.9),
    SensorPlane(9.7, 2.0, "square"),
    SensorPlane(0.6, 2.9, normalise="lens"),
    SensorPlane(0.9, 2.3, "polygon", keep_magnification=True),
    SensorPlane(2.0, 1e5),
]
COARSE = [
    SensorPlane(1.1, 2.0, "square", pixels=5),
    SensorPlane(9.7, 2.0, pixels=4),
    SensorPlane(0.9, 2.3, "polygon", keep_magnification=True, pixels=3),
]


class Light:
    """Takes the fixed-point light of all rays of a tile: (rows, columns, N, N, 3) uint64."""

    def __init__(self, tile, device):
        self.device, size = device, tile.layout.views
        self.open_samples = np.argwhere(np.ones((size, size), bool))[:, ::-1].astype(np.int32)
        self.rays = np.zeros((tile.rows, tile.columns, size, size, 3), np.uint64)

    def group_size(self, width, height):
        return 256

    def add_fixed(self, views, samples, region):
        light = np.empty((len(samples), 3, region[3], region[2]), np.uint32)
        cl.enqueue_copy(self.device.queue, light, views)
        self.rays[:, :, samples[:, 1], samples[:, 0]] = light.transpose(2, 3, 0, 1)


def light_of(frames, tile, device):
    light = Light(tile, device)
    FrameUnpacker(light, tile.layout).add(frames, tile, 0)
    return light.rays


def smooth_frames(tile, seed):
    """Frames (F, frame_bytes) uint8 of random samples in which many rows are like the one above,
    whole or in part, as they are in decoded video."""
    layout, rng = tile.layout, np.random.default_rng(seed)
    form, size = layout.format, (layout.frame_width, layout.frame_height)
    frames = np.zeros((tile.frame_count, form.frame_bytes(*size)), np.uint8)
    for plane in form.views(frames, *size):
        plane[:] = rng.integers(0, 1 << form.bits, plane.shape)
        for y in range(1, plane.shape[1]):
            start, stop = np.sort(rng.integers(0, plane.shape[2] + 1, 2))
            plane[:, y, start:stop] = plane[:, y - 1, start:stop]
    return frames


@pytest.mark.parametrize("lanes", [1, 16])
@pytest.mark.parametrize(
    ("form", "views", "pixels", "pack"),
    [("yuv444p", 71, 12, 1), ("yuv420p", 36, (12, 8), 2), ("gbrp", 40, 12, 1),
     ("yuv420p10le", 64, 12, 1), ("yuv444p", 5, 12, 2), ("yuv444p", 5, (12, 5), 2)],
)  # fmt: skip
def test_sums_are_those_of_every_ray(form, views, pixels, pack, lanes):
    slab, device = Slab.of(CAMERA, views, pixels), open_device(lanes=lanes, threads=2)
    layout = frame_layout(views, pixels, form, kind="macropixels", pack=pack)
    tile = layout.tile(6, 0, 6, 4)
    frames = smooth_frames(tile, views)
    planes = [*PLANES, *COARSE]
    former, half = PlaneFormer(slab, tile, planes, device), len(frames) // 2
    former.add(frames[:half], 0)
    former.add(frames[half:], half)
    got, rays = former.plane_sums(), light_of(frames, tile, open_device())
    (height, width), corner = got.sums.shape[2:], tile_ends(tile, slab)
    for plane, found in zip(planes, got.sums, strict=True):
        whole, own = np.zeros((3, 12, 12), np.uint64), slab.picture(plane.side(slab))
        whole[:, got.top : got.top + height, got.left : got.left + width] = found
        shown = whole[:, own[1] : own[1] + own[3], own[0] : own[0] + own[2]]
        np.testing.assert_array_equal(shown, scattered_sums(slab, plane, rays, corner))


def test_rows_of_lanes_begin_at_any_pixel_of_frames_with_less_chroma():
    slab, layout = Slab.of(CAMERA, 4, (6, 12)), FrameLayout("views", 4, 12, pixel_format="yuv420p")
    assert layout.corner(slab)[0] % 2
    tile, sums = layout.tile(0, 0, 4, 4), []
    frames = smooth_frames(tile, 1)
    for lanes in (1, 16):
        former = PlaneFormer(slab, tile, PLANES, open_device(lanes=lanes, threads=1))
        former.add(frames, 0)
        sums.append(former.plane_sums().sums)
    np.testing.assert_array_equal(*sums)


def test_light_is_that_of_the_standard():
    """sRGB codes decode to within three units of fixed point; white is one."""
    layout = FrameLayout("macropixels", 16, 1, pixel_format="gbrp")
    frame = np.tile(np.arange(256, dtype=np.uint8), 3)[None]
    light = light_of(frame, layout.tile(0, 0, 1, 1), open_device())[0, 0].reshape(256, 3)
    exact = srgb_decode(np.arange(256) / 255)[:, None] * FIXED_ONE
    assert np.abs(light - exact).max() < 3.5
    assert (light[255] == FIXED_ONE).all()


@pytest.mark.parametrize("form", ["yuv444p", "yuv420p"])
def test_colours_beyond_the_gamut_are_cut_off(form):
    layout = FrameLayout("macropixels", 16, 1, pixel_format=form)
    tile = layout.tile(0, 0, 1, 1)
    for code, light in ((0, 0), (255, FIXED_ONE)):
        frames = np.full((1, layout.frame_bytes), 128, np.uint8)
        frames[:, :256] = code
        assert (light_of(frames, tile, open_device()) == light).all()


def test_planes_out_of_a_file_of_512_views_are_those_of_its_rays(tmp_path):
    """Default encoder, container, decoder, and tables of 512 x 512 samples."""
    slab, spec = Slab(CAMERA, 512, 3), chosen_encoding(512)
    layout = FrameLayout("macropixels", 512, 3, pixel_format=spec.pixel_format)
    tile, path = layout.tile(0, 0, 3, 3), tmp_path / "l.mkv"
    write_field(path, slab, layout, partial(smooth_frames, seed=3), spec=spec, tiles=[tile])
    decoded = np.concatenate(list(LightFieldFile.open(path).video.frames(0)))
    rays = light_of(decoded, tile, open_device())
    for plane, found in zip(
        PLANES, form_planes(LightField.open(path), PLANES).sums.sums, strict=True
    ):
        np.testing.assert_array_equal(found, scattered_sums(slab, plane, rays))


def test_a_tile_stays_while_the_next_is_read(tmp_path):
    layout, path = FrameLayout("macropixels", 16, 10, pixel_format="gbrp"), tmp_path / "l.mkv"
    frames = {tile: smooth_frames(tile, tile.index) for tile in layout.tiles(3 * 10 * 16**2)}
    write_field(path, Slab(CAMERA, 16, 10), layout, frames.__getitem__, tiles=list(frames))
    with LightFieldFile.open(path) as field:
        chunks = frame_chunks(field.video, field.segments)
        tile, _, before = next(chunks)
        for following, _, found in chunks:
            np.testing.assert_array_equal(before, frames[tile])
            tile, before = following, found
    assert tile.index == len(frames) - 1 > 1


TRIANGLES = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]
VIEWS, PIXELS = 6, 24
KINDS = ("macropixels", "views")


@pytest.fixture(scope="module")
def tracer():
    white = np.ones((2, 3, 3), np.float32)
    scene = bare_scene(TRIANGLES, colours=white, ambient=(0.5, 0.4, 0.3))
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
    slab = Slab(tracer.scene.camera, VIEWS, PIXELS)
    asked, plain = (planes_of(tracer, side) for side in (PIXELS, None))
    made = (trace_planes(tracer, slab, planes) for planes in (asked, plain))
    np.testing.assert_array_equal(*made)


def test_macropixels_and_views_give_the_same_integers(tracer, tmp_path):
    """Lossless files of the same codes, whose sums are compared bit by bit."""
    slab, spec = Slab(tracer.scene.camera, VIEWS, PIXELS), chosen_encoding(VIEWS, Encoding("ffv1"))
    planes, sums = planes_of(tracer, 7), []
    for kind in KINDS:
        file = tmp_path / f"{kind}.mkv"
        layout = FrameLayout(kind, VIEWS, PIXELS, pixel_format=spec.pixel_format)
        record_slab(file, [tracer], slab, layout, spec)
        sums.append(form_planes(LightField.open(file), planes).sums)
    np.testing.assert_array_equal(sums[0].sums[:, :, :7, :7], sums[1].sums[:, :, :7, :7])
    traced = trace_planes(tracer, slab, planes)
    assert np.abs(sums[0].pictures() - traced).max() < 0.01, "8 bits a ray"
    with LightField.open(tmp_path / "views.mkv") as field:
        plane = replace(planes[0], pixels=None)
        (picture,) = field.refocus_many([plane], pixels=7)
        np.testing.assert_array_equal(picture, sums[0].pictures()[0])
        refused("pixels: only slicing", field.refocus_many, [plane], pixels=7, method="shift-sum")
        refused("finer than the slab's 24", field.refocus_many, [plane], pixels=25)
        refused("only slicing", shift_sum, field, planes)


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
    refused("6 and 8 pixels cannot be formed together", trace_planes, tracer, slab, planes)

"""Tracing camera arrays: against analytic scenes, the tracer's own visibility, and pbrt files."""

import numpy as np
import pytest

from lfcore import CameraArray, Device, OpticsError, open_device
from lfcore.rendering.array import array_bundles, stratified_offsets, trace_array
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.tracing import arrays

pytestmark = pytest.mark.kernels

# A wall, red above and green below, and a blue sphere before it; ambient light alone.
SCENE = """
Camera "lightfield" "float fov" 60 "integer camerasperdim" [3 2]
    "float cameragridbounds [-0.3 0.3 -0.2 0.2]
Film "image" "integer xresolution" [120] "integer yresolution" [80]
WorldBegin
LightSource "infinite" "rgb L" [2 2 2]
Material "matte" "rgb Kd" [.8 0 0]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
    "point P" [-9 0.1 4  9 0.1 4  9 9 4  -9 9 4]
Material "matte" "rgb Kd" [0 .6 0]
Shape "trianglemesh" "integer indices" [0 1 2 0 2 3]
    "point P" [-9 -9 4  9 -9 4  9 0.1 4  -9 0.1 4]
Material "matte" "rgb Kd" [0 0 .4]
Translate .7 .5 3
Shape "sphere" "float radius" .3
WorldEnd
"""


@pytest.fixture(scope="module")
def traced(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "s.pbrt"
    path.write_text(SCENE)
    scene = build_pbrt_scene(path)
    return scene, open_tracer(scene)


def test_every_tile_is_what_its_camera_sees(traced):
    """Colours from exact geometry: sphere, then the two halves; radiance above one survives."""
    scene, tracer = traced
    array = scene.view.array
    tiles = array.tiles(trace_array(tracer, array))
    wrong = 0
    for j in range(2):
        for i in range(3):
            o, d = array.origins()[j, i], array.directions(i, j)
            to_centre = np.array([0.7, -0.5, 3.0]) - o
            along = (d * to_centre).sum(-1) / (d * d).sum(-1)
            miss = np.linalg.norm(along[..., None] * d - to_centre, axis=-1)
            above = o[1] + 4 * d[..., 1] < -0.1
            expected = np.where(above[..., None], [1.6, 0, 0], [0, 1.2, 0])
            expected = np.where(miss[..., None] < 0.3, [0, 0, 0.8], expected)
            wrong += (np.abs(tiles[j, i] - expected) > 1e-3).any(-1).sum()
    # The tessellated sphere differs from the exact one on its outline, in a few pixels.
    assert wrong <= 12
    assert tiles[0, 0, 0].max() == pytest.approx(1.6, rel=1e-4)


def test_samples_average_over_the_pixel(traced):
    """More samples approach the pixel's mean along the edge, where one sample is red or green."""
    tracer = traced[1]
    array = CameraArray.single(60.0, (24, 24))
    fine = trace_array(tracer, CameraArray.single(60.0, (384, 384)))
    mean = fine.reshape(24, 16, 24, 16, 3).mean((1, 3))
    errors = [
        np.sqrt(np.mean((trace_array(tracer, array, count, seed=3) - mean) ** 2))
        for count in (1, 4, 16, 64)
    ]
    assert errors[3] < errors[2] < errors[1] < errors[0]
    assert errors[3] < 0.2 * errors[0]
    again = trace_array(tracer, array, 16, seed=3)
    np.testing.assert_array_equal(again, trace_array(tracer, array, 16, seed=3))


@pytest.mark.parametrize(
    "tile, samples, lanes",
    [((64, 48), 1, 16), ((64, 33), 3, 16), ((41, 30), 2, 16), ((16, 16), 1, 16), ((7, 9), 2, 16),
     ((64, 33), 3, 4), ((7, 9), 2, 4)],
)  # fmt: skip
def test_the_image_is_what_cameras_one_by_one_give(traced, monkeypatch, tile, samples, lanes):
    """Written in place, past the caches or not, to a page's beginning or not: the same bits."""
    device = open_device(lanes=lanes)
    tracer = open_tracer(traced[0], device)
    array = CameraArray.on_grid((5, 3), (-0.3, 0.3, -0.2, 0.2), 60.0, tile)
    offsets = stratified_offsets(15, samples, 0)
    grid = np.stack(np.meshgrid(np.arange(5), np.arange(3)), -1).reshape(-1, 2)
    total = np.zeros((15, tile[1], tile[0], 3), np.float32)
    for offset in offsets:
        total += tracer.bundle_radiance(array_bundles(array, offset, samples), grid)
    expected = array.mosaic((total / np.float32(samples)).reshape(3, 5, tile[1], tile[0], 3))
    np.testing.assert_array_equal(trace_array(tracer, array, samples), expected)
    monkeypatch.setattr(arrays, "STREAM_BYTES", 0)
    monkeypatch.setattr(arrays, "LAUNCH_RAYS", 2000)
    parts = trace_array(tracer, array, samples, progress=lambda *done: None)
    np.testing.assert_array_equal(parts, expected)
    memory = np.full(expected.size + 1, np.nan, np.float32)
    out = memory[1:].reshape(expected.shape)
    assert trace_array(tracer, array, samples, out=out) is out
    np.testing.assert_array_equal(out, expected)
    assert np.isnan(memory[0])
    # As on a device with memory of its own: rows of tiles at a time, copied back.
    monkeypatch.setattr(Device, "is_cpu", False)
    monkeypatch.setattr(arrays, "CHUNK_RAYS", 1)
    np.testing.assert_array_equal(trace_array(tracer, array, samples), expected)


def test_memory_that_cannot_hold_the_image(traced):
    array = traced[0].view.array
    right = np.zeros((80, 120, 3), np.float32)
    assert trace_array(traced[1], array, out=right).any()
    for wrong in (right[:-1], right.astype(float), np.zeros((80, 240, 3), np.float32)[:, ::2]):
        with pytest.raises(OpticsError, match="out"):
            trace_array(traced[1], array, out=wrong)
    with pytest.raises(OpticsError, match="contiguous"):
        traced[1].bundle_radiance(
            array_bundles(array), out=np.zeros((6, 40, 80, 3), np.float32)[:, :, ::2]
        )


def test_offsets_hold_one_sample_in_each_stratum():
    offsets = stratified_offsets(50, 16, 7) + 0.5
    cells = np.floor(offsets * 4).astype(int)
    assert (np.sort(cells[..., 1] * 4 + cells[..., 0], 0) == np.arange(16)[:, None]).all()
    assert not stratified_offsets(3, 1, 0).any()

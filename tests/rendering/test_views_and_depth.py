"""Views read in bulk; depth, disparity and all-in-focus pictures of scenes of known answers."""

import json

import numpy as np
import pytest
from plain_scenes import CHART, refused, wall
from plain_scenes import scene as plain_scene

from lfcore import Camera, Material, Slab, write_picture
from lfcore.cli import main
from lfcore.rendering import depth as depths
from lfcore.rendering.prepared import open_tracer
from lfcore.storage.lightfield import LightFieldFile

CAMERA = Camera(0.05, 0.036, 1.0, 2.0)
NEAR, FAR = 1.0, 4.0


@pytest.fixture(scope="module")
def tracer():
    """A red wall at 1 m on the left, a green one at 4 m behind both halves, lit by ambient."""
    triangles = np.concatenate([wall(NEAR) - np.float32([10, 0, 0]), wall(FAR)])
    scene = plain_scene(
        triangles, camera=CAMERA, ambient=(1.0, 1.0, 1.0), material_ids=np.int32([0, 0, 1, 1]),
        materials=[Material("red", (1.0, 0, 0)), Material("green", (0, 1.0, 0))],
    )  # fmt: skip
    return open_tracer(scene)


@pytest.mark.parametrize("size", [(16, 16), (16, 9), (7, 16)])
def test_depth_of_every_view_by_hand(tracer, size):
    slab, (width, height) = Slab.of(CAMERA, 4, size), size
    depth, left = depths.depth_of_views(tracer, slab), slab.held.pixels[0]
    assert depth.shape == (16, height, width)
    assert depth.dtype == np.float32
    for (i, _), picture in zip(depths.all_samples(slab), depth, strict=True):
        # The near wall ends at x = 0: rays with x(NEAR) < 0 meet it.
        s = slab.lens_positions()[i]
        x = s * (1 - NEAR * slab.camera.delta) + NEAR * slab.pixel_tangents()[left : left + width]
        row = np.where(x < 0, NEAR, FAR)
        np.testing.assert_allclose(picture, np.broadcast_to(row, (height, width)), rtol=1e-6)


def test_disparity_is_how_points_move(tracer):
    """The edge of the near wall moves by its disparity from one view to the next."""
    slab = Slab(CAMERA, 4, 400)
    depth = depths.depth_of_views(tracer, slab, [(i, 0) for i in range(4)])
    edges = (depth[:, 0] < 2).sum(axis=1)
    step = depths.disparity(slab, np.array([NEAR]))[0]
    np.testing.assert_allclose(np.diff(edges), -step, atol=1.0)


@pytest.mark.parametrize("size", [40, (40, 24)])
def test_all_in_focus_has_both_walls_sharp(tracer, size):
    slab = Slab.of(CAMERA, 5, size)
    samples = depths.all_samples(slab)
    depth = depths.depth_of_views(tracer, slab)
    light = np.zeros((*depth.shape, 3), np.float32)
    light[..., 0], light[..., 1] = depth < 2, depth > 2
    centre = depths.depth_of_views(tracer, Slab.of(CAMERA, 1, size))[0]
    picture = depths.all_in_focus(slab, centre, [(samples, light, depth)])
    np.testing.assert_array_equal(picture[..., 0], centre < 2)
    np.testing.assert_array_equal(picture[..., 1], centre > 2)


def test_float_maps_and_archives(tmp_path):
    refused("no picture", write_picture, tmp_path / "b.pfm", np.zeros(3, np.float32))
    slab = Slab(CAMERA, 1, 2)
    depths.save_depth(tmp_path / "d.npz", slab, [(0, 0)], np.full((1, 2, 2), 2.0, np.float32))
    with np.load(tmp_path / "d.npz") as archive:
        assert (archive["disparity_px"] == 0).all()
        assert Slab.from_json(json.loads(archive["slab"].tobytes())) == slab
    assert sorted(p.name for p in tmp_path.iterdir()) == ["d.npz"]


def test_samples_outside_the_lens_are_refused(tracer):
    refused("from 0 to 3", depths.depth_of_views, tracer, Slab(CAMERA, 4, 8), [(4, 0)])


@pytest.mark.kernels
@pytest.mark.parametrize("kind", ["views", "macropixels"])
def test_views_read_in_bulk_are_those_read_alone(tmp_path, kind):
    from lfcore.refocus.stored_views import read_views

    path, out = tmp_path / "chart.mkv", tmp_path / "depth.npz"
    codec = ["--depth", "none", "--codec", f"ffv1,layout={kind}"]
    options = ["--pixels", "20x12", "--views", "3", *codec]
    assert main(["record", str(CHART), "-o", str(path), *options]) == 0
    field = LightFieldFile.open(path)
    samples = [(2, 1), (0, 0)]
    light = read_views(field, samples)
    for (i, j), picture in zip(samples, light, strict=True):
        np.testing.assert_allclose(picture, field.view(i, j), atol=0.006)
    refused("twice", read_views, field, [(0, 0), (0, 0)])
    sharp = tmp_path / "sharp.npy"
    command = ["depth", str(CHART), "--lightfield", str(path)]
    assert main([*command, "-o", str(out), "--all-in-focus", str(sharp)]) == 0
    with np.load(out) as archive:
        assert archive["depth_m"].shape == (9, 12, 20)
        assert set(np.unique(archive["depth_m"].round(3))) <= {1.0, 2.0, np.inf}
    assert np.abs(np.load(sharp) - read_views(field, [(1, 1)])[0]).mean() < 0.05

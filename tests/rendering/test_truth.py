"""Truth beside pictures: flow reprojects, occlusion is that of rays, normals and blur are known."""

from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
from mirror_room import mirror_room
from moving_scene import moving_squares
from plain_scenes import refused

import lfcore
from lfcore.cli import main
from lfcore.optics import bundles
from lfcore.optics.slab import Slab
from lfcore.rendering import truth
from lfcore.rendering.depth import depth_of_views
from lfcore.rendering.prepared import open_dark_tracer, open_tracer, tracers_at

CAMERA = lfcore.Camera(0.05, 0.036, 1.0, 3.0)
PIXELS = (60, 48)


@pytest.fixture(scope="module")
def scene():
    """A tilted square before a wall; beside the wall nothing."""
    near = np.array([[-0.3, -0.3, 1.5], [0.3, -0.3, 1.5], [0.3, 0.3, 2.0], [-0.3, 0.3, 2.0]])
    wall = np.array([[-3, -3, 4], [0.7, -3, 4], [0.7, 3, 4], [-3, 3, 4]])
    corners = np.concatenate([square[[[0, 1, 2], [0, 2, 3]]] for square in (near, wall)])
    made = lfcore.Scene.from_triangles(corners, camera=CAMERA)
    material, ids = made.materials[0], np.array([0, 0, 1, 1], np.int32)
    blue, grey = (replace(material, diffuse=c) for c in ((0.2, 0.4, 0.6), (0.5, 0.5, 0.5)))
    return replace(made, materials=[blue, grey], material_ids=ids)


def project(points, lens, slab):
    """Pixels of points (R, 3) through a lens point, by the pinhole's geometry alone."""
    tangent = (points[:, :2] - lens) / points[:, 2:] + lens / slab.camera.focus_m
    size = np.array(slab.size)
    return tangent / slab.pixel_pitch + size / 2


@pytest.mark.parametrize(("sample", "to"), [((0, 1), (1, 1)), ((2, 0), (0, 2)), ((1, 1), (1, 1))])
def test_flow_leads_to_the_pixel_of_the_same_point(scene, sample, to):
    known = lfcore.truth(scene, 3, PIXELS, sample=sample, flow_to=to)
    slab = lfcore.Slab.of(CAMERA, 3, PIXELS)
    origins, directions = (a.reshape(-1, 3) for a in bundles.views(slab, np.array([sample])).rays())
    hit = np.isfinite(known["depth_m"]).ravel()
    points = (origins + known["depth_m"].reshape(-1, 1) * directions)[hit].astype(np.float64)
    lens = slab.lens_positions()
    rows, columns = np.mgrid[: PIXELS[1], : PIXELS[0]] + 0.5
    here = np.stack([columns, rows], -1).reshape(-1, 2)[hit]
    assert np.abs(project(points, lens[list(sample)], slab) - here).max() < 0.01
    there = project(points, lens[list(to)], slab)
    assert np.abs(here + known["flow_px"].reshape(-1, 2)[hit] - there).max() < 0.01
    # A ray of the other view to that place meets the point, or what hides it.
    eye = np.append(lens[list(to)], 0.0)
    tracer = open_dark_tracer(scene)
    found = tracer.closest_hit(
        np.broadcast_to(eye, points.shape).astype(np.float32), (points - eye).astype(np.float32)
    )
    hidden = known["occluded"].ravel()[hit]
    assert np.array_equal(hidden, found.distance < 0.99)
    assert hidden.any() == (sample != to)


def test_surfaces_are_those_of_the_scene(scene):
    plane = lfcore.SensorPlane(1.5, 2.0)
    known = lfcore.truth(scene, pixels=PIXELS, planes=[plane])
    centre, left, right = (24, 30), (24, 2), (24, 58)
    assert known["material"][centre] == 0 and known["material"][left] == 1
    assert known["albedo"][centre] == pytest.approx((0.2, 0.4, 0.6), rel=1e-5)
    normal = np.array([0, 0.5, -0.6]) / np.hypot(0.5, 0.6)
    assert known["normal"][centre] == pytest.approx(normal, abs=1e-5)
    assert known["normal"][left] == pytest.approx((0, 0, -1), abs=1e-6)
    assert known["triangle"][right] == known["material"][right] == -1
    assert np.isinf(known["depth_m"][right]) and not known["normal"][right].any()
    width = 0.05 / 2 * (1 / 1.5 - 1 / 4) / (0.036 / 0.05 * (1 - 0.05 / 3) / 48)
    assert known["coc_px"][0][left] == pytest.approx(width, rel=0.02)
    assert np.sign(known["coc_px"][0][left]) == 1


def test_specular_pixels_have_the_depth_of_images(tmp_path):
    """A mirror and a coat at 4 m show the wall 4 m behind the camera, at 12 m; a matt wall."""
    room = mirror_room()
    known = lfcore.truth(room, pixels=32)
    depth, image, specular = (known[name] for name in ("depth_m", "virtual_depth_m", "specular"))
    np.testing.assert_array_equal(specular, known["material"] < 2)
    assert 0.2 < specular.mean() < 0.8
    np.testing.assert_allclose(depth[specular], 4, rtol=1e-5)
    np.testing.assert_allclose(image[specular], 12, rtol=1e-5)
    np.testing.assert_array_equal(image[~specular], depth[~specular])
    lfcore.write_truth(tmp_path / "a.exr", known)
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    np.testing.assert_array_equal(channels["specular"].pixels, specular)
    np.testing.assert_array_equal(channels["virtual_depth_m"].pixels, image)
    matt = lfcore.truth(replace(room, materials=[lfcore.Material("matt")] * 3), pixels=32)
    assert not matt["specular"].any()
    np.testing.assert_array_equal(matt["virtual_depth_m"], matt["depth_m"])


def test_truth_is_written_with_named_channels(scene, tmp_path):
    known = lfcore.truth(scene, 3, PIXELS, sample=(0, 0), planes=[lfcore.SensorPlane(2.0, 2.0)] * 2)
    for name in ("a.exr", "a.npz"):
        lfcore.write_truth(tmp_path / name, known)
    with np.load(tmp_path / "a.npz") as arrays:
        assert all(np.array_equal(arrays[name], known[name]) for name in known)
    channels = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True).channels()
    assert np.array_equal(channels["normal.Z"].pixels, known["normal"][..., 2])
    assert np.array_equal(channels["flow_px.V"].pixels, known["flow_px"][..., 1])
    assert np.array_equal(channels["coc_px.01"].pixels, known["coc_px"][1])
    material = channels["material"].pixels
    assert material.dtype == np.uint32 and np.array_equal(material, known["material"] + 1)
    refused("unknown format '.png'", lfcore.write_truth, tmp_path / "a.png", known)
    refused("samples", lfcore.truth, scene, 3, PIXELS, sample=(3, 0))


def test_the_command_writes_truth(tmp_path, capsys):
    words = ["depth", "example", "--pixels", "24", "--views", "3", "--view", "0", "1"]
    assert main([*words, "--truth", str(tmp_path / "a.npz")]) == 0
    with np.load(tmp_path / "a.npz") as known:
        assert known["normal"].shape == (24, 24, 3) and known["occluded"].any()
    capsys.readouterr()
    assert main([*words, "--truth", str(tmp_path / "a.png")]) == 1
    assert main(["depth", "--lightfield", "a.mkv", "--truth", str(tmp_path / "a.npz")]) == 1
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and "--truth" in said[0] and "needs a scene" in said[1]


def test_flow_between_instants_is_that_of_a_rigid_translation(device):
    scene = moving_squares()
    slab = Slab.of(scene.camera, 3, (32, 24))
    now, later = tracers_at(scene, [0.0, 0.2], device)
    for sample in ((1, 1), (0, 2)):
        known = truth.flow_between(now, later, slab, sample)
        depth = depth_of_views(now, slab, np.array([sample]))[0]
        near = depth < 3
        assert 20 < near.sum() < 400
        flow, moved = known["flow_px"], known["scene_flow_m"]
        expected = 0.2 / 2 / slab.pixel_pitch
        assert np.abs(flow[near] - (expected, 0)).max() < 1e-3 < 1 < expected
        assert np.allclose(moved[near], (0.2, 0, 0), atol=1e-6)
        assert not flow[~near].any() and not moved[~near].any()
        # Hidden then: the wall just right of the square, where it comes.
        after = depth_of_views(later, slab, np.array([sample]))[0]
        assert np.array_equal(known["occluded"], ~near & (after < 3))
        # A pixel and its flow lead to the point in the later picture.
        rows, columns = np.nonzero(near)
        found = (columns + flow[near][:, 0]).round().astype(int)
        assert (after[rows, np.minimum(found, 31)] < 3)[found < 31].mean() > 0.95


def test_points_that_pass_the_lens_are_occluded(device):
    scene = moving_squares()
    tracer = open_tracer(scene.at(0), device)
    behind = replace(scene.at(0), triangles=scene.triangles - np.float32([0, 0, 3]))
    slab = Slab.of(scene.camera, 1, 16)
    known = truth.flow_between(tracer, open_tracer(behind, device), slab, (0, 0))
    near = known["flow_px"][..., 0] == np.inf
    assert near.any() and known["occluded"][near].all()

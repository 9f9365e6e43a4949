"""Rooms: nothing intersects, things stand, the camera is free, the exposure is a camera's."""

import dataclasses
import functools

import numpy as np
import pytest

import lfcore
from lfcore.datasets.description import Description
from lfcore.datasets.draws import Draw
from lfcore.datasets.metering import MIDDLE, WHITE, brighter, metered
from lfcore.datasets.room_views import camera_of
from lfcore.datasets.rooms import SMALL, Room
from lfcore.datasets.sample import sample
from lfcore.datasets.views import view
from lfcore.optics.slab import Slab
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.baked import BakeOptions
from lfcore.scene.files import scene_digest
from lfcore.scene.sky_gloss import sky_gloss
from tests.datasets.test_dataset_scenes import PLAIN

pytestmark = pytest.mark.slow


@functools.cache
def room(index):
    """The room before it is a scene, and its camera."""
    of = Description.check(PLAIN | {"placement": {"share_rooms": 1}})
    seeds = np.random.SeedSequence(of.seed, spawn_key=(1 << 30, index))
    made = Room(Draw(of, np.random.Generator(np.random.Philox(seeds))))
    made.add_shell()
    made.furnish()
    return made, camera_of(made, (1.33, 1))


@pytest.mark.parametrize("index", range(4))
def test_furniture_of_a_room_is_apart_within_the_walls_and_the_camera_is_free(index):
    made, to_camera = room(index)
    eye = np.linalg.inv(to_camera)[:3, 3]
    half = np.array([made.width / 2, made.height, made.depth / 2])
    assert (np.abs(eye) < half).all() and len(made.names) >= 8
    points = {}
    for owner, part in zip(made.owners, made.parts, strict=True):
        points.setdefault(owner, []).append(part.triangles.reshape(-1, 3))
    # Things on the floor or on furniture: above the floor, in the room, and not on the camera.
    for owner, pieces in points.items():
        if owner and made.names[owner - 1] not in ("print", "mirror"):
            corners = np.concatenate(pieces)
            low, high = corners.min(0), corners.max(0)
            assert low[1] > -0.01 and high[1] < made.height
            assert (np.abs(corners[:, [0, 2]]) < half[[0, 2]] + 1e-3).all(), made.names[owner - 1]
            assert ((eye < low - 0.05) | (eye > high + 0.05)).any() or len(corners) > 1e4
    for number, box in enumerate(made.boxes):
        assert not any(box.meets(other, 0.0) for other in made.boxes[:number])
    # Each thing on furniture touches its top and no other thing.
    for pose, (x0, x1, z0, z1, y) in made.tops:
        on_top = [
            (np.concatenate(pieces) - pose[:3, 3]) @ pose[:3, :3]
            for owner, pieces in points.items()
            if owner and made.names[owner - 1] in SMALL
        ]
        on_top = [p for p in on_top if abs(p[:, 1].min() - y) < 2e-3 and x0 < p[:, 0].mean() < x1
                  and z0 < p[:, 2].mean() < z1]  # fmt: skip
        for number, one in enumerate(on_top):
            assert one[:, 0].min() > x0 - 1e-3 and one[:, 0].max() < x1 + 1e-3
            for other in on_top[:number]:
                apart = (one.min(0) > other.max(0)) | (one.max(0) < other.min(0))
                centres = np.linalg.norm(one.mean(0) - other.mean(0))
                assert apart[[0, 2]].any() or centres > 0.08


def test_a_room_is_a_scene_with_sky_lamps_and_an_owner_per_triangle():
    of = PLAIN | {"placement": {"share_rooms": 1}}
    scene, names, _, owners, *_ = sample(of, 1)
    assert scene.bake is not None and scene.sky.size and scene.lights
    red, green, blue = scene.sky.reshape(-1, 3).T
    assert (green > 0.97 * np.minimum(red, blue)).all()  # not lilac
    assert owners.shape == scene.material_ids.shape and owners.max() == len(names)
    kinds = np.array([m.name for m in scene.materials])[scene.material_ids]
    assert {"wall", "floor", "ceiling", "ground"} <= set(kinds[owners == 0])
    assert scene_digest(sample(of, 1).scene) == scene_digest(scene)


def test_walls_floors_and_prints_have_the_users_textures(tmp_path):
    lfcore.write_picture(tmp_path / "mine.png", np.full((8, 8, 3), 200, np.uint8))
    materials, used = {"textures": str(tmp_path), "share_textured": 1}, set()
    for index in range(3):
        scene = sample(
            PLAIN | {"placement": {"share_rooms": 1}, "materials": materials}, index
        ).scene
        mine = {k for k, texture in enumerate(scene.textures) if texture.shape[:2] == (8, 8)}
        used |= {material.name for material in scene.materials if material.texture in mine}
    assert {"wall", "floor", "print"} <= used


@pytest.mark.kernels
def test_rooms_are_exposed_as_by_a_camera(device):
    of = PLAIN | {"placement": {"share_rooms": 1}}
    cheap = BakeOptions(bounces=1, error=0.8, cells=4)
    drawn = dataclasses.replace(sample(of, 0).scene, bake=cheap)
    scene, stops = metered(drawn, device)
    slab, grid = Slab.of(scene.camera, 1, 48), (2, 1)
    after = view(open_tracer(scene, device), slab, 0, grid)
    luminance = after @ (0.2126, 0.7152, 0.0722)
    median, white = np.median(luminance), (luminance > 1).mean()
    # Whole stops: within half a stop of the metered share or of mid-grey.
    assert MIDDLE / 1.6 < median < MIDDLE * 1.6 or abs(white - WHITE) < 0.15
    # The sky's maps are those of the brighter sky, and rays have the same colours.
    doubled = open_tracer(brighter(scene, 1), device)
    assert np.allclose(view(doubled, slab, 0, grid), 2 * after, rtol=1e-5, atol=1e-6)
    assert np.array_equal(sky_gloss(doubled.scene.sky), sky_gloss(doubled.scene.sky.copy()))
    assert brighter(drawn, 0) is drawn and isinstance(stops, int)


@pytest.mark.kernels
@pytest.mark.parametrize("index", range(3))
def test_views_of_rooms_are_neither_empty_nor_full_of_one_near_thing(device, index):
    drawn = sample(PLAIN | {"placement": {"share_rooms": 1}, "seed": 4}, index)
    known = lfcore.truth(drawn.scene, pixels=64, device=device)
    depth, owners = known["depth_m"], drawn.owners[known["triangle"]]
    shares = np.bincount(owners.ravel(), minlength=len(drawn.objects) + 1) / owners.size
    assert np.quantile(depth, 0.01) > 0.4
    assert shares[1:].max() < 0.65 and (shares[1:] > 0.005).sum() >= 3
    assert ((owners == 0) & (depth < 1)).mean() < 0.3

"""Data sets over time: instants, exact flow between them, and what moves."""

import io
import json

import cv2
import numpy as np
import OpenEXR
import pytest

import lfcore
from lfcore import SensorPlane, Slab, Stacks
from lfcore.colour import srgb_encode
from lfcore.datasets import batches, items, stored
from lfcore.datasets.description import Description
from lfcore.datasets.sample import sample
from lfcore.errors import SettingsError
from lfcore.rendering import record_film

SMALL = {
    "name": "small", "kind": "defocus_pairs", "pixels": 32, "quality_db": 25, "truth": True,
    "scenes": {"train": 2, "validation": 1},
    "placement": {"objects": 5, "size": [0.3, 0.6], "share_resting": 0, "least_seen": 0.01},
    "shapes": {"builders": ["ball", "ring", "book"]},
}  # fmt: skip
FRAMES = {"count": 3, "fps": 10, "share_moving": 0.6, "turn_deg": [20, 90]}


def channels(data):
    return {
        name: channel.pixels
        for name, channel in OpenEXR.File(io.BytesIO(data), separate_channels=True)
        .channels()
        .items()
    }


@pytest.mark.kernels
def test_flow_is_that_of_the_poses_in_the_record(device):
    of = Description.check(SMALL | {"frames": FRAMES})
    item = items.make_item(of, 0, device)
    record = json.loads(item.files["json"])
    assert record["times_s"] == [0.0, 0.1, 0.2] and "t002.next.exr" not in item.files
    drawn = sample(of, 0)
    poses = {each["object"]: np.array(each["poses"]) for each in record["motions"]}
    assert 0 < len(poses) < len(drawn.objects)
    slab = Slab.of(drawn.scene.camera, 1, of.size)
    tangents = np.stack(np.meshgrid(slab.pixel_tangents(), slab.pixel_tangents()), -1)
    moving = 0
    for instant in (0, 1):
        truth, flow = (channels(item.files[f"t00{instant}.{n}.exr"]) for n in ("truth", "next"))
        found = np.stack([flow["flow_px.U"], flow["flow_px.V"]], -1)
        shift = np.stack([flow[f"scene_flow_m.{axis}"] for axis in "XYZ"], -1)
        points = truth["depth_m"][..., None] * np.dstack([tangents, np.ones(tangents.shape[:2])])
        for number in np.unique(truth["object"]):
            at = truth["object"] == number
            if number - 1 not in poses:
                assert not found[at].any() and not shift[at].any()
                continue
            here, there = (poses[number - 1][k] for k in (instant, instant + 1))
            first = np.linalg.solve(here[:, :3], (points[at] - here[:, 3]).T).T
            later = first @ there[:, :3].T + there[:, 3]
            expected = (later[:, :2] / later[:, 2:] - tangents[at]) / slab.pixel_pitch
            assert np.abs(found[at] - expected).max() < 0.01
            assert np.abs(shift[at] - (later - points[at])).max() < 1e-4
            moving += np.abs(expected).max() > 0.2
    assert moving


@pytest.mark.kernels
@pytest.mark.parametrize("frames", [{"fps": 7}, {"count": 2, "share_moving": 1.0}])
def test_the_first_instant_is_the_item_at_rest(device, frames):
    still, item = (
        items.make_item(Description.check(SMALL | keys), 1, device)
        for keys in ({}, {"frames": frames})
    )
    first = stored.StoredItem(1, item.files).first().files
    names = set(still.files) - {"json"}
    assert names < set(first) and all(first[name] == still.files[name] for name in names)
    if "count" in frames:
        assert item.files["t001.sharp.png"] != item.files["t000.sharp.png"]
        assert set(first) - names == {"json", "next.exr"}


@pytest.mark.kernels
def test_arrays_of_light_fields_begin_with_time(device):
    keys = {
        "kind": "light_fields", "also": [], "quality_db": 20, "frames": FRAMES, "truth": False,
        "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 2},
        "placement": {"depth_m": [1.1, 2.8], "wall_m": 3, "objects": 4, "share_resting": 1},
    }  # fmt: skip
    item = Stacks(SMALL | keys)[0]
    assert item["input_Cam"].shape == (3, 4, 32, 32, 3) and item["times_s"].tolist() == [
        0,
        0.1,
        0.2,
    ]
    assert item["next_flow_px"].shape == (2, 4, 32, 32, 2) and item["next_flow_px"].any()


def test_resting_objects_stay_on_the_floor():
    of = Description.check(SMALL | {
        "placement": {"objects": 8, "share_resting": 1}, "frames": FRAMES | {"share_moving": 1.0}
    })  # fmt: skip
    drawn = sample(of, 2)
    assert len(drawn.moves) == len(drawn.objects) and drawn.scene.instants == (0, 0.2)
    floor = drawn.scene.triangles[(drawn.owners == 0) & (np.arange(len(drawn.owners)) >= 2)][0]
    up = np.cross(floor[1] - floor[0], floor[2] - floor[0])
    up /= np.linalg.norm(up)
    end = drawn.scene.at(5).triangles
    assert any(np.abs(move.velocity).max() > 0 for move in drawn.moves)
    for move in drawn.moves:
        before, after = (each[move.rows] @ up for each in (drawn.scene.triangles, end))
        assert np.allclose(before, after, atol=1e-5)


@pytest.mark.kernels
def test_an_open_shutter_blurs_pictures_and_no_truth(device):
    frames = {"fps": 2, "share_moving": 1.0, "speed": 0.3}
    still, blurred = (
        items.make_item(Description.check(SMALL | {"frames": frames | {"shutter": s}}), 0, device)
        for s in (0, 0.5)
    )
    assert still.files.keys() == blurred.files.keys()
    changed = {name for name in still.files if still.files[name] != blurred.files[name]}
    assert changed == {"defocused.png", "json"}
    of = Description.check(SMALL | {"frames": frames | {"shutter": 0.5}})
    scene, record = sample(of, 0).scene, json.loads(blurred.files["json"])
    assert record["shutter_s"] == [-0.125, 0.125] and scene.shutter == scene.instants
    shown = cv2.imdecode(np.frombuffer(blurred.files["defocused.png"], np.uint8), 1)[..., ::-1]
    plane = SensorPlane(record["focus_m"][0], scene.camera.f_number)
    light = [
        lfcore.render(scene.at((k + 0.5) / 16 / 4 - 0.125), planes=[plane], pixels=32)[0]
        for k in range(16)
    ]
    error = np.square(srgb_encode(np.mean(light, 0)) - shown / 255).mean()
    assert -10 * np.log10(error) > 25


@pytest.mark.kernels
def test_films_continue_after_a_kill_and_have_the_truth_of_each_instant(
    device, tmp_path, monkeypatch
):
    keys = {"kind": "films", "frames": FRAMES | {"count": 6}, "scenes": {"train": 1},
            "placement": SMALL["placement"] | {"objects": 2}}  # fmt: skip
    of, encoded, encode = Description.check(SMALL | keys), [], record_film.encode

    def stop(*arguments):
        encoded.append(arguments)
        if len(encoded) == 2:
            raise KeyboardInterrupt
        encode(*arguments)

    monkeypatch.setattr(record_film, "encode", stop)
    batch = of, [0], tmp_path / "0.tar", tmp_path / "0.json", tmp_path / "drafts", device
    with pytest.raises(KeyboardInterrupt):
        batches.make_batch(*batch)
    (facts,) = batches.make_batch(*batch)
    assert len(encoded) == 3 and not (tmp_path / "drafts").exists()
    stored.unpack(of, [tmp_path / "0.tar"], tmp_path)
    film = lfcore.LightField.open(tmp_path / "train/000000/film.mkv")
    assert film.times == of.frames.times and facts["expected_db"] >= 24
    truth = channels((tmp_path / "train/000000_t005/truth.exr").read_bytes())
    depth = np.median(film.at(5).depth()[0] / truth["depth_m"])
    assert abs(depth - 1) < 0.05 and (tmp_path / "train/000000_t004/next.exr").exists()


@pytest.mark.kernels
def test_instants_are_stored_as_items(device, tmp_path):
    keys = {"kind": "infinigen_defocus", "frames": FRAMES | {"count": 2}, "truth": False}
    lens = {"stops": [2.0], "focus_m": [0.3]}
    of = Description.check(SMALL | keys | {"lens": lens, "scenes": {"train": 0, "validation": 1}})
    batches.make_batch(of, [0], tmp_path / "0.tar", tmp_path / "0.json", tmp_path / "d", device)
    stored.unpack(of, [tmp_path / "0.tar"], tmp_path)
    rows = json.loads((tmp_path / "val.json").read_text())["files"]
    assert [row["id"] for row in rows] == ["000000_t000", "000000_t001"]
    files = [tmp_path / path[1:] for row in rows for name, path in row.items() if name != "id"]
    assert len(set(files)) == 8 and all(file.exists() for file in files)
    assert (tmp_path / "val/000000/item.json").exists()
    assert (tmp_path / "val/000000_t000/next.exr").exists()


def test_what_films_and_shutters_exclude():
    for keys, words in (
        ({"kind": "light_fields", "frames": {"shutter": 0.5}}, "frames.shutter: views are sharp"),
        ({"kind": "films", "sensor": {"iso": 100}}, "no sensor's noise"),
    ):  # fmt: skip
        with pytest.raises(SettingsError, match=words):
            Description.check(SMALL | keys)
    with pytest.raises(SettingsError, match="films are files"):
        Stacks(SMALL | {"kind": "films"})


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ({"count": 0}, "frames.count"), ({"count": 2, "fps": -24}, "frames.fps"),
        ({"count": 2, "share_moving": 0}, "nothing moves"),
        ({"shutter": 1.5}, "frames.shutter"), ({"rate": 2}, "frames.rate"),
    ],
)  # fmt: skip
def test_bad_frames(frames, words):
    with pytest.raises(SettingsError) as error:
        Description.check(SMALL | {"frames": frames})
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.kernels
def test_noise_is_new_at_each_instant(device):
    frames = {"count": 2, "share_moving": 1.0, "speed": 0, "turn_deg": 0}
    clean, noisy = (
        items.make_item(Description.check(SMALL | keys | {"frames": frames}), 0, device).files
        for keys in ({}, {"sensor": {"iso": 800}})
    )
    for name in ("defocused.png", "sharp.png"):
        assert clean[f"t000.{name}"] == clean[f"t001.{name}"]
    assert noisy["t000.defocused.png"] != noisy["t001.defocused.png"]
    assert noisy["t000.sharp.png"] == clean["t001.sharp.png"]

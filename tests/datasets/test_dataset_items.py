"""Items of a data set: their error, their layouts, killed batches, and what makes no item."""

import io
import json

import numpy as np
import OpenEXR
import pytest
import trimesh
from plain_scenes import refused
from scipy.io import loadmat

from lfcore import Lattice, ReadOptions, Sensor, SensorPlane, Slab, open_device
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.datasets import batches, items, kinds, stored, views
from lfcore.datasets.card import check_refused, tables
from lfcore.datasets.description import Description
from lfcore.datasets.sample import lens_of, sample
from lfcore.datasets.shapes import mesh
from lfcore.exchange import arrays, hci
from lfcore.exr import read_exr
from lfcore.pictures import read_picture
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.depth import all_samples, depth_of_views, disparity
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.files import scene_digest

pytestmark = pytest.mark.kernels
SMALL = {
    "name": "small", "kind": "focal_stacks", "pixels": 48, "quality_db": 32,
    "scenes": {"train": 2, "validation": 1}, "placement": {"objects": [4, 6], "size": [0.3, 0.6]},
    "shapes": {"builders": ["ball", "ring", "book"]}, "lights": {"share_sky": 0},
}  # fmt: skip


def written(tmp_path, item):
    for name, data in item.files.items():
        (tmp_path / name).write_bytes(data)
    return tmp_path


def db(one, other):
    return -10 * np.log10(np.square(srgb_encode(one) - srgb_encode(other)).mean())


def test_a_stack_has_the_error_that_is_promised_also_at_its_border(device, tmp_path):
    of = Description.check(SMALL)
    item = items.make_item(of, 0, device)
    folder = written(tmp_path, item)
    scene = sample(of, 0).scene
    tracer, camera = open_tracer(scene, device), lens_of(of, 0).camera
    plane = SensorPlane(of.lens.focus_m[0], camera.f_number)
    true = pictures_by_depth(tracer, camera, [plane], of.pixels, Lattice(24, 2))[0]
    found = srgb_decode(read_picture(folder / "focus00.tif"))
    assert db(found[4:-4, 4:-4], true[4:-4, 4:-4]) > of.quality_db
    assert item.record["expected_db"] >= of.quality_db
    depth = read_exr(folder / "depth.exr")[0]
    expected = depth_of_views(tracer, Slab(camera, 1, of.pixels))[0]
    assert depth.dtype == np.float16 and np.array_equal(depth[..., 0], expected.astype(np.float16))
    # The border: a blurred picture of a wider field has the same pixels there.
    wide = kinds.formed(of.model_copy(update={"quality_db": 44}), tracer, [plane])
    assert db(found[:3], wide.pictures[0][:3]) > of.quality_db - 4


@pytest.mark.parametrize("codes", ["srgb8", "linear16", "raw16"])
def test_a_sensor_makes_noise_in_all_pictures_but_the_sharp_one(device, codes):
    keys = {"iso": 800, "seed": 5}
    clean = items.make_item(Description.check(SMALL | {"codes": "linear16"}), 1, device).arrays
    of = Description.check(SMALL | {"codes": codes, "sensor": keys})
    item = items.make_item(of, 1, device)
    sensor, dtype = Sensor(**keys), np.uint8 if codes == "srgb8" else np.uint16
    stored_item = stored.StoredItem(1, item.files)
    found = stored_item.codes("focus02.tif")
    assert found.dtype == dtype and np.array_equal(found, item.arrays["focus"][2])
    light = {"srgb8": srgb_decode, "linear16": lambda x: x / 65535, "raw16": sensor.developed}
    error = light[codes](found) - clean["focus"][2] / 65535
    assert error.std() == pytest.approx(np.sqrt(clean["focus"][2].mean() / 65535 / 1875), rel=0.2)
    others = [
        a - clean["focus"][k] / 65535 for k, a in enumerate(map(light[codes], item.arrays["focus"]))
    ]
    assert abs(np.corrcoef(others[0].ravel(), others[1].ravel())[0, 1]) < 0.1
    if codes == "linear16":
        assert np.array_equal(item.arrays["sharp"], clean["sharp"])
    assert "iso 800" in item.record["pictures"]["noise"]
    assert stored_item.shown("focus00.tif").dtype == np.uint8
    again = items.make_item(of, 1, open_device(threads=1), encoded=False).arrays["focus"]
    assert np.array_equal(again, item.arrays["focus"])


def test_truth_has_normals_albedo_and_numbers_of_objects(device):
    of = Description.check(SMALL | {"truth": True})
    item = items.make_item(of, 1, device)
    channels = OpenEXR.File(io.BytesIO(item.files["truth.exr"]), separate_channels=True).channels()
    names = {"depth_m", "normal.X", "albedo.G", "object", "material", "triangle", "coc_px.04",
             "specular", "virtual_depth_m"}  # fmt: skip
    assert names <= set(channels) and "flow_px.U" not in channels
    drawn = sample(of, 1)
    numbers = channels["object"].pixels
    assert numbers.min() == 1 and 3 <= len(np.unique(numbers)) <= len(drawn.objects) + 1
    assert item.record["seen"] == pytest.approx((numbers > 1).mean(), abs=1e-3)
    blur = kinds.blur_px(drawn.scene.camera, 48, channels["depth_m"].pixels, of.lens.focus_m[4])
    assert np.allclose(channels["coc_px.04"].pixels, blur, atol=1e-4)
    assert item.arrays["truth_normal"].shape == (48, 48, 3)
    field = Description.check(SMALL | {
        "kind": "light_fields", "quality_db": 20, "also": [], "truth": True,
        "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 2},
        "placement": {"depth_m": [1.1, 2.8], "wall_m": 3, "objects": 4},
    })  # fmt: skip
    arrays = items.make_item(field, 1, device, encoded=False).arrays
    assert np.shape(arrays["truth_flow_px"]) == (4, 48, 48, 2)
    assert not np.any(arrays["truth_flow_px"][3]) and np.any(arrays["truth_flow_px"][0])


def test_blur_is_that_of_a_thin_lens():
    camera = lens_of(Description.check(SMALL), 0).camera
    near, at, far = kinds.blur_px(camera, 100, np.array([0.1, 0.3, 3.0], np.float32), 0.3)
    assert near < 0 and abs(at) < 1e-5 and far > 0
    diameter = camera.focal_length_m / camera.f_number * (1 / 0.3 - 1 / 3)
    assert far == pytest.approx(diameter / camera.field_width * 100, rel=1e-5)


def test_pairs(device, tmp_path):
    of = Description.check(SMALL | {"kind": "defocus_pairs"})
    folder = written(tmp_path, items.make_item(of, 1, device))
    coc, depth = (read_exr(folder / f"{name}.exr")[0][..., 0] for name in ("coc_px", "depth_m"))
    record = json.loads((folder / "json").read_text())
    assert record["focus_m"] == [of.lens.focus_m[1]]
    assert np.allclose(coc, kinds.blur_px(lens_of(of, 0).camera, 48, depth, of.lens.focus_m[1]))
    sharp, soft = (read_picture(folder / f"{name}.png") for name in ("sharp", "defocused"))
    assert sharp.shape == soft.shape == (48, 48, 3) and (sharp != soft).any()


def test_a_light_field_is_read_as_hcis_and_its_views_are_true(device, tmp_path):
    of = Description.check(SMALL | {
        "kind": "light_fields", "pixels": 40, "quality_db": 28, "also": ["mat", "hdf5"],
        "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 3},
        "placement": {"depth_m": [1.1, 2.8], "wall_m": 3},
    })  # fmt: skip
    item = items.make_item(of, 2, device)
    grid = hci.read_hci(written(tmp_path, item), ReadOptions())
    array = loadmat(io.BytesIO(item.files["mat"]))["LF"]
    assert array.shape == (3, 3, 40, 40, 3)
    codes = arrays.data_set(tmp_path / "h5", "LF")
    assert codes.dtype == np.uint8 and np.array_equal(codes[0, 2], grid.read(2, 0))
    assert np.array_equal(luma_as_basic_lfsr(array[0, 2]), luma_of_codes(codes[0, 2]))
    tracer, slab = open_tracer(sample(of, 2)[0], device), Slab(lens_of(of, 0).camera, 3, 40)
    depths = depth_of_views(tracer, slab, all_samples(slab))
    map_of_view = (tmp_path / "gt_disp_lowres_Cam005.pfm").read_bytes()
    stored = np.frombuffer(map_of_view[-40 * 40 * 4 :], "<f4").reshape(40, 40)[::-1]
    assert np.array_equal(stored, disparity(slab, depths[5]))
    assert np.array_equal(stored, arrays.data_set(tmp_path / "h5", "disp_lowres")[1, 2])
    true = views.view(tracer, slab, 2, (12, 1))
    assert db(srgb_decode(grid.read(2, 0)), true) > of.quality_db


def luma_as_basic_lfsr(picture):
    """Y of 0 to 255 of a view, by the rule of BasicLFSR's scripts: ITU-R BT.601 of colours within
    0 and 1, offset 16 (github.com/ZhengyuLiang24/BasicLFSR, Generate_Data_for_Training.py)."""
    return np.rint(picture.astype(np.float64) @ (65.481, 128.553, 24.966) + 16)


def luma_of_codes(codes):
    weights = np.array((0.299, 0.587, 0.114)) * 219 / 255
    return np.rint(codes.astype(np.float64) @ weights + 16)


def made_by(of, tmp_path, name, device, indices=range(3)):
    batches.make_batch(
        of, indices, tmp_path / f"{name}.tar", tmp_path / f"{name}.json", tmp_path / name, device
    )


def test_equal_bytes_by_any_threads_and_batches(tmp_path):
    of = Description.check(SMALL)
    made_by(of, tmp_path, "whole", open_device(threads=1))
    parts = {}
    for index in range(3):
        made_by(of, tmp_path, f"part{index}", open_device(threads=2), [index])
        parts |= stored.members(tmp_path / f"part{index}.tar")
    assert dict(stored.members(tmp_path / "whole.tar")) == parts
    assert not (tmp_path / "whole").exists()


def test_a_killed_batch_keeps_whole_scenes(tmp_path, monkeypatch):
    of, device, done = Description.check(SMALL), open_device(threads=1), []
    make = items.make_item

    def killed(description, index, *more, **named):
        if len(done) == 2:
            raise KeyboardInterrupt
        done.append(index)
        return make(description, index, *more, **named)

    monkeypatch.setattr(batches, "make_item", killed)
    with pytest.raises(KeyboardInterrupt):
        made_by(of, tmp_path, "batch", device)
    assert not (tmp_path / "batch.tar").exists() and done == [0, 1]

    def counted(description, index, *more, **named):
        done.append(index)
        return make(description, index, *more, **named)

    monkeypatch.setattr(batches, "make_item", counted)
    made_by(of, tmp_path, "batch", device)
    assert done == [0, 1, 2]


def test_a_broken_mesh_is_left_out_and_scenes_without_it_stay(device, tmp_path):
    for k in range(3):
        trimesh.creation.box((1, 1, 1 + k)).export(tmp_path / f"{k}.ply")
    shapes = {"meshes": str(tmp_path), "share_of_meshes": 0.2, "builders": ["ball"]}
    of = Description.check(SMALL | {"shapes": shapes, "scenes": {"train": 6}})
    whole = [sample(of, index) for index in range(6)]
    (tmp_path / "1.ply").write_bytes(b"ply\nnonsense")
    mesh.cache_clear()
    for index, before in enumerate(whole):
        after = sample(of, index)
        assert ("1.ply" in before.objects) == ("1.ply" in after.dropped)
        if after.dropped:
            assert "1.ply" not in after.objects and len(after.objects) >= 2
        else:
            assert scene_digest(after.scene) == scene_digest(before.scene)
    dropped = [index for index, one in enumerate(whole) if "1.ply" in one.objects]
    assert 0 < len(dropped) < 6
    records = batches.make_batch(
        of, dropped[:1], tmp_path / "a.tar", tmp_path / "a.json", tmp_path / "a", device
    )
    listed = tables(of, records, tmp_path / "none")["sources"].set_index("shape")
    assert "1.ply" in listed.problem["1.ply"] and listed.problem.drop("1.ply").isna().all()
    for k in (0, 2):
        (tmp_path / f"{k}.ply").write_bytes(b"ply\nnonsense")
    mesh.cache_clear()
    refused("cannot be read", sample, of, dropped[0])


def test_a_set_in_which_much_is_refused_is_none():
    records = [{"refused": "because"}] + [{}] * 9
    check_refused(records)
    refused("1 of 9 scenes made no item, the first: because", check_refused, records[:-1])


@pytest.mark.parametrize("shards", [False, True])
def test_items_of_a_finished_set_are_kept_if_they_are_made_of_the_same(device, tmp_path, shards):
    old = Description.check(SMALL | {"shards": shards, "scenes_per_job": 2})
    folder, made_batches = tmp_path / "set", []
    for name in old.batches():
        shard = tmp_path / f"{name}.tar"
        words = old.scenes_of(name), shard, tmp_path / "records", tmp_path / "drafts", device
        made_batches.append((shard, batches.make_batch(old, *words, made_of="code")))
    records = [one for _, made in made_batches for one in made]
    stored.unpack(old, [shard for shard, _ in made_batches], folder / "data")
    for name, table in tables(old, records, folder / "data").items():
        table.to_csv(folder / f"{name}.csv", index=False)
    (folder / "description.yaml").write_text(json.dumps({"dataset": old.model_dump()}))
    finished = stored.Finished.at(folder)
    for index, record in enumerate(records):
        files, found = finished.item(index, "code")
        (item,) = stored.stored_items([shard for shard, _ in made_batches], [index])
        assert files == item.files and found == record
    assert finished.item(0, "other code") is None and finished.item(3, "code") is None
    place = folder / "data" / ("00000.tar" if shards else "000000AiF.tif")
    data = place.read_bytes()
    depth = stored.Finished.at(folder).item(0, "code")[0]["depth.exr" if shards else "sharp.tif"]
    place.write_bytes(data.replace(depth[-32:], bytes(32)))  # a whole tar file, another picture
    again = stored.Finished.at(folder)
    assert again.item(0, "code") is None
    kept = again.item(1, "code"), again.item(2, "code")
    assert [one is None for one in kept] == [shards, False]
    assert stored.Finished.at(tmp_path / "nothing") is None


def test_a_job_removes_its_drafts_of_other_code(device, tmp_path):
    of = Description.check(SMALL | {"placement": {"objects": 1, "size": 0.01, "least_seen": 0.5}})
    for stem in ("00000", "00001"):
        (tmp_path / f"drafts-0a-1b-{stem}").mkdir()
    batches.run_batch(of, range(1), tmp_path / "00000.tar", tmp_path / "set", "[]", device)
    assert {path.name for path in tmp_path.iterdir()} == {
        "00000.tar", "00000.json", "drafts-0a-1b-00001",
    }  # fmt: skip


def test_an_empty_frustum_is_refused(device, tmp_path):
    of = Description.check(SMALL | {"placement": {"objects": 1, "size": 0.01, "least_seen": 0.5}})
    made_by(of, tmp_path, "batch", device, [0])
    (record,) = json.loads((tmp_path / "batch.json").read_text())
    assert "empty frustum" in record["refused"]


@pytest.mark.parametrize(
    ("kind", "field", "place"),
    [
        ("focal_stacks", "focus03.tif", "000007_03All.tif"),
        ("focal_stacks", "depth.exr", "000007Dpt.exr"),
        ("light_fields", "input_Cam000.png", "hci/test/000007/input_Cam000.png"),
        ("light_fields", "mat", "HCI_new/test/000007.mat"),
        ("defocus_pairs", "json", "test/000007/item.json"),
    ],
)
def test_places(kind, field, place):
    assert stored.place_of(kind, "test", 7, field) == place

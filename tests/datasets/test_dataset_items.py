"""Items of a data set: their error, their layouts, killed batches, and what makes no item."""

import io
import json

import numpy as np
import pytest
import trimesh
from scipy.io import loadmat

from lfcore import Lattice, ReadOptions, SensorPlane, Slab, open_device
from lfcore.colour import srgb_decode, srgb_encode
from lfcore.datasets import items, views
from lfcore.datasets.description import Description
from lfcore.datasets.sample import camera_of, sample
from lfcore.exchange import arrays, hci
from lfcore.exr import read_exr
from lfcore.pictures import read_picture
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.depth import all_samples, depth_of_views, disparity
from lfcore.rendering.prepared import open_tracer

pytestmark = pytest.mark.kernels
SMALL = {
    "name": "small", "kind": "focal_stacks", "pixels": 48, "quality_db": 32,
    "scenes": {"train": 2, "validation": 1}, "placement": {"objects": [4, 6], "size": [0.3, 0.6]},
    "shapes": {"builders": ["ball", "ring", "book"]},
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
    scene, _ = sample(of, 0)
    tracer, camera = open_tracer(scene, device), camera_of(of)
    plane = SensorPlane(of.lens.focus_m[0], camera.f_number)
    true = pictures_by_depth(tracer, camera, [plane], of.pixels, Lattice(24, 2))[0]
    found = srgb_decode(read_picture(folder / "focus00.tif"))
    assert db(found[4:-4, 4:-4], true[4:-4, 4:-4]) > of.quality_db
    assert item.record["expected_db"] >= of.quality_db
    depth = read_exr(folder / "depth.exr")[0]
    expected = depth_of_views(tracer, Slab(camera, 1, of.pixels))[0]
    assert depth.dtype == np.float16 and np.array_equal(depth[..., 0], expected.astype(np.float16))
    # The border: a blurred picture of a wider field has the same pixels there.
    wide = items.formed(of.model_copy(update={"quality_db": 44}), tracer, [of.lens.focus_m[0]])
    assert db(found[:3], wide.pictures[0][:3]) > of.quality_db - 4


def test_blur_is_that_of_a_thin_lens():
    camera = camera_of(Description.check(SMALL))
    near, at, far = items.blur_px(camera, 100, np.array([0.1, 0.3, 3.0], np.float32), 0.3)
    assert near < 0 and abs(at) < 1e-5 and far > 0
    diameter = camera.focal_length_m / camera.f_number * (1 / 0.3 - 1 / 3)
    assert far == pytest.approx(diameter / camera.field_width * 100, rel=1e-5)


def test_pairs(device, tmp_path):
    of = Description.check(SMALL | {"kind": "defocus_pairs"})
    folder = written(tmp_path, items.make_item(of, 1, device))
    coc, depth = (read_exr(folder / f"{name}.exr")[0][..., 0] for name in ("coc_px", "depth_m"))
    record = json.loads((folder / "json").read_text())
    assert record["focus_m"] == [of.lens.focus_m[1]]
    assert np.allclose(coc, items.blur_px(camera_of(of), 48, depth, of.lens.focus_m[1]))
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
    assert array.shape == (3, 3, 40, 40, 3) and np.array_equal(array[0, 2], grid.read(2, 0))
    assert np.array_equal(arrays.data_set(tmp_path / "h5", "LF"), array)
    tracer, slab = open_tracer(sample(of, 2)[0], device), Slab(camera_of(of), 3, 40)
    depths = depth_of_views(tracer, slab, all_samples(slab))
    map_of_view = (tmp_path / "gt_disp_lowres_Cam005.pfm").read_bytes()
    stored = np.frombuffer(map_of_view[-40 * 40 * 4 :], "<f4").reshape(40, 40)[::-1]
    assert np.array_equal(stored, disparity(slab, depths[5]))
    assert np.array_equal(stored, arrays.data_set(tmp_path / "h5", "disp_lowres")[1, 2])
    true = views.view(tracer, slab, 2, (12, 1))
    assert db(srgb_decode(grid.read(2, 0)), true) > of.quality_db


def made_by(of, tmp_path, name, device, indices=range(3)):
    items.make_batch(
        of, indices, tmp_path / f"{name}.tar", tmp_path / f"{name}.json", tmp_path / name, device
    )


def test_equal_bytes_by_any_threads_and_batches(tmp_path):
    of = Description.check(SMALL)
    made_by(of, tmp_path, "whole", open_device(threads=1))
    parts = {}
    for index in range(3):
        made_by(of, tmp_path, f"part{index}", open_device(threads=2), [index])
        parts |= items.members(tmp_path / f"part{index}.tar")
    assert dict(items.members(tmp_path / "whole.tar")) == parts
    assert not (tmp_path / "whole").exists()


def test_a_killed_batch_keeps_whole_scenes_and_a_broken_mesh_loses_one(tmp_path, monkeypatch):
    meshes = tmp_path / "meshes"
    meshes.mkdir()
    trimesh.creation.box().export(meshes / "good.ply")
    (meshes / "bad.ply").write_bytes(b"ply\nnonsense")
    more = {"shapes": {"meshes": str(meshes), "share_of_meshes": 0.1, "builders": ["ball"]}}
    of = Description.check(SMALL | more | {"seed": 3, "scenes": {"train": 6}})
    device, done = open_device(threads=1), []
    make = items.make_item

    def killed(description, index, device):
        if len(done) == 4:
            raise KeyboardInterrupt
        done.append(index)
        return make(description, index, device)

    monkeypatch.setattr(items, "make_item", killed)
    with pytest.raises(KeyboardInterrupt):
        made_by(of, tmp_path, "batch", device, range(6))
    assert not (tmp_path / "batch.tar").exists() and done == [0, 1, 2, 3]
    monkeypatch.setattr(items, "make_item", lambda *words: done.append(words[1]) or make(*words))
    made_by(of, tmp_path, "batch", device, range(6))
    assert done == [0, 1, 2, 3, 4, 5]
    records = json.loads((tmp_path / "batch.json").read_text())
    refused = [one for one in records if "refused" in one]
    assert 0 < len(refused) < 6 and all("bad.ply" in one["refused"] for one in refused)
    held = {name[:6] for name, _ in items.members(tmp_path / "batch.tar")}
    assert len(held) == 6 - len(refused)


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
    assert items.place_of(kind, "test", 7, field) == place

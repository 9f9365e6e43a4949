"""Other programs' readers open a data set: DFV's rules for FoD500, webdataset and mlcroissant."""

import json

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from scipy.ndimage import map_coordinates

from lfcore import Slab, render, sample_scene
from lfcore.colour import srgb_codes, srgb_decode
from lfcore.datasets.batches import make_batch
from lfcore.datasets.card import tables, write_card
from lfcore.datasets.description import Description
from lfcore.datasets.stored import stored_items, unpack
from lfcore.exr import read_exr
from lfcore.pictures import read_picture
from lfcore.rendering.depth import depth_of_views
from lfcore.rendering.prepared import open_tracer
from tests.datasets.test_dataset_items import SMALL

pytestmark = pytest.mark.kernels


@pytest.fixture(scope="module")
def made(device, tmp_path_factory):
    """Folder of a data set of two stacks: ``shard.tar``, ``data`` and ``croissant.json``."""
    folder = tmp_path_factory.mktemp("made")
    of = Description.check(SMALL | {"scenes": {"train": 2, "validation": 0}})
    shard = folder / "shard.tar"
    records = make_batch(of, [0, 1], shard, folder / "records.json", folder / "drafts", device)
    unpack(of, [shard], folder / "data")
    files = {}
    for title, table in tables(of, records, folder / "data").items():
        files[title] = folder / f"{title}.csv"
        table.to_csv(files[title], index=False)
    write_card(folder / "croissant.json", of, files, command="test", code="1")
    return folder


def read_as_dfv(folder, number):
    """Stack (5, M, M, 3) uint8 and depth (M, M) float16, by the rules of DFV's loader.

    github.com/fuy34/DFV, dataloader/FoD500.py: pictures and depths are found by the last seven
    letters of their names, sorted, five pictures per depth; depth is the channel R in half floats.
    """
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    pictures = [name for name in names if name[-7:] == "All.tif" and int(name[:6]) < 400]
    depths = [name for name in names if name[-7:] == "Dpt.exr" and int(name[:6]) < 400]
    stack = [Image.open(folder / name) for name in pictures[5 * number : 5 * number + 5]]
    channels = OpenEXR.File(str(folder / depths[number]), separate_channels=True).channels()
    assert {"R", "G", "B"} <= set(channels)
    return np.stack([np.array(picture) for picture in stack]), channels["R"].pixels


@pytest.mark.parametrize("number", [0, 1])
def test_dfv_reads_stacks_and_depth(made, number):
    stack, depth = read_as_dfv(made / "data", number)
    (item,) = stored_items([made / "shard.tar"], [number])
    names = sorted(name for name in item.pictures() if name.startswith("focus"))
    assert np.array_equal(stack, [item.codes(name) for name in names])
    assert depth.dtype == np.float16 and np.array_equal(depth, item.floats("depth.exr"))


def read_as_fossa(folder, split, number, stop, distances):
    """All-in-focus picture, depth, matrix and focal stack, by the rules of FOSSA's loader.

    github.com/princeton-vl/FOSSA, dataset/infinigen_defocus.py: a split file's paths follow the
    data's folder, and pictures are named by f-number and focus with one decimal.
    """
    row = json.loads((folder / f"{split}.json").read_text())["files"][number]
    names = [f"image_ap_{stop:.1f}_fd_{metres:.1f}" for metres in distances]
    stack = [np.array(Image.open(f"{folder}{row[name]}").convert("RGB")) for name in names]
    sharp = np.array(Image.open(f"{folder}{row['image']}").convert("RGB"))
    matrix = np.load(f"{folder}{row['camera']}")["K"]
    return sharp, np.load(f"{folder}{row['depth']}"), matrix, np.stack(stack)


def test_fossa_reads_infinigen_defocus(device, tmp_path):
    of = Description.check(SMALL | {
        "kind": "infinigen_defocus", "pixels": "64x48", "scenes": {"train": 1, "validation": 1},
        "lens": {"stops": [1, 2.8], "focus_m": [0.1, 0.3, 1]},
    })  # fmt: skip
    shard = tmp_path / "shard.tar"
    make_batch(of, [0, 1], shard, tmp_path / "records.json", tmp_path / "drafts", device)
    unpack(of, [shard], tmp_path / "data")
    sharp, depth, matrix, stack = read_as_fossa(tmp_path / "data", "val", 0, 2.8, of.lens.focus_m)
    assert sharp.shape == (48, 64, 3) and stack.shape == (3, 48, 64, 3)
    assert (tmp_path / "data/val/000001/image_ap_2.80_fd_0.10.png").exists()
    scene = sample_scene(of, 1)
    picture = render(scene, focus_m=0.3, f_number=2.8, pixels=(64, 48), views=8)
    assert np.abs(srgb_codes(picture).astype(int) - stack[1]).mean() < 2
    # The matrix takes points of the scene to their pixels.
    tracer = open_tracer(scene, device)
    assert np.allclose(
        depth, depth_of_views(tracer, Slab.of(scene.camera, 1, (64, 48)))[0], rtol=1e-6
    )
    columns, rows, _ = (np.linalg.inv(matrix) @ np.array([10.5, 20.5, 1])) * depth[20, 10]
    origin, towards = np.zeros((1, 3)), np.array([[columns, rows, depth[20, 10]]])
    hit = tracer.closest_hit(origin.astype(np.float32), towards.astype(np.float32))[1]
    assert hit[0] == pytest.approx(1, abs=1e-4)


def test_restormer_reads_dual_pixel_pairs(device, tmp_path):
    """By the rules of Restormer's loader of DPDD: sorted PNGs of 16 bits of the split's folders.

    github.com/swz30/Restormer, Defocus_Deblurring/test_dual_pixel_defocus_deblur.py
    """
    of = Description.check(SMALL | {
        "kind": "dual_pixel", "codes": "srgb16", "quality_db": 38,
        "scenes": {"train": 0, "validation": 0, "test": 2},
        "lens": {"focus_m": [0.3], "f_number": 0.15},
        # The images in mirrors and glass are out of focus where their surfaces are in focus.
        "materials": {"share_polished": 0, "share_glass": 0, "share_coated": 0},
    })  # fmt: skip
    shard = tmp_path / "shard.tar"
    make_batch(of, [0, 1], shard, tmp_path / "records.json", tmp_path / "drafts", device)
    unpack(of, [shard], tmp_path / "data")
    found = {}
    for name in ("test_c/source", "test_c/target", "test_l/source", "test_r/source"):
        files = sorted((tmp_path / "data" / name).glob("*.png"))
        assert [file.stem for file in files] == ["000000", "000001"]
        found[name] = read_picture(files[1]) / np.float32(65535)
    whole, sharp, left, right = (srgb_decode(picture) for picture in found.values())
    below_white = np.maximum(left, right) < 0.99
    error = np.abs((left + right) / 2 - whole)[below_white]
    assert error.max() < 1e-4  # codes of 16 bits
    assert (np.abs(whole - sharp) > 0.02).mean() > 0.02
    blur, apart = (
        read_exr(tmp_path / f"data/test_truth/000001_{name}_px.exr")[0][..., 0]
        for name in ("coc", "disparity")
    )
    np.testing.assert_allclose(apart, blur * 4 / (3 * np.pi), atol=1e-3)
    row, column = np.mgrid[:48, :48]
    blurred, (left, right) = np.abs(blur) > 2, (each[..., 1] for each in (left, right))
    moved = map_coordinates(right, (row, column + apart), order=1, mode="nearest")
    assert np.abs(moved - left)[blurred].mean() < 0.7 * np.abs(right - left)[blurred].mean()


def test_webdataset_reads_the_shard(made):
    webdataset = pytest.importorskip("webdataset")
    samples = list(webdataset.WebDataset(str(made / "shard.tar"), shardshuffle=False))
    assert [sample["__key__"] for sample in samples] == ["000000", "000001"]
    (item,) = stored_items([made / "shard.tar"], [1])
    fields = {name: data for name, data in samples[1].items() if not name.startswith("_")}
    assert {name: bytes(data) for name, data in fields.items()} == item.files


def test_mlcroissant_reads_the_card(made):
    mlcroissant = pytest.importorskip("mlcroissant")
    rows = list(mlcroissant.Dataset(str(made / "croissant.json")).records("items"))
    assert [float(row["items/expected_db"]) >= SMALL["quality_db"] for row in rows] == [True, True]


def test_mlcroissant_reads_every_picture(made):
    mlcroissant = pytest.importorskip("mlcroissant")
    card = mlcroissant.Dataset(str(made / "croissant.json"))
    found = {}
    for row in card.records("tif"):
        item, picture = int(row["tif/index"]), np.array(row["tif/content"])
        found.setdefault(item, []).append(picture)
    for item in stored_items([made / "shard.tar"], [0, 1]):
        expected = {item.codes(name).tobytes() for name in item.pictures()}
        assert {picture.tobytes() for picture in found[item.index]} == expected
    depths = {int(row["exr/index"]): row["exr/content"] for row in card.records("exr")}
    assert depths[1] == (made / "data/000001Dpt.exr").read_bytes()

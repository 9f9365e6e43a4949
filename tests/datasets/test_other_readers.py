"""Other programs' readers open a data set: DFV's rules for FoD500, webdataset and mlcroissant."""

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from lfcore.datasets.card import tables, write_card
from lfcore.datasets.description import Description
from lfcore.datasets.items import make_batch
from lfcore.datasets.stored import stored_items, unpack
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

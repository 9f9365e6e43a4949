"""Items made in the loop's own process, and whole sets made by one call."""

import json
import multiprocessing
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from plain_scenes import refused

import lfcore
from lfcore.cli import main
from lfcore.datasets import stacks as module
from lfcore.datasets.description import Description
from lfcore.datasets.items import make_item
from lfcore.datasets.stored import StoredItem
from tests.datasets.test_dataset_items import SMALL

FIELD = {
    "kind": "light_fields", "quality_db": 20,
    "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 2},
    "placement": {"depth_m": [1.1, 2.8], "wall_m": 3, "objects": 4},
}  # fmt: skip


def names(number):
    """The files of each field of a stack, of a pair and of a light field."""
    return [
        {"focus": [f"focus{k:02d}.tif" for k in range(5)], "sharp": "sharp.tif", "depth":
         "depth.exr"},
        {"sharp": "sharp.png", "defocused": "defocused.png", "depth_m": "depth_m.exr"},
        {"input_Cam": [f"input_Cam{k:03d}.png" for k in range(4)]},
    ][number]  # fmt: skip


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("change", "number"), [({}, 0), ({"kind": "defocus_pairs"}, 1), (FIELD, 2)]
)
def test_an_item_has_the_content_of_the_files(device, change, number):
    of = Description.check(SMALL | change)
    stored = StoredItem(1, make_item(of, 1, device).files)
    item = lfcore.Stacks(of)[1]
    for field, files in names(number).items():
        read = [
            stored.codes(file) if file.endswith(("tif", "png")) else stored.floats(file)
            for file in ([files] if isinstance(files, str) else files)
        ]
        assert np.array_equal(item[field], read if isinstance(files, list) else read[0])
        assert item[field].dtype in (np.uint8, np.float32)
    assert item["index"] == 1 and np.allclose(item["focus_m"], stored.record["focus_m"])


def total(number):
    return int(lfcore.Stacks(SMALL)[number]["focus"].sum())


@pytest.mark.kernels
@pytest.mark.parametrize("start", ["fork", "spawn"])
def test_workers_make_the_same_items(start):
    expected = [total(number) for number in (0, 1)]  # a forked worker has this process's driver
    with multiprocessing.get_context(start).Pool(2) as pool:
        assert pool.map_async(total, [0, 1]).get(timeout=300) == expected


def test_each_item_is_one_workers(monkeypatch):
    stacks = lfcore.Stacks(SMALL | {"scenes": {"train": 9, "validation": 5}}, "validation")
    monkeypatch.setattr(module.Stacks, "__getitem__", lambda self, number: self.scenes[number])
    assert len(stacks) == 5 and list(stacks) == [9, 10, 11, 12, 13]
    found = []
    for rank, worker in np.ndindex(2, 2):
        info = SimpleNamespace(id=worker, num_workers=2)
        loader = SimpleNamespace(get_worker_info=lambda info=info: info)
        monkeypatch.setitem(sys.modules, "torch.utils.data", loader)
        monkeypatch.setenv("RANK", str(rank))
        monkeypatch.setenv("WORLD_SIZE", "2")
        found += list(stacks)
    assert sorted(found) == [9, 10, 11, 12, 13]
    monkeypatch.setenv("WORLD_SIZE", "1")
    refused("RANK: must be a rank below WORLD_SIZE", list, stacks)
    refused("unknown split 'dev'", lfcore.Stacks, SMALL, "dev")


@pytest.mark.kernels
def test_a_scene_that_makes_no_item_is_skipped_by_iterators(monkeypatch):
    few = {"objects": 1, "size": 0.01, "least_seen": 0.5}
    stacks = lfcore.Stacks(SMALL | {"placement": few, "scenes": {"train": 2, "validation": 0}})
    assert list(stacks) == []
    refused("empty frustum", stacks.__getitem__, 0)
    with pytest.raises(IndexError):
        stacks[2]


def test_torch_is_not_imported():
    code = "import lfcore, sys; lfcore.Stacks; assert not any('torch' in m for m in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)


def content(folder):
    return {file.name: file.read_bytes() for file in (folder / "data").iterdir()}


@pytest.mark.kernels
def test_a_set_is_made_whole_extended_and_left_by_a_run_that_fails(tmp_path):
    folder, keys = tmp_path / "mine", SMALL | {"scenes": {"train": 1, "validation": 1}}
    told = []
    lfcore.make_dataset(keys, folder, progress=lambda *counts: told.append(counts))
    assert told == [(1, 1)] and (folder / "index.html").exists()
    first = content(folder)
    assert first["000001AiF.tif"] == make_item(Description.check(keys), 1).files["sharp.tif"]
    seconds = folder / "seconds.csv"
    planted = re.sub(r"(?m)^(\d),[\d.]+", r"\1,123.0", seconds.read_text())
    seconds.write_text(planted)
    more = keys | {"scenes": {"train": 2, "validation": 1}, "scenes_per_job": 1}
    lfcore.make_dataset(more, folder, processes=2)
    assert seconds.read_text().startswith(planted) and len(content(folder)) == 24
    assert {k: v for k, v in content(folder).items() if k in first and "json" not in k} == {
        k: v for k, v in first.items() if "json" not in k
    }
    before = content(folder)
    refused("scenes made no item", lfcore.make_dataset, keys | {"quality_db": 100}, folder)
    assert content(folder) == before
    assert [p.name for p in folder.iterdir() if p.name.startswith("drafts")] == []


@pytest.mark.kernels
def test_the_command_makes_a_set(tmp_path):
    keys = SMALL | {"scenes": {"train": 1, "validation": 0}}
    (tmp_path / "mine.yaml").write_text(json.dumps({"dataset": keys}))
    assert main(["dataset", str(tmp_path / "mine.yaml"), "-o", str(tmp_path / "mine")]) == 0
    card = json.loads((tmp_path / "mine/croissant.json").read_text())
    assert "lfcore dataset mine/description.yaml -o mine" in card["description"]
    again = ["dataset", str(tmp_path / "mine/description.yaml"), "-o", str(tmp_path / "again")]
    assert main([*again, "--processes", "1"]) == 0
    assert content(tmp_path / "again") == content(tmp_path / "mine")


def files_below(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    "other", ["letter.txt", "description.yaml", "croissant.json/a", "batches-of-bread/a"]
)
def test_a_folder_of_other_files_is_refused(tmp_path, other):
    for name in (other, "data/holiday.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(json.dumps({"dataset": SMALL}))
    before = files_below(tmp_path)
    refused("has files, but no data set", lfcore.make_dataset, SMALL, tmp_path)
    assert files_below(tmp_path) == before


def test_a_description_is_not_overwritten_by_its_set(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "description.yaml").write_text(json.dumps({"dataset": SMALL}))
    before = files_below(tmp_path)
    refused("holds the description", lfcore.make_dataset, "description.yaml", ".")
    assert files_below(tmp_path) == before


@pytest.mark.kernels
def test_a_run_that_was_killed_is_taken_up(tmp_path, monkeypatch):
    """Killed before any part of the set has its place, and after each."""
    folder, keys = tmp_path / "mine", SMALL | {"scenes": {"train": 1, "validation": 0}}
    replace, moves = Path.replace, []

    def killed_at(part, place):
        if part.parent.name == "whole":
            moves.append(part.name)
            if len(moves) in (1, 3, 6, 10):
                raise KeyboardInterrupt
        return replace(part, place)

    monkeypatch.setattr(Path, "replace", killed_at)
    for _ in range(4):
        with pytest.raises(KeyboardInterrupt):
            lfcore.make_dataset(keys, folder)
        assert any(folder.glob("batches-*"))
    lfcore.make_dataset(folder / "description.yaml", folder)
    assert not any(folder.glob("batches-*")) and len(content(folder)) > 3

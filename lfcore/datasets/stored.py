"""Items of a data set on disk: WebDataset's shards, or folders as readers of each kind need them.

Items are read field by field.  When a description or the code changes, unaffected items of a
finished data set are kept.
"""

import csv
import io
import json
import re
import tarfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from itertools import groupby
from pathlib import Path
from typing import Any, cast

import numpy as np

from lfcore.colour import srgb_codes
from lfcore.datasets.description import Description
from lfcore.errors import LfcoreError, StorageError
from lfcore.exr import read_exr
from lfcore.files import cannot_write, file_digest, read_json, whole_file, write_json
from lfcore.pictures import by_opencv, codes_of

SPLIT_NAMES = {"train": "train", "validation": "val", "test": "test"}
"""The splits of other programs' readers."""


DPDD = {
    "whole.png": "c/source", "sharp.png": "c/target", "left.png": "l/source",
    "right.png": "r/source",
}  # fmt: skip
"""The folders of pictures in DPDD, after the split and an underscore: whole picture (c) and halves,
blurred (source) and sharp."""


def of_instant(number: int, name: str) -> str:
    """Return the field of an instant, of an item with several; :func:`instant_of` splits it."""
    return f"t{number:03d}.{name}"


def instant_of(field: str) -> tuple[str, str]:
    """Return the instant (``t003``; empty for an item at rest, and for the record) and the name."""
    found = re.match(r"(t\d{3,})\.(.+)", field)
    return (found[1], found[2]) if found else ("", field)


def place_of(kind: str, split: str, index: int, field: str) -> str:
    """Return the path of a field's file in the folder of a data set; an instant has the place of an
    item whose number it extends."""
    instant, name = instant_of(field)
    number = f"{index:06d}_{instant}" if instant else f"{index:06d}"
    if kind == "focal_stacks":  # one folder: training, then validation
        name = re.sub(r"^focus(\d+)\.tif$", r"_\1All.tif", name)
        named = {"depth.exr": "Dpt.exr", "sharp.tif": "AiF.tif", "json": ".json",
                 "truth.exr": "Truth.exr"}.get(name, name)  # fmt: skip
        return f"{number}{named}"
    if name == "mat":
        return f"HCI_new/{'test' if split == 'test' else 'training'}/{number}.mat"
    if name == "h5":
        return f"hdf5/{split}/{number}.h5"
    if kind in ("infinigen_defocus", "dual_pixel"):
        split = SPLIT_NAMES[split]
    if kind == "dual_pixel":
        other = f"truth/{number}_{'item.json' if name == 'json' else name}"
        return f"{split}_{f'{DPDD[name]}/{number}.png' if name in DPDD else other}"
    folder = f"hci/{split}" if kind == "light_fields" else split
    return f"{folder}/{number}/{'item.json' if name == 'json' else name}"


def write_tar(path: str | Path, files: Iterable[tuple[str, bytes]]) -> None:
    with (
        whole_file(path) as file,
        tarfile.open(fileobj=file, mode="w|", format=tarfile.USTAR_FORMAT) as whole,
    ):
        for name, data in files:
            member = tarfile.TarInfo(name)  # without time and owner: same scene, same bytes
            member.size = len(data)
            whole.addfile(member, io.BytesIO(data))


def members(tar: str | Path) -> Iterator[tuple[str, bytes]]:
    """Yield (name, content) of the files in a tar file."""
    try:
        with tarfile.open(tar) as whole:
            for member in whole:
                data = whole.extractfile(member)
                assert data is not None
                yield member.name, data.read()
    except tarfile.TarError as error:
        raise StorageError(f"cannot be read: {error}", file=tar) from None


def unpack(description: Description, shards: Iterable[str | Path], folder: Path) -> None:
    """Write the items as readers of their kind need them, or as shards; each item's record gets its
    split."""

    def completed(shard: str | Path) -> Iterator[tuple[str, bytes]]:
        for name, data in members(shard):
            if name.endswith(".json"):
                split = description.split(int(name.partition(".")[0]))
                data = json.dumps(json.loads(data) | {"split": split}).encode()
            yield name, data

    folder.mkdir(parents=True, exist_ok=True)
    listed: dict[str, list[dict[str, str]]] = {}
    for shard in shards:
        if description.shards:
            write_tar(folder / Path(shard).name, completed(shard))
            continue
        for name, data in completed(shard):
            index, _, field = name.partition(".")
            split = description.split(int(index))
            file = folder / place_of(description.kind, split, int(index), field)
            try:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(data)
            except OSError as error:
                raise cannot_write(file, error) from None
            if description.kind == "infinigen_defocus" and field == "json":
                fields = json.loads(data)["fields"]
                listed.setdefault(split, []).extend(_infinigen_rows(split, index, fields))
    for split, rows in listed.items():
        write_json(folder / f"{SPLIT_NAMES[split]}.json", {"files": rows})


def _infinigen_rows(split: str, index: str, fields: list[str]) -> list[dict[str, str]]:
    """Return the rows of an item's instants in the file of its split: names, and paths below the
    data's folder."""
    names = {
        "image_all_in_focus.png": "image",
        "depth.npy": "depth",
        "cam_all_in_focus.npz": "camera",
    }
    rows: dict[str, dict[str, str]] = {}
    for path in fields:
        instant, file = instant_of(path)
        row = rows.setdefault(instant, {"id": f"{index}_{instant}" if instant else index})
        numbers = re.fullmatch(r"image_ap_([\d.]+)_fd_([\d.]+)\.png", file)
        name = names.get(file)
        if numbers:
            name = "image_ap_{:.1f}_fd_{:.1f}".format(*map(float, numbers.groups()))
        if name:
            row[name] = f"/{place_of('infinigen_defocus', split, int(index), path)}"
    return list(rows.values())


@dataclass(frozen=True)
class Finished:
    """The items of a finished data set.

    Attributes
    ----------
    data : Path
        The folder of items.
    description : Description
        The description of the data set.
    sums : dict
        The SHA-256 of each file.
    seconds : dict
        The times of each item, as texts.
    """

    data: Path
    description: Description
    sums: dict[str, str]
    seconds: dict[str, dict[str, str]]
    _places: dict[str, dict[str, tuple[int, int]]] = field(default_factory=dict, repr=False)

    @classmethod
    def at(cls, folder: Path) -> "Finished | None":
        """Return the data set in a folder; None if there is none."""
        try:
            keys = read_json(folder / "description.yaml")["dataset"]
            files, seconds = (_rows(folder / f"{name}.csv") for name in ("files", "seconds"))
            sums = {row["file"]: row["sha256"] for row in files}
            times = {row.pop("index"): row for row in seconds}
            return cls(folder / "data", Description.check(keys), sums, times)
        except (OSError, ValueError, KeyError, LfcoreError):
            return None

    def item(self, index: int, made_of: str) -> tuple[dict[str, bytes], dict[str, Any]] | None:
        """Return files and record of an item with the same ``made_of`` and unchanged files."""
        if index >= self.description.count or str(index) not in self.seconds:
            return None
        try:
            record = json.loads(self._file(index, "json"))
            if record["made_of"] != made_of:
                return None
            files = {name: self._file(index, name) for name in record["fields"]}
        except (OSError, ValueError, KeyError, tarfile.TarError):
            return None
        record.pop("split")
        files["json"] = json.dumps(record).encode()
        times = {name: float(value) for name, value in self.seconds[str(index)].items()}
        return files, record | times

    def _file(self, index: int, name: str) -> bytes:
        if self.description.shards:
            path = f"{index // self.description.scenes_per_job:05d}.tar"
            start, size = self._places_in(path)[f"{index:06d}.{name}"]
            with (self.data / path).open("rb") as shard:
                shard.seek(start)
                return shard.read(size)
        path = place_of(self.description.kind, self.description.split(index), index, name)
        data = (self.data / path).read_bytes()
        if sha256(data).hexdigest() != self.sums[path]:
            raise ValueError("was edited")
        return data

    def _places_in(self, shard: str) -> dict[str, tuple[int, int]]:
        """Return first byte and size of each file in a shard; of none if the shard was edited."""
        path = self.data / shard
        if shard not in self._places and file_digest(path) == self.sums[shard]:
            with tarfile.open(path) as whole:
                found = {member.name: (member.offset_data, member.size) for member in whole}
            self._places[shard] = found
        return self._places.setdefault(shard, {})


def _rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@dataclass(frozen=True)
class StoredItem:
    """The files of one item by their field."""

    index: int
    files: dict[str, bytes] = field(repr=False)

    @cached_property
    def record(self) -> dict[str, Any]:
        return json.loads(self.files["json"])

    def first(self) -> "StoredItem":
        """The item with the files of its first instant alone, as those of an item at rest."""
        names = {instant_of(name)[1]: name for name in reversed(self.files)}
        return StoredItem(self.index, {name: self.files[full] for name, full in
                                       reversed(names.items())})  # fmt: skip

    def pictures(self) -> list[str]:
        """The fields that are pictures, in order."""
        return [name for name in self.files if name.endswith((".tif", ".png"))]

    def codes(self, name: str) -> np.ndarray:
        """Return a picture's codes, (H, W, 3), or (H, W) of a sensor with a Bayer pattern."""
        return cast(np.ndarray, by_opencv(self.files[name]))

    def shown(self, name: str) -> np.ndarray:
        """Return a picture to look at, (H, W, 3) uint8."""
        codes = self.codes(name)
        if codes.dtype == np.uint8:
            return codes
        if self.record["pictures"]["colour_space"].startswith("sRGB"):
            return codes_of(codes)
        light = srgb_codes(codes / np.float32(codes.max() or 1))
        return np.repeat(light[..., None], 3, 2) if light.ndim == 2 else light

    def floats(self, name: str) -> np.ndarray:
        """Return (H, W) float32 of a PFM, an NPY, or an EXR's first channel."""
        if name.endswith(".npy"):
            return np.load(io.BytesIO(self.files[name]), allow_pickle=False)
        if name.endswith(".pfm"):
            return self.codes(name)
        return read_exr(io.BytesIO(self.files[name]))[0][..., 0].astype(np.float32)


def stored_items(shards: Iterable[str | Path], indices: Iterable[int]) -> Iterator[StoredItem]:
    """Yield items ``indices``, one at a time."""
    wanted = set(indices)
    for shard in shards:
        for index, group in groupby(members(shard), lambda file: int(file[0].partition(".")[0])):
            if index in wanted:
                yield StoredItem(index, {name.partition(".")[2]: data for name, data in group})

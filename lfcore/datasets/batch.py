"""A job's scenes: each a tar file as soon as it is made, all together one shard of WebDataset's.

A killed job finds its scenes again by the digest of what they are made from.  Items are read from
shards field by field.
"""

from __future__ import annotations

import io
import json
import shutil
import tarfile
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from lfcore.datasets.description import Description
from lfcore.datasets.items import Item, make_item, place_of
from lfcore.errors import OpticsError, SceneError, StorageError
from lfcore.exchange.pictures import read_pfm
from lfcore.exr import read_exr
from lfcore.files import cannot_write, make_folder, whole_file, write_json
from lfcore.opencl.device import Device
from lfcore.pictures import read_codes

PARTS = ("scene", "files")
"""The parts of an item's core seconds; the rest is rays and pictures."""


def make_batch(
    description: Description,
    indices: Iterable[int],
    shard: str | Path,
    records: str | Path,
    drafts: str | Path,
    device: Device,
    *,
    progress: Callable[[int, int], None] | None = None,
) -> list[dict]:
    """Make scenes ``indices``: a tar file of all, and their records as JSON.

    A record has what is known of an item and its ``seconds``, or why a scene was ``refused``.
    Scenes that are whole in the folder ``drafts`` are not made again; it is gone at the end.
    """
    indices, drafts, made = list(indices), Path(drafts), []
    make_folder(drafts)
    for done, index in enumerate(indices, 1):
        tar, record = (drafts / f"{index:06d}.{kind}" for kind in ("tar", "json"))
        if not record.exists():  # written after its tar file
            found = _tried(description, index, device)
            write_json(record, _kept(tar, index, found))
        made.append(json.loads(record.read_text(encoding="utf-8")))
        if progress:
            progress(done, len(indices))
    with _tar(shard) as whole:
        for index in indices:
            for name, data in members(drafts / f"{index:06d}.tar"):
                _put(whole, name, data)
    write_json(records, made)
    shutil.rmtree(drafts, ignore_errors=True)
    return made


def _tried(description: Description, index: int, device: Device) -> Item:
    start, processor = time.perf_counter(), time.process_time()
    try:
        item = make_item(description, index, device)
    except (SceneError, OpticsError) as error:
        item = Item(record={"index": index, "refused": str(error)})
    item.record["seconds"] = round(time.perf_counter() - start, 3)
    item.record["core_seconds"] = round(time.process_time() - processor, 3)
    for part in PARTS:
        item.record[f"{part}_core_seconds"] = round(item.watch.seconds.get(part, 0.0), 3)
    return item


def _kept(tar: Path, index: int, item: Item) -> dict:
    with _tar(tar) as whole:
        for name, data in item.files.items():
            _put(whole, f"{index:06d}.{name}", data)
    return item.record


@contextmanager
def _tar(path: str | Path) -> Iterator[tarfile.TarFile]:
    with whole_file(path) as file:
        stream = cast(IO[bytes], file)
        with tarfile.open(fileobj=stream, mode="w|", format=tarfile.USTAR_FORMAT) as whole:
            yield whole


def _put(whole: tarfile.TarFile, name: str, data: bytes) -> None:
    member = tarfile.TarInfo(name)  # no time, no owner: equal scenes are equal bytes
    member.size = len(data)
    whole.addfile(member, io.BytesIO(data))


def members(tar: str | Path) -> Iterator[tuple[str, bytes]]:
    """(name, content) of the files in a tar file."""
    try:
        with tarfile.open(tar) as whole:
            for member in whole:
                data = whole.extractfile(member)
                assert data is not None
                yield member.name, data.read()
    except tarfile.TarError as error:
        raise StorageError(f"cannot be read: {error}", file=tar) from None


def unpack(description: Description, shards: Iterable[str | Path], folder: Path) -> None:
    """Lay the items out as the kind's readers want them; or keep the shards as they are."""
    folder.mkdir(parents=True, exist_ok=True)
    for shard in shards:
        if description.shards:
            shutil.copyfile(shard, folder / Path(shard).name)
            continue
        for name, data in members(shard):
            index, _, field = name.partition(".")
            split = description.split(int(index))
            file = folder / place_of(description.kind, split, int(index), field)
            try:
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(data)
            except OSError as error:
                raise cannot_write(file, error) from None


@dataclass(frozen=True)
class StoredItem:
    """The files of one item by their field."""

    index: int
    files: dict[str, bytes] = field(repr=False)

    @cached_property
    def record(self) -> dict[str, Any]:
        return json.loads(self.files["json"])

    def pictures(self) -> list[str]:
        """The fields that are pictures, in order."""
        return [name for name in self.files if name.endswith((".tif", ".png"))]

    def codes(self, name: str) -> np.ndarray:
        """(H, W, 3) uint8."""
        return self._read(name, read_codes)

    def floats(self, name: str) -> np.ndarray:
        """(H, W) float32 of an EXR, the first channel, or of a PFM."""
        if name.endswith(".pfm"):
            return self._read(name, read_pfm)
        return self._read(name, lambda file: read_exr(file)[0][..., 0].astype(np.float32))

    def _read(self, name: str, read: Callable[[Path], np.ndarray]) -> np.ndarray:
        with tempfile.NamedTemporaryFile(suffix=Path(name).suffix) as file:
            file.write(self.files[name])
            file.flush()
            return read(Path(file.name))


def stored_items(shards: Iterable[str | Path], indices: Iterable[int]) -> Iterator[StoredItem]:
    """Some items, one at a time."""
    wanted = set(indices)
    for shard in shards:
        for index, group in groupby(members(shard), lambda one: int(one[0].partition(".")[0])):
            if index in wanted:
                yield StoredItem(index, {name.partition(".")[2]: data for name, data in group})

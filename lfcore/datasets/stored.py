"""Items as they are in shards, decoded field by field."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.datasets.batch import members
from lfcore.exchange.pictures import read_pfm
from lfcore.exr import read_exr
from lfcore.pictures import read_codes


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

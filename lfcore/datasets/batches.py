"""Batches of items: one job's items in a shard, which a killed job continues.

Each finished item of a job is a tar file; at the end they become one shard in WebDataset's format.
A killed job finds finished items again by the digest of their sources.
"""

import json
import shutil
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lfcore.datasets.description import Description
from lfcore.datasets.item import Item
from lfcore.datasets.items import make_item
from lfcore.datasets.stored import Finished, members, write_tar
from lfcore.errors import OpticsError, SceneError
from lfcore.files import make_folder, write_json
from lfcore.opencl.device import Device, open_device
from lfcore.versions import version


def make_batch(
    description: Description,
    indices: Iterable[int],
    shard: str | Path,
    records: str | Path,
    drafts: str | Path,
    device: Device,
    *,
    made_of: str = "",
    finished: Finished | None = None,
) -> list[dict]:
    """Make items ``indices``: a tar file of all, and their records as JSON.

    Complete items in the folder ``drafts``, which is removed at the end, or in a ``finished`` data
    set are kept if their sources' digest is ``made_of``.
    """
    indices, drafts, all_records = list(indices), Path(drafts), []
    make_folder(drafts)
    for index in indices:
        tar, record = (drafts / f"{index:06d}.{kind}" for kind in ("tar", "json"))
        if not record.exists():  # written after its tar file
            kept = finished.item(index, made_of) if finished else None
            files, facts = kept or _make_or_refuse(description, index, device, made_of, drafts)
            write_tar(tar, ((f"{index:06d}.{name}", data) for name, data in files.items()))
            write_json(record, facts)
        all_records.append(json.loads(record.read_text(encoding="utf-8")))
    write_tar(shard, (file for i in indices for file in members(drafts / f"{i:06d}.tar")))
    write_json(records, all_records)
    shutil.rmtree(drafts, ignore_errors=True)
    return all_records


def made_of(description: Description, sources: str) -> str:
    """Return the digest of all that items depend on: keys, files and the library's code."""
    return f"{description.digest(sources)}-{version(Path(__file__))}"


def run_batch(
    description: Description, scenes: range, shard: Path, folder: Path, sources: str,
    device: Device | str | None, threads: int | None = None,
) -> None:  # fmt: skip
    """Make the items of one job: ``shard``, and a JSON file of records beside it.

    Complete items of a killed job, or of the finished data set in ``folder``, are kept.
    """
    digest = made_of(description, sources)
    drafts = shard.with_name(f"drafts-{digest}-{shard.stem}")
    for other in set(shard.parent.glob(f"drafts-*-{shard.stem}")) - {drafts}:
        shutil.rmtree(other, ignore_errors=True)  # of other code or sources
    if not isinstance(device, Device):
        device = open_device(device, threads=threads)
    make_batch(
        description, scenes, shard, shard.with_suffix(".json"), drafts, device, made_of=digest,
        finished=Finished.at(folder),
    )  # fmt: skip


def _make_or_refuse(
    description: Description, index: int, device: Device, made_of: str, drafts: Path
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return files and record of an item; for a refused scene no files, and the reason."""
    start, processor = time.perf_counter(), time.process_time()
    try:
        item = make_item(description, index, device, made_of, drafts=drafts)
    except (SceneError, OpticsError) as error:
        item = Item(record={"index": index, "refused": str(error)})
    item.record["seconds"] = round(time.perf_counter() - start, 3)
    item.record["core_seconds"] = round(time.process_time() - processor, 3)
    for part in ("scene", "files"):  # the rest is tracing
        item.record[f"{part}_core_seconds"] = round(item.watch.seconds.get(part, 0.0), 3)
    return item.files, item.record

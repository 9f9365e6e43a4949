"""A data set on disk: items in batches, then its folder with tables, card and page.

The workflow runs these steps as jobs; :func:`make_dataset` runs them in one call.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lfcore import __version__
from lfcore.datasets.sample import described
from lfcore.errors import SettingsError
from lfcore.files import make_folder, read_json, write_json
from lfcore.opencl.device import Device
from lfcore.progress import Progress
from lfcore.versions import commit

if TYPE_CHECKING:
    from lfcore.datasets.description import Description

_BATCHES = re.compile(r"batches-[0-9a-f]+-[0-9a-f]+-\d+-\d+")
"""The folder of a set's jobs: digests of sources and code, scenes in all and per job."""


def write_set(description: Description, batches: Path, folder: Path, command: str) -> None:
    """Write items, tables, card and page into ``folder``, from the shards and records in another;
    the card names the ``command``."""
    from lfcore.datasets.card import check_refused, tables, write_card, write_report
    from lfcore.datasets.stored import unpack
    from lfcore.evaluation.table_files import write_csv

    shards = [batches / f"{batch}.tar" for batch in description.batches()]
    records = [one for shard in shards for one in read_json(shard.with_suffix(".json"))]
    check_refused(records)
    unpack(description, shards, folder / "data")
    contents = tables(description, records, folder / "data")
    files = {name: folder / f"{name}.csv" for name in contents}
    for name, file in files.items():
        write_csv(file, contents[name])
    # JSON is YAML.
    write_json(folder / "description.yaml", {"dataset": description.model_dump()})
    code = f"{__version__}, commit {commit()}" if commit() else __version__
    write_card(folder / "croissant.json", description, files, command=command, code=code)
    counts = contents["items"].split.value_counts().items()
    facts = {
        "items": ", ".join(f"{count} {name}" for name, count in counts),
        "licence": description.licence or "not given",
        "refused": len(contents["refused"]),
        "seed": description.seed,
        "lfcore": code,
        "core seconds per item": round(contents["seconds"]["core_seconds"].mean(), 2),
    }
    write_report(folder / "index.html", description, records, shards, files, facts)


def make_dataset(
    description: Description | str | Path | Mapping[str, Any],
    folder: str | Path,
    *,
    processes: int = 1,
    device: Device | str | None = None,
    progress: Progress | None = None,
) -> Path:
    """Make a data set: items, tables, card and page, as the workflow does.

    Parameters
    ----------
    description : Description, str, Path or mapping
        As in :func:`sample_scene`.
    folder : str or Path
        The folder of the set: new, empty, or with a set that this one replaces when it is whole.
        Items that are in it already, or that a killed run has finished, are not made again.
    processes : int
        Above 1, jobs of ``scenes_per_job`` scenes run side by side with a thread each; then the
        script needs ``if __name__ == "__main__"``, as for all spawned processes.
    device, progress : optional
        As in :func:`render`; with several processes the device is a name.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    SettingsError
        The description is impossible, the folder has other files, or a package is missing.
    SceneError
        More than a tenth of the scenes made no item; a set in the folder is left.
    StorageError
        A file cannot be written.

    Examples
    --------
    >>> few = {"objects": (1, 2, "even"), "least_seen": 0.01}
    >>> keys = {"name": "mine", "kind": "focal_stacks", "pixels": 16, "quality_db": 20}
    >>> keys |= {"scenes": {"train": 1, "validation": 0}, "placement": few}
    >>> sorted(file.name for file in (lfcore.make_dataset(keys, "mine") / "data").iterdir())[0]
    '000000.json'
    """
    folder = Path(folder).absolute()
    if isinstance(description, str | Path):
        _check_outside(Path(description), folder)
    description = described(description)
    _check_place(folder)
    make_folder(folder)
    description.check_files(folder)
    from lfcore.datasets.batches import made_of

    sources, per_job = description.sources(), description.scenes_per_job
    # Complete jobs of a killed run of the same scenes are kept.
    batches = folder / f"batches-{made_of(description, sources)}-{description.count}-{per_job}"
    for other in _batches(folder) - {batches}:
        shutil.rmtree(other)
    make_folder(batches)
    shards = {batches / f"{batch}.tar": batch for batch in description.batches()}
    jobs = [
        (description, description.scenes_of(batch), shard, folder, sources)
        for shard, batch in shards.items() if not shard.with_suffix(".json").exists()
    ]  # fmt: skip
    for done, _ in enumerate(_run(jobs, processes, device), len(shards) - len(jobs) + 1):
        if progress:
            progress(done, len(shards))
    whole = batches / "whole"
    shutil.rmtree(whole, ignore_errors=True)
    command = f"lfcore dataset {folder.name}/description.yaml -o {folder.name}"
    write_set(description, batches, whole, command)
    first = ["croissant.json", "description.yaml"]  # by them, a killed run's folder is a set
    for part in sorted(whole.iterdir(), key=lambda part: (part.name not in first, part.name)):
        if (place := folder / part.name).is_dir():
            shutil.rmtree(place)
        part.replace(place)
    shutil.rmtree(batches)
    return folder


Job = tuple["Description", range, Path, Path, str]
"""The arguments of a job, without the device."""


def _run(jobs: Sequence[Job], processes: int, device: Device | str | None) -> Iterator[None]:
    """Run jobs, in processes of one thread if there are several; yield after each."""
    from lfcore.datasets.batches import run_batch

    if processes <= 1:
        for job in jobs:
            run_batch(*job, device)
            yield
        return
    name = device.name if isinstance(device, Device) else device
    with ProcessPoolExecutor(processes, get_context("spawn")) as pool:
        running = [pool.submit(run_batch, *job, name, threads=1) for job in jobs]
        try:
            for finished in as_completed(running):
                finished.result()
                yield
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _check_place(folder: Path) -> None:
    """Raise :class:`SettingsError` for missing packages, and for a folder of other files."""
    try:
        import matplotlib  # noqa: F401  (the page's figures)
        import pandas  # noqa: F401  (the tables)
    except ImportError as error:
        problem = f"data sets need the package {error.name}"
        raise SettingsError(problem, remedy="pip install 'lfcore[workflow]'") from None
    if not folder.is_dir() or _is_set(folder):
        return
    if set(folder.iterdir()) - _batches(folder) - {folder / "croissant.json"}:
        remedy = "Name a new folder, or one with a data set"
        raise SettingsError("has files, but no data set", file=folder, remedy=remedy)


def _check_outside(description: Path, folder: Path) -> None:
    """Raise :class:`SettingsError` for a description in the folder, unless it is that of its
    set."""
    inside = folder.resolve() in description.resolve().parents
    if inside and not (_is_set(folder) and description.resolve().parent == folder.resolve()):
        problem = f"holds the description {description.name}"
        remedy = "Name another folder: that of a set is replaced"
        raise SettingsError(problem, file=folder, remedy=remedy)


def _batches(folder: Path) -> set[Path]:
    return {path for path in folder.iterdir() if _BATCHES.fullmatch(path.name) and path.is_dir()}


def _is_set(folder: Path) -> bool:
    """Whether a description and card that :func:`write_set` wrote are in a folder."""
    try:
        keys, card = (read_json(folder / name) for name in ("description.yaml", "croissant.json"))
        return set(keys) == {"dataset"} and card["name"] == keys["dataset"]["name"]
    except (OSError, ValueError, KeyError, TypeError):
        return False

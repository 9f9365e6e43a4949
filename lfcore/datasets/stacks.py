"""Items of a data set as arrays, made where they are used: in a training loop's process."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.datasets.sample import described
from lfcore.errors import OpticsError, SceneError, SettingsError, check_known
from lfcore.opencl.device import open_device

if TYPE_CHECKING:
    from lfcore.datasets.description import Description

SPLITS = ("train", "validation", "test")


class Stacks:
    """Items of a data set, traced when they are asked for; nothing is stored.

    A sequence, also for ``torch.utils.data.DataLoader``, whose workers may be forked or spawned.
    An iterator has the items of its worker and rank alone: of a loader's worker in a
    ``torch.utils.data.IterableDataset``, and of the environment's ``RANK`` and ``WORLD_SIZE``.

    Parameters
    ----------
    description : Description, str, Path or mapping
        As in :func:`sample_scene`.
    split : str, optional
        ``train``, ``validation`` or ``test``.  Default: all items.
    device : str, optional
        Part of an OpenCL device's name.
    threads : int
        Processor threads per process.

    Raises
    ------
    SettingsError
        The description or the split is unknown.

    Notes
    -----
    Item i of all has the bits of the files that :func:`make_dataset` and the workflow write.  A
    scene that makes no item (``refused.csv``) raises :class:`SceneError` or :class:`OpticsError`
    when it is indexed; iterators skip it.

    Examples
    --------
    >>> few = {"objects": (1, 2, "even"), "least_seen": 0.01}
    >>> keys = {"name": "mine", "kind": "focal_stacks", "pixels": 16, "quality_db": 20}
    >>> stacks = lfcore.Stacks(keys | {"placement": few}, "train")
    >>> len(stacks), stacks[0]["focus"].shape, stacks[0]["depth"].shape
    (400, (5, 16, 16, 3), (16, 16))
    """

    def __init__(
        self, description: Description | str | Path | Mapping[str, Any], split: str | None = None,
        *, device: str | None = None, threads: int = 1,
    ) -> None:  # fmt: skip
        self.description, self.device, self.threads = described(description), device, threads
        if self.description.kind == "films":
            remedy = "Make a data set, and open its files"
            raise SettingsError("films are files, not arrays", key="kind", remedy=remedy)
        counts = self.description.scenes.model_dump()
        self.scenes = range(sum(counts.values()))
        """The numbers of the scenes."""
        if split is not None:
            check_known(SettingsError, "split", split, counts)
            first = sum(counts[name] for name in SPLITS[: SPLITS.index(split)])
            self.scenes = range(first, first + counts[split])

    def __len__(self) -> int:
        return len(self.scenes)

    def __getitem__(self, number: int) -> dict[str, np.ndarray]:
        """Make one item.

        Returns
        -------
        dict of ndarray
            The content of files by their name without number and suffix; numbered ones are stacked:
            of focal stacks ``focus`` (P, H, W, 3) and ``sharp`` (H, W, 3), codes, and ``depth``
            (H, W) float32, metres; also ``focus_m`` (P,) float32, and the scene's ``index``.
            Of several ``frames`` all but these two begin with an axis of time, with an instant less
            for ``next_flow_px``, ``next_scene_flow_m`` and ``next_occluded``; and ``times_s``.
        """
        from lfcore.datasets.items import make_item  # needs pydantic

        index = self.scenes[number]
        # Opened here: a worker that was forked or spawned has a queue of its own.
        device = open_device(self.device, threads=self.threads)
        item = make_item(self.description, index, device, encoded=False)
        arrays = {name: np.asarray(array) for name, array in item.arrays.items()}
        halves = {name: a.astype(np.float32) for name, a in arrays.items() if a.dtype == np.float16}
        facts = {"focus_m": np.array(item.record["focus_m"], np.float32), "index": np.array(index)}
        if "times_s" in item.record:
            facts["times_s"] = np.array(item.record["times_s"])
        return arrays | halves | facts

    def __iter__(self) -> Iterator[dict[str, np.ndarray]]:
        part, parts = _part()
        for number in range(part, len(self), parts):
            try:
                item = self[number]
            except (SceneError, OpticsError):
                continue  # refused.csv of a set on disk lists these
            yield item


def _part() -> tuple[int, int]:
    """Return the number of this worker among those of all ranks, and their count."""
    loader: Any = sys.modules.get("torch.utils.data")  # a worker of a loader has loaded it
    worker = loader.get_worker_info() if loader else None
    number, workers = (worker.id, worker.num_workers) if worker else (0, 1)
    try:
        rank, ranks = (int(os.environ.get(name) or least) for name, least in
                       (("RANK", 0), ("WORLD_SIZE", 1)))  # fmt: skip
    except ValueError:
        rank, ranks = 0, 0
    if not 0 <= rank < ranks:
        problem = "must be a rank below WORLD_SIZE"
        raise SettingsError(problem, key="RANK", remedy="Unset both, or set them as torchrun does")
    return rank * workers + number, ranks * workers

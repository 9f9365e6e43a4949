"""Data sets as their readers want them: two focal stacks, and light fields, made small."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.datasets.card import tables, write_card
from lfcore.datasets.description import Description
from lfcore.datasets.items import make_batch, unpack
from lfcore.exchange import arrays
from lfcore.opencl.device import open_device

PACKAGES = ["numpy<2.3", "torch", "torchvision", "OpenEXR", "opencv-python-headless", "pillow",
            "h5py", "scipy", "scikit-image", "matplotlib", "einops", "xlwt", "webdataset",
            "mlcroissant", "imageio"]  # fmt: skip
"""DFV's loader calls what numpy 2.3 no longer has."""
STACKS = {"kind": "focal_stacks", "pixels": 256, "quality_db": 30, "scenes": {"train": 2,
          "validation": 0}}  # fmt: skip
FIELDS: dict[str, Any] = {
    "kind": "light_fields", "pixels": 96, "quality_db": 25, "scenes": {"train": 1, "validation": 0},
    "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 5},
    "placement": {"depth_m": [1.1, 2.8], "wall_m": 3},
}  # fmt: skip
WHOLE = FIELDS | {
    "pixels": 512, "quality_db": 20, "also": ["hdf5"], "lens": FIELDS["lens"] | {"views": 9},
}  # fmt: skip
"""As large as EPINET's loader demands."""


def made(work: Path, name: str, keys: Mapping[str, object]) -> Path:
    """The folder with ``data``, ``shard.tar`` and ``croissant.json``; made once."""
    folder = work / "datasets" / name
    if not (folder / "croissant.json").exists():
        of = Description.check({"name": name, **keys})
        shard = folder / "shard.tar"
        records = make_batch(
            of, range(of.count), shard, folder / "records.json", folder / "drafts", open_device()
        )
        unpack(of, [shard], folder / "data")
        files = {}
        for title, table in tables(of, records, folder / "data").items():
            files[title] = folder / f"{title}.csv"
            table.to_csv(files[title], index=False)
        write_card(folder / "croissant.json", of, files, command="benchmark", commit="none")
    return folder


def field_of(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Views by row and column, and the middle one's disparity, of the first HDF5 file."""
    file = folder / "data/hdf5/train/000000.h5"
    views, disparity = (arrays.data_set(file, name) for name in ("LF", "disp_lowres"))
    assert views is not None and disparity is not None
    return views, disparity[len(views) // 2, len(views) // 2]

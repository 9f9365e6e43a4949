"""Light field files of noise, which are their own ground truth."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from lfcore import Encoding, Geometry, LightField, ReadOptions, import_lightfield
from lfcore.exchange.grid import ViewGrid
from lfcore.exchange.importing import read_grid, store_grid

EXACT = Encoding("ffv1", "gbrp", preset=None, tune=None)
KNOWN = Geometry(pitch_m=0.004, pixel_pitch=0.02, delta=0.5, sensor_m=0.036)


def noise(rows, columns, height, width, seed=1):
    """(rows, columns, height, width, 3) uint8."""
    shape = (rows, columns, height, width, 3)
    return np.random.default_rng(seed).integers(0, 256, shape, dtype=np.uint8)


@dataclass
class Noise:
    path: Path
    views: np.ndarray

    @property
    def field(self) -> LightField:
        return LightField.open(self.path)


def store(folder, views, geometry=KNOWN, name="noise") -> Noise:
    path = folder / f"{name}.mkv"
    store_grid(path, ViewGrid.of_array(views, name, format="test", geometry=geometry), EXACT)
    return Noise(path, views)


def pictures(folder, views, name):
    """The views (rows, columns, ...) as files, which ``name(row, column)`` calls."""
    folder.mkdir(parents=True)
    for row, column in np.ndindex(views.shape[:2]):
        Image.fromarray(views[row, column]).save(folder / name(row, column))


def taken_back(source, folder, **more):
    """The light field file of what was exported, exact."""
    options = more.pop("options", None) or ReadOptions()
    output = folder / "back.mkv"
    field = import_lightfield(source, output, encoding=Encoding("ffv1"), options=options, **more)
    return read_grid(Path(source), more.get("format"), options), field


def all_views(field):
    columns, rows = field.grid
    return field.views(0, 0, columns, rows, codes=True)

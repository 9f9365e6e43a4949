"""The table of formats, in the order in which an import tries them."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType

from lfcore.exchange.grid import ExchangeError


@dataclass(frozen=True)
class Format:
    """A format and its module, which has ``recognise(path)`` and ``read(path, options)`` if it can
    be imported, ``write(source, folder, options)`` if it can be exported."""

    name: str
    module: str
    title: str
    imports: bool = True
    exports: bool = True

    def load(self) -> ModuleType:
        return import_module(f"lfcore.exchange.{self.module}")


FORMATS = {
    row.name: row
    for row in (
        Format("hci", "hci", "HCI 4D light field benchmark: parameters.cfg, input_Cam000.png"),
        Format("nerfstudio", "nerfstudio", "nerfstudio: transforms.json, cameras on a plane"),
        Format("blender", "blender", "Blender add-ons: lightfield.json, param.txt"),
        Format("json", "image_folder", "our own: views and views.json, geometry included"),
        Format("llff", "llff", "LLFF: poses_bounds.npy"),
        Format("colmap", "colmap", "COLMAP text model, cameras on a plane"),
        Format("stanford", "stanford", "Stanford archive: out_YY_XX_y_x.png"),
        Format("jpeg-pleno", "jpeg_pleno", "JPEG Pleno: 000_000.ppm of 10 bits"),
        Format("quilt", "quilt", "Looking Glass quilt: name_qs8x6a0.75.png"),
        Format("eslf", "eslf", "Lytro's ESLF: one picture of macropixels"),
        Format("mat", "matlab", "LFToolbox: variable LF of a .mat file"),
        Format("hdf5", "hdf5", "HCI's scene.h5: data set LF (needs h5py)"),
        Format("mosaic", "mosaic", "one picture of views side by side, as plenpy saves"),
        Format(
            "folder", "folder", "any pictures of views, one per file, in any order", exports=False
        ),
        Format(
            "plenoptic", "plenoptic", "raw plenoptic picture, white image, centres", imports=False
        ),
    )
}


def find(name: str, *, imports: bool = False) -> Format:
    """The format of that name; :class:`ExchangeError` if it cannot be imported, or exported."""
    what = "imported" if imports else "exported"
    able = [row.name for row in FORMATS.values() if (row.imports if imports else row.exports)]
    if name not in able:
        problem = f"cannot be {what}" if name in FORMATS else "is no known format"
        raise ExchangeError(
            f"{name!r} {problem}", key="--format", remedy=f"Use one of {', '.join(able)}"
        )
    return FORMATS[name]


def recognise(path: Path) -> Format:
    """The format of a folder or file, by names and headers."""
    for row in FORMATS.values():
        if row.imports and row.load().recognise(path):
            return row
    what = "folder" if path.is_dir() else "file"
    raise ExchangeError(
        f"is not a {what} of a known format",
        file=path,
        remedy="Name it with --format, and the grid with --views COLUMNSxROWS",
    )

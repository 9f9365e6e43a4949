"""The table of formats, in the order in which an import tries them."""

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from lfcore.exchange.reading import ExchangeError


@dataclass(frozen=True)
class Format:
    """A format: a folder with a file among ``marks``, or a file with such a suffix.

    Its module has ``read_NAME(path, options)`` for imports, ``write_NAME(source, folder, options)``
    for exports, and ``recognise_NAME(path)`` if marks are not enough.
    """

    name: str
    module: str
    title: str
    marks: tuple[str, ...] = ()
    imports: bool = True
    exports: bool = True

    def call(self, function: str) -> Any:
        """The module's function ``read``, ``write`` or ``recognise``; None if there is none."""
        module = import_module(f"lfcore.exchange.{self.module}")
        return getattr(module, f"{function}_{self.name.replace('-', '_')}", None)

    def is_at(self, path: Path) -> bool:
        """Whether a folder or file has this format, by names and headers."""
        by_suffix = path.suffix.lower() in self.marks and path.is_file()
        if by_suffix or path.name in self.marks or any((path / m).is_file() for m in self.marks):
            return True
        own = self.call("recognise")
        return own is not None and own(path)


FORMATS = {
    row.name: row
    for row in (
        Format("hci", "hci", "HCI 4D light field benchmark: parameters.cfg, input_Cam000.png",
               ("parameters.cfg",)),
        Format("nerfstudio", "transforms", "nerfstudio: transforms.json, cameras on a plane",
               ("transforms.json",)),
        Format("blender", "transforms", "Blender add-on of IDLab: lightfield.json",
               ("lightfield.json",)),
        Format("json", "folder", "our own: views and views.json, geometry included",
               ("views.json",)),
        Format("llff", "posed", "LLFF: poses_bounds.npy", ("poses_bounds.npy",), exports=False),
        Format("colmap", "posed", "COLMAP text model, cameras on a plane",
               ("sparse/0/images.txt",)),
        Format("stanford", "folder", "Stanford archive: out_YY_XX_y_x.png"),
        Format("jpeg-pleno", "folder", "JPEG Pleno: 000_000.ppm of 10 bits"),
        Format("quilt", "whole", "Looking Glass quilt: name_qs8x6a0.75.png"),
        Format("eslf", "whole", "Lytro's ESLF: one picture of macropixels"),
        Format("mat", "arrays", "LFToolbox: variable LF of a .mat file", (".mat",)),
        Format("hdf5", "arrays", "HCI's scene.h5: data set LF (needs h5py)", (".h5", ".hdf5")),
        Format("mosaic", "whole", "one picture of views side by side, as plenpy saves"),
        Format("folder", "folder", "any pictures of views, one per file, in any order",
               exports=False),
        Format("plenoptic", "whole", "raw plenoptic picture, white image, centres",
               imports=False),
    )
}  # fmt: skip


def find(name: str, *, imports: bool = False) -> Format:
    """The format of this name; raises :class:`ExchangeError` if it lacks imports, or exports."""
    direction = "imported" if imports else "exported"
    able = [row.name for row in FORMATS.values() if (row.imports if imports else row.exports)]
    if name not in able:
        why = f"cannot be {direction}" if name in FORMATS else "is no known format"
        problem = f"{name!r} {why}"
        raise ExchangeError(problem, key="format", remedy=f"Use one of {', '.join(able)}")
    return FORMATS[name]


def recognise(path: Path) -> Format:
    """The format of a folder or file, by names and headers."""
    for row in FORMATS.values():
        if row.imports and row.is_at(path):
            return row
    kind = "folder" if path.is_dir() else "file"
    problem = f"is not a {kind} of a known format"
    remedy = "Name its format, and the columns and rows of views"
    raise ExchangeError(problem, file=path, remedy=remedy)

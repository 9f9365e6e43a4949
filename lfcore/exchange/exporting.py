"""Export of light fields: choose views, write a draft folder, move it into place."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from lfcore.errors import StorageError, suggest_keywords
from lfcore.exchange import table
from lfcore.exchange.grid import WriteOptions
from lfcore.exchange.reading import ExchangeError
from lfcore.exchange.source import Selection, Source
from lfcore.files import cannot_write, draft_folder
from lfcore.lightfield import LightField
from lfcore.opencl.device import Device, open_device
from lfcore.refocus.free_views import FreeViews, expected_db
from lfcore.scene.model import Scene
from lfcore.storage.segment import named_errors

POOR_DB = 35.0
"""The PSNR of views, dB, below which a note advises more recorded views: edges show then."""


@suggest_keywords
def export_lightfield(
    lightfield: str | Path | LightField,
    format: str,
    folder: str | Path,
    *,
    selection: Selection | None = None,
    scene: Scene | None = None,
    device: Device | str | None = None,
    options: WriteOptions | None = None,
) -> list[str]:
    """Write a light field in the format of another program.

    Parameters
    ----------
    lightfield : str, Path or LightField
        The file, or an open one.
    format : str
        A name in :data:`lfcore.exchange.table.FORMATS`.
    folder : str or Path
        The folder to write; it appears when it is whole.
    selection : Selection, optional
        Some of the views, or a part of the picture.  Default: all.
    scene : Scene, optional
        The recorded scene, for the depth of every view.
    device : Device or str, optional
        An open device, or part of its name.
    options : WriteOptions, optional
        Settings of single formats.

    Returns
    -------
    list of str
        Notes on facts that the format lacks.

    Raises
    ------
    StorageError
        The format cannot be written, or the file lacks what it needs; no folder is left.

    Examples
    --------
    >>> selection = lfcore.Selection(views=(3, 3), pixels=16)
    >>> notes = lfcore.export_lightfield(field, "hci", "ball_hci", selection=selection)
    >>> lfcore.import_lightfield("ball_hci", "again.mkv").grid
    (3, 3)
    """
    row = table.find(format)
    folder, options = Path(folder), replace(options or WriteOptions())  # without its notes
    opened = lightfield if isinstance(lightfield, LightField) else LightField.open(lightfield)
    check_new(folder)
    device = open_device(device) if isinstance(device, str) else device
    source = Source(opened, selection or Selection(), device, scene)
    with whole_folder(folder) as stage, named_errors(folder, "exporting"):
        row.call("write")(source, stage, options)
    if source.depth_given and opened.metadata.specular:
        options.notes.append("depth is that of surfaces, not of what mirrors, glass and coats show")
    if source.free is not None:
        options.notes.append(_quality(source, source.free))
    return options.notes


def check_new(folder: Path) -> None:
    """Raise :class:`ExchangeError` unless ``folder`` is empty or not there."""
    if folder.exists() and not (folder.is_dir() and not any(folder.iterdir())):
        raise ExchangeError(
            "exists already", file=folder, key="folder", remedy="Name a folder that is not there"
        )


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A folder that takes the name ``folder`` when the block ends without an exception."""
    with draft_folder(folder) as draft:
        stage = draft / "export"
        stage.mkdir()
        try:
            yield stage
        except StorageError as error:  # names what is about to be gone
            if error.file and draft in Path(error.file).parents:
                raise error.named(StorageError, file=folder) from error
            raise
        try:
            os.replace(stage, folder)
        except OSError as error:
            raise cannot_write(folder, error) from error


def _quality(source: Source, free: FreeViews) -> str:
    """A note on the expected quality of views that were not traced."""
    expected = expected_db(free)
    note = "views are made by depth"
    if expected is None:
        return f"{note}, from too few views to measure how well"
    note += f"; {expected:.1f} dB expected, measured on recorded views that were held back"
    outermost = (free.slab.views - 1) / 2 * free.slab.lens_pitch_m * (1 + 1e-6)
    if max(source.columns_m.max(), source.rows_m.max()) > outermost:
        note += ", and less beyond the outermost recorded views"
    if expected < POOR_DB:
        side = free.slab.views + 2
        note += f". Below {POOR_DB:g} dB, edges show: record {side} x {side} views with depth"
    return note

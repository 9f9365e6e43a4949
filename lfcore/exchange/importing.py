"""Import of light fields: recognise the format, read, complete the geometry, encode."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.errors import suggest_keywords
from lfcore.exchange import table
from lfcore.exchange.grid import Order, ReadOptions, ViewGrid
from lfcore.exchange.pictures import is_picture
from lfcore.exchange.reading import NOT_OF_THE_FORMAT, ExchangeError
from lfcore.files import make_folder, refuse_special
from lfcore.lightfield import LightField
from lfcore.pictures import LIGHT_FIELD, check_suffix
from lfcore.progress import Progress
from lfcore.storage.codecs import Encoding
from lfcore.storage.defaults import chosen_encoding
from lfcore.storage.metadata import Metadata
from lfcore.storage.views_store import store_views

MOST_ASIDE = 4.0
"""The ratio of squared movements aside to those along from which lines count as exchanged."""
LEAST_MOVED = 0.05
"""The movement in pixels, root mean square, below which optical flow is of noise."""


def read_grid(source: Path, format: str | None, options: ReadOptions) -> ViewGrid:
    """Read the views of ``source``; raises :class:`ExchangeError` that names the file."""
    if not source.exists():
        raise ExchangeError("no such file or folder", file=source)
    if source.is_dir() and len(inside := list(source.iterdir())) == 1 and inside[0].is_file():
        source = inside[0]
    if format is None and options.views and is_picture(source):
        format = "eslf" if ".eslf." in source.name.lower() else "mosaic"
    refuse_special(source, ExchangeError)
    row = table.find(format, imports=True) if format else table.recognise(source)
    folder = source.parent if source.name in row.marks else source
    try:
        grid = replace(row.call("read")(folder, options), format=row.name)
    except NOT_OF_THE_FORMAT as error:
        problem = f"is no valid {row.name} ({type(error).__name__}: {error})"
        remedy = "Name another format, or mend what describes the views"
        raise ExchangeError(problem, file=source, remedy=remedy) from error
    asked = options.geometry
    if options.fov_deg is not None:
        if not 0 < options.fov_deg < 180:
            raise ExchangeError(f"must lie between 0 and 180, not {options.fov_deg:g}",
                                key="fov_deg")  # fmt: skip
        extent = 2 * np.tan(np.radians(options.fov_deg) / 2)
        asked = replace(asked, pixel_pitch=float(extent) / grid.width)
    geometry = asked.or_else(grid.geometry)
    if asked.pixel_pitch is not None:
        geometry = replace(geometry, sensor_m=None)
    values = geometry.pitch_m, geometry.pixel_pitch, geometry.delta
    for key, value in zip(("pitch_m", "pixel_pitch", "delta"), values, strict=True):
        if value is not None and not (0 < value < np.inf or (key == "delta" and value == 0)):
            raise ExchangeError(f"cannot be {value:g}", key=key)
    order = options.order or Order()
    return replace(grid, geometry=geometry).turned(order.left, order.up)


@suggest_keywords
def import_lightfield(
    source: str | Path,
    path: str | Path,
    *,
    format: str | None = None,
    options: ReadOptions | None = None,
    encoding: Encoding | None = None,
    progress: Progress | None = None,
) -> LightField:
    """Write a light field of another program to a light field file.

    Parameters
    ----------
    source : str or Path
        The folder or file to read.
    path : str or Path
        The file to write, ``.mkv``.
    format : str, optional
        A name in :data:`lfcore.exchange.table.FORMATS`.  Default: recognised.
    options : ReadOptions, optional
        Facts that the format may lack: geometry, number and order of views.
    encoding : Encoding, optional
        How the views are stored; with ``ffv1``, 8-bit RGB is kept exactly.
    progress : callable, optional
        Called with (views done, of all).

    Returns
    -------
    LightField
        The file, opened.  ``content["source"]`` has the format, and ``notes`` on facts that were
        left out or assumed.

    Raises
    ------
    StorageError
        Names the file and what was expected; no file is left.

    Examples
    --------
    >>> lfcore.write_picture("shots/0.png", np.zeros((16, 16, 3)))
    >>> lfcore.write_picture("shots/1.png", np.ones((16, 16, 3)))
    >>> geometry = lfcore.Geometry(pitch_m=0.006, delta=0.0)
    >>> options = lfcore.ReadOptions(views=(2, 1), geometry=geometry, fov_deg=40)
    >>> lfcore.import_lightfield("shots", "shots.mkv", options=options).metric
    True
    """
    check_suffix(path, (LIGHT_FIELD,))
    source, path, encoding = Path(source), Path(path), encoding or Encoding()
    grid = read_grid(source, format, options or ReadOptions())
    if encoding.codec == "ffv1" and encoding.pixel_format is None:
        encoding = replace(encoding, pixel_format="gbrp")
    if note := check_order(grid):
        grid = replace(grid, notes=(*grid.notes, note))
    make_folder(path.parent)
    spec = chosen_encoding(max(grid.columns, grid.rows), encoding, width=grid.width)
    store_grid(path, grid, spec, progress=progress)
    return LightField.open(path)


def store_grid(
    path: Path, grid: ViewGrid, spec: Encoding, *, progress: Progress | None = None
) -> Metadata:
    """Encode all views of ``grid``, one per frame, into the light field file ``path``."""
    content: dict = {"source": {"format": grid.format}}
    if grid.notes:
        content["source"]["notes"] = list(grid.notes)
    if grid.geometry.missing:
        known = {key: value for key, value in vars(grid.geometry).items() if value is not None}
        content["metric"] = False
        content["source"] |= known
    if grid.depth_m:
        content["depth_m"] = [float(depth) for depth in grid.depth_m]
    slab = grid.geometry.slab(grid.columns, grid.rows, grid.width, grid.height)
    return store_views(
        path, slab, grid.read, spec, name=grid.name, content=content, progress=progress
    )


def check_order(grid: ViewGrid) -> str | None:
    """A warning where rows and columns seem exchanged, or one of them reversed, by parallax.

    Points move against the camera: across from column to column, down from row to row, and by as
    much.  Optical flow from the middle view to its neighbours gives both movements; where they are
    strong their product is positive.
    """
    if max(grid.columns, grid.rows) < 2 or min(grid.width, grid.height) < 16:
        return None
    import cv2

    i, j = (grid.columns - 1) // 2, (grid.rows - 1) // 2
    middle = _grey(grid.read(i, j))
    flows = [
        cv2.calcOpticalFlowFarneback(middle, _grey(grid.read(*at)), None, 0.5, 3, 15, 3, 5, 1.2, 0)  # type: ignore[call-overload]
        if at[0] < grid.columns and at[1] < grid.rows
        else np.zeros((*middle.shape, 2))
        for at in ((i + 1, j), (i, j + 1))
    ]
    power = np.array([np.sum(flow.astype(np.float64) ** 2, (0, 1)) for flow in flows])
    along, aside = power.trace(), power.sum() - power.trace()
    if aside > MOST_ASIDE * along and aside > middle.size * LEAST_MOVED**2:
        return (
            "points move down from column to column, or across from row to row: rows and columns "
            "are exchanged, see --order"
        )
    across, down = (flow[..., axis] for axis, flow in enumerate(flows))
    both = math.sqrt(power[0, 0] * power[1, 1])
    if both > 1e-9 and np.sum(across * down) < -0.5 * both:
        return (
            "points move the other way from row to row than from column to column: the order of "
            "one of them is wrong"
        )
    return None


def _grey(picture: np.ndarray) -> np.ndarray:
    """A view of :class:`ViewGrid` in grey, (H, W) uint8."""
    most = {np.dtype(np.uint8): 255.0, np.dtype(np.uint16): 65535.0}.get(picture.dtype, 1.0)
    return (np.float32(picture).mean(-1) * np.float32(255 / most)).astype(np.uint8)

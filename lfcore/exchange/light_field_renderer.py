"""The names that light-field-renderer reads: ``name_i_j_-y_x``, and two more for parallel cameras.

Five words are a light slab, whose focal plane is not in the names; seven add focal length and
sensor width of parallel cameras, all in millimetres.
"""

from __future__ import annotations

from pathlib import Path

from lfcore.exchange import positions, stanford
from lfcore.exchange.exporting import WriteOptions
from lfcore.exchange.grid import ExchangeError, Geometry, ViewGrid
from lfcore.exchange.importing import ReadOptions
from lfcore.exchange.positions import Named
from lfcore.exchange.source import Source


def recognise(path: Path) -> bool:
    return bool(positions.named_pictures(path))


def read(path: Path, options: ReadOptions) -> ViewGrid:
    def geometry(one: Named, width: int) -> Geometry:
        if not one.more:
            return Geometry()
        focal, sensor = (value / 1e3 for value in one.more)
        if not (focal > 0 and sensor > 0):
            raise ExchangeError("its focal length or sensor is not positive", file=one.path)
        return Geometry(pixel_pitch=sensor / focal / width, delta=0.0, sensor_m=sensor)

    return stanford.read_named(path, path.name, geometry)


def write(source: Source, folder: Path, options: WriteOptions) -> None:
    more: tuple[float, ...] = ()
    if source.geometry is not None and source.geometry.delta == 0:
        geometry = source.geometry
        across = geometry.pixel_pitch * source.width
        sensor = geometry.sensor_m * source.width / max(source.width, source.height)
        more = (1e3 * sensor / across, 1e3 * sensor)
    elif source.geometry is not None:
        options.notes.append(
            f"the views coincide at {1 / source.geometry.delta:g} m, which these names cannot say"
        )
    stanford.write_named(source, folder, options, source.name, more)

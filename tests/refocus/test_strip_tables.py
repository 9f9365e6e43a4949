"""Runs of lens samples: each sample once, with its own offset, none across a strip's end."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import PlaneSums, offsets
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.refocus.strip_tables import (
    MOST_COLUMNS,
    STRIP,
    runs_of,
    strip_kinds,
    strip_tables,
    table_rows,
)


@settings(max_examples=60)
@given(
    positions=st.integers(1, 5),
    size=st.integers(1, 150),
    slope=st.floats(-1.5, 1.5),
    step=st.sampled_from([STRIP, MOST_COLUMNS]),
    whole=st.booleans(),
)
def test_runs_spell_out_the_offsets(positions, size, slope, step, whole):
    ramp = np.floor(np.arange(size)[None] * slope + np.arange(positions)[:, None] * 0.37)
    moves, each = ramp.astype(np.int32), size if whole else step
    starts, runs = runs_of(moves, step, each)
    lists = -(-size // each)
    assert len(starts) == positions * lists + 1 and starts[-1] == len(runs)
    for position in range(positions):
        spelt, at = [], 0
        for part in range(lists):
            first, last = starts[position * lists + part : position * lists + part + 2]
            for stop, offset in runs[first:last]:
                assert at < stop <= size
                assert at // step == (stop - 1) // step
                spelt += [offset] * (stop - at)
                at = stop
            assert at == min((part + 1) * each, size)
        assert spelt == moves[position].tolist()


@pytest.mark.parametrize("keep", [False, True])
def test_the_region_holds_every_target(keep):
    camera = Camera(0.05, 0.02, 2.0, 1.4)
    slab = Slab(camera, 40, 30)
    planes = [SensorPlane(d, 2.0, keep_magnification=keep) for d in (0.5, 2.0, 9.0)]
    tables = strip_tables(slab, planes, 4, 8, 20, 12)
    assert tables.order.tolist() == [0, 1, 2]
    for plane in planes:
        moves = offsets(slab, plane)
        x = np.arange(4, 20)[:, None] + (moves if len(moves) == 1 else moves[4:20])
        inside = x[(x >= 0) & (x < slab.pixels)]
        assert tables.left <= inside.min() and inside.max() < tables.left + tables.width


def test_kinds_by_hand():
    masks = np.zeros((1, 40, 40), np.uint8)
    masks[0, :, :16] = 255
    masks[0, 5, 20] = 255
    masks[0, 32:, 32:] = 255
    assert strip_kinds(masks)[0].tolist() == [[2, 1, 0], [2, 0, 1]]


def test_partial_planes_are_saved_whole_or_not_at_all(tmp_path, monkeypatch):
    slab = Slab(Camera(0.05, 0.02, 2.0, 1.4), 2, 2)
    sums = PlaneSums.zeros(slab, [SensorPlane(2.0, 2.0)])

    def fails(*args, **kwargs):
        raise OSError("no space left")

    monkeypatch.setattr(np, "savez", fails)
    with pytest.raises(OSError, match="no space"):
        sums.save(tmp_path / "tile.planes.npz")
    assert not list(tmp_path.iterdir())


def test_tables_have_the_rows_at_which_runs_of_their_mask_end():
    moves = [np.repeat([0, 1, 2], [10, 30, 5])[None], np.repeat([0, 3], [11, 34])[None]]
    runs = [runs_of(m, STRIP, STRIP)[1] for m in moves]
    ends = table_rows(np.array([0, 0]), runs, 45, 1)
    assert ends.shape == (1, 2, STRIP + 1)
    assert ends[0, 0, :4].tolist() == [3, 10, 11, 32]
    assert ends[0, 1, :3].tolist() == [2, 8, 13]
    assert runs[0].tolist() == [[1, 0], [3, 1], [1, 1], [2, 2]]
    assert runs[1].tolist() == [[2, 0], [3, 3], [2, 3]]
    apart = [runs_of(m, STRIP, STRIP)[1] for m in moves]
    assert table_rows(np.array([1, 0]), apart, 45, 2)[:, :, 0].tolist() == [[2, 1], [2, 2]]

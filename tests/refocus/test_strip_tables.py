"""Runs of lens samples: each sample once, with its own offset, none across a strip's end."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.refocus.strip_tables import MOST_COLUMNS, STRIP, runs_of


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

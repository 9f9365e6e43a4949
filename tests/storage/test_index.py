"""The index of a light field file against counting how often each element is in a tile."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from lfcore.storage.index import _covers


def counted(tiles, column, row, columns, rows):
    """Whether each element of a rectangle is in one tile, and no other element in any."""
    times = np.zeros((40, 40), int)
    for left, top, width, height in tiles:
        times[top : top + height, left : left + width] += 1
    wanted = np.zeros_like(times)
    wanted[row : row + rows, column : column + columns] = 1
    return np.array_equal(times, wanted)


cuts = st.sets(st.integers(1, 11), max_size=3).map(lambda inner: [0, *sorted(inner), 12])


@given(data=st.data(), column=st.integers(0, 5), row=st.integers(0, 5), across=cuts, down=cuts)
def test_tiles_that_cover_an_extent_once_are_told_from_others(data, column, row, across, down):
    extent = column, row, 12, 12
    tiles = data.draw(st.permutations([
        (column + left, row + top, right - left, bottom - top)
        for left, right in pairwise(across) for top, bottom in pairwise(down)
    ]))  # fmt: skip
    assert counted(tiles, *extent) and _covers(np.array(tiles), *extent)
    place = data.draw(st.integers(0, len(tiles) - 1))
    moved = list(tiles[place])
    moved[data.draw(st.integers(0, 3))] += data.draw(st.integers(1, 4))
    for wrong in (
        [*tiles[:place], *tiles[place + 1 :]],
        [*tiles, tiles[place]],
        [*tiles[:place], tuple(moved), *tiles[place + 1 :]],
    ):
        assert not counted(wrong, *extent)
        assert not _covers(np.array(wrong).reshape(-1, 4), *extent)

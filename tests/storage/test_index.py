"""The index of a light field file against counting how often each element is in a tile."""

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


@st.composite
def partitions(draw, column, row, columns, rows, cuts=4):
    """Rectangles that a rectangle is cut into, across or along, again and again."""
    sides = [side for side, size in (("across", rows), ("along", columns)) if size > 1]
    if not sides or not cuts or draw(st.booleans()):
        return [(column, row, columns, rows)]
    if draw(st.sampled_from(sides)) == "across":
        at = draw(st.integers(1, rows - 1))
        parts = (column, row, columns, at), (column, row + at, columns, rows - at)
    else:
        at = draw(st.integers(1, columns - 1))
        parts = (column, row, at, rows), (column + at, row, columns - at, rows)
    return [tile for part in parts for tile in draw(partitions(*part, cuts - 1))]


@given(data=st.data(), extent=st.tuples(*[st.integers(0, 5)] * 2, *[st.integers(1, 12)] * 2))
def test_tiles_that_cover_an_extent_once_are_told_from_others(data, extent):
    tiles = data.draw(st.permutations(data.draw(partitions(*extent))))
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

"""The kernels' tables reproduce targets and masks."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import targets
from lfcore.optics.plane_tables import BLOCK, RUN_WORDS, RUNS, lens_tables, view_tables
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab

CAMERA = Camera(0.05, 0.036, 2.0, 3.0)


def unpack(record: np.ndarray, columns: int) -> np.ndarray:
    """The targets of a beam's columns that one run record stands for."""
    out = np.full(columns, 1 << 30, np.int64)
    for target, start, end in record["run"][: record["count"]]:
        part = out[start:end]
        assert len(part) and (part == 1 << 30).all(), "runs do not overlap"
        part[:] = target
    return out


shapes = st.sampled_from([(4, 1), (2, 2), (1, 3), (1, 4)])


planes = st.lists(
    st.builds(
        SensorPlane,
        focus_m=st.sampled_from([0.4, 1.0, 3.0, 20.0]),
        f_number=st.sampled_from([2.0, 4.0, 8.0]),
        aperture=st.sampled_from(["circle", "square"]),
        keep_magnification=st.booleans(),
        pixels=st.sampled_from([None, 1, 2]),
    ),
    min_size=1,
    max_size=5,
)


@given(planes, st.integers(1, 20), st.integers(2, 10), shapes)
@settings(max_examples=40)
def test_lens_tables_reproduce_targets_and_masks(chosen, views, pixels, shape):
    slab, (group, side) = Slab(CAMERA, views, pixels), shape
    whole = max(plane.side(slab) for plane in chosen) if chosen else pixels
    u0, v0, u1, v1 = 0, pixels // 2, pixels // 2 + 1, pixels
    tables = lens_tables(slab, chosen, (u0, v0, u1, v1), group, side)
    assert sorted(tables.order.tolist()) == list(range(len(chosen)))
    assert (np.diff(tables.info["mask"]) >= 0).all(), "planes of one mask are neighbours"
    squares = -(-views // (side * BLOCK))
    for row, index in enumerate(tables.order):
        plane, (mask, offset, per_cell) = chosen[index], tables.info[row]
        np.testing.assert_array_equal(tables.masks[mask, :views, :views] > 0, plane.mask(slab))
        assert tables.masks[mask].sum() == 255 * plane.mask(slab).sum(), "padded with closed"
        assert tables.masks.shape[1:] == (squares * side * BLOCK,) * 2
        columns = targets(slab, plane)
        for u in range(pixels):
            cell, within = divmod(u, group)
            start = offset + cell * per_cell * RUN_WORDS
            records = tables.runs[start : start + squares * RUN_WORDS].view(RUNS)
            found = [unpack(r, group * side * BLOCK).reshape(group, -1)[within] for r in records]
            np.testing.assert_array_equal(cell * group + np.concatenate(found)[:views], columns[u])
        for span, low, size in (
            (columns[u0:u1], tables.left, tables.width),
            (columns[v0:v1], tables.top, tables.height),
        ):
            reached = span[(span >= 0) & (span < whole)]
            assert ((reached >= low) & (reached < low + size)).all(), "outside the region"


@given(planes, st.integers(1, 12), st.integers(1, 8))
@settings(max_examples=40)
def test_view_tables_reproduce_targets(chosen, views, pixels):
    slab = Slab(CAMERA, views, pixels)
    tables = view_tables(slab, chosen)
    for row, index in enumerate(tables.order):
        offset = tables.info[row]["runs"]
        table = tables.runs[offset : offset + views * pixels].reshape(views, pixels)
        np.testing.assert_array_equal(table.T, targets(slab, chosen[index]))
        mask = tables.masks[tables.info[row]["mask"]]
        np.testing.assert_array_equal(mask > 0, chosen[index].mask(slab))

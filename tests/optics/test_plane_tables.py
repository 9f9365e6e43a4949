"""The kernels' tables reproduce targets and masks."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import targets
from lfcore.optics.plane_tables import (
    BLOCK,
    RUN_WORDS,
    block_kinds,
    lens_tables,
    run_records,
    view_tables,
)
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab

CAMERA = Camera(0.05, 0.036, 2.0, 3.0)


def unpack(record: np.ndarray) -> np.ndarray:
    """The 16 offsets that one run record stands for."""
    out = np.full(BLOCK, 1 << 30, np.int64)
    for run in range(record[0]):
        out[record[1 + run] : record[2 + run]] = record[18 + run]
    return out


@given(st.integers(1, 3), st.integers(1, 40), st.integers(0, 4), st.randoms())
def test_run_records_reproduce_offsets(positions, views, spread, random):
    offsets = np.array(
        [sorted(random.randint(-spread, spread) for _ in range(views)) for _ in range(positions)],
        np.int32,
    )
    records = run_records(offsets)
    blocks = -(-views // BLOCK)
    assert records.shape == (positions, blocks, RUN_WORDS)
    for position in range(positions):
        flat = np.concatenate([unpack(record) for record in records[position]])
        np.testing.assert_array_equal(flat[:views], offsets[position])
        # Runs are maximal: neighbours differ.
        for record in records[position]:
            assert (np.diff(record[18 : 18 + record[0]]) != 0).all()
            assert record[1] == 0 and record[1 + record[0]] == BLOCK


@given(st.integers(1, 40), st.floats(2.0, 40.0))
@settings(deadline=None)
def test_block_kinds_by_counting(views, f_number):
    mask = SensorPlane(3.0, f_number).mask(Slab(CAMERA, views, 2))
    kinds = block_kinds(mask[None].astype(np.uint8) * 255)
    for (row, column), kind in np.ndenumerate(kinds[0]):
        cell = mask[row * BLOCK : (row + 1) * BLOCK, column * BLOCK : (column + 1) * BLOCK]
        whole = cell.sum() == BLOCK * BLOCK
        assert kind == (2 if whole else 1 if cell.any() else 0)


planes = st.lists(
    st.builds(
        SensorPlane,
        focus_distance_m=st.sampled_from([0.4, 1.0, 3.0, 20.0]),
        f_number=st.sampled_from([2.0, 4.0, 8.0]),
        shape=st.sampled_from(["circle", "square"]),
        keep_magnification=st.booleans(),
    ),
    min_size=1,
    max_size=5,
)


@given(planes, st.integers(1, 20), st.integers(2, 10))
@settings(deadline=None, max_examples=40)
def test_lens_tables_reproduce_targets_and_masks(chosen, views, pixels):
    slab = Slab(CAMERA, views, pixels)
    u0, v0, u1, v1 = 0, pixels // 2, pixels // 2 + 1, pixels
    tables = lens_tables(slab, chosen, u0, v0, u1, v1)
    assert sorted(tables.order.tolist()) == list(range(len(chosen)))
    assert (np.diff(tables.info[:, 0]) >= 0).all(), "planes of one mask are neighbours"
    for row, index in enumerate(tables.order):
        plane, (mask, offset, per_pixel, _) = chosen[index], tables.info[row]
        np.testing.assert_array_equal(tables.masks[mask] > 0, plane.mask(slab))
        columns = targets(slab, plane)
        for u in range(pixels):
            start = offset + u * per_pixel * RUN_WORDS
            records = tables.runs[start : start + tables.blocks * RUN_WORDS]
            flat = np.concatenate([unpack(r) for r in records.reshape(-1, RUN_WORDS)])[:views]
            np.testing.assert_array_equal(u + flat, columns[u])
        for span, low, size in (
            (columns[u0:u1], tables.left, tables.width),
            (columns[v0:v1], tables.top, tables.height),
        ):
            reached = span[(span >= 0) & (span < pixels)]
            assert ((reached >= low) & (reached < low + size)).all(), "outside the region"


@given(planes, st.integers(1, 12), st.integers(1, 8))
@settings(deadline=None, max_examples=40)
def test_view_tables_reproduce_targets(chosen, views, pixels):
    slab = Slab(CAMERA, views, pixels)
    tables = view_tables(slab, chosen)
    for row, index in enumerate(tables.order):
        offset = tables.info[row, 1]
        table = tables.runs[offset : offset + views * pixels].reshape(views, pixels)
        np.testing.assert_array_equal(table.T, targets(slab, chosen[index]))
        mask = tables.masks[tables.info[row, 0]]
        np.testing.assert_array_equal(mask > 0, chosen[index].mask(slab))

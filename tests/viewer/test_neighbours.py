"""Views as differences from their neighbours: what the page undoes is what was coded."""

import json
import shutil
import subprocess
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import lfcore.viewer.page as viewer_page
from lfcore.viewer.atlas import encode
from lfcore.viewer.neighbours import TOLERANCE, Neighbours

FOLDER = Path(viewer_page.__file__).parent
SIZE = 40, 30
NEAR, FAR = 3.2, -1.3


def two_planes(columns: int, rows: int) -> tuple[Neighbours, np.ndarray, np.ndarray]:
    """A square before a wall, both textured, with displaced pixels: grid, colours, disparities."""
    s, t = np.arange(columns) - 1.25, 1.5 * np.arange(rows) - 2
    displaced = np.random.default_rng(3).uniform(-0.5, 0.5, (columns * rows, 2)).round(6)
    step, (width, height) = 0.4, SIZE
    grid = Neighbours(s, t, displaced, FAR, step, round((NEAR - FAR) / step) + 1)
    places = np.stack(np.meshgrid(s, t), -1).reshape(-1, 2)
    y, x = np.mgrid[:height, :width]
    colours, disparities = [], []
    for place, moved in zip(places, displaced, strict=True):
        here = np.stack([x + moved[0] - width / 2, y + moved[1] - height / 2])
        square, wall = (here + place[:, None, None] * d for d in (NEAR, FAR))
        within = np.abs(square).max(0) < 8
        waves = [
            0.5 + 0.2 * np.sin(0.3 * at[0] + phase) + 0.2 * np.cos(0.2 * at[1])
            for at, phase in ((square, 0), (wall, 2))
        ]
        shown = np.where(within, *waves)[..., None] * np.where(within[..., None], [1, 0.8, 0.3], 1)
        colours.append(np.rint(255 * shown).astype(np.uint8))
        disparities.append(np.where(within, NEAR, FAR))
    return grid, np.stack(colours), np.stack(disparities)


def coded(
    grid: Neighbours, colours: np.ndarray, codes: np.ndarray, form: str, quality: int, gain: int
):
    """Levels, with the atlas of each."""
    coding, levels = partial(encode, format=form, jpeg_quality=quality), grid.levels()
    return list(
        zip(levels, grid.coded_colours(colours, codes, coding, gain, levels)[0], strict=True)
    )


def undone(grid: Neighbours, levels, differences: np.ndarray, gain: int):
    """Codes and colours as lfcore/viewer/neighbours.js makes them."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("no node: the page's arithmetic is not run outside the browser")
    width, height = SIZE
    shape = len(differences), height, width, 3
    field = {
        "columns": grid.columns.tolist(),
        "rows": grid.rows.tolist(),
        **dict(zip(("width", "height"), SIZE, strict=True)),
    }
    depth = {
        "codes": grid.codes,
        "low": grid.low,
        "step": grid.step,
        "displaced": grid.displaced.tolist(),
    }
    given = [
        [view, other, differences[view].ravel().tolist(),
         np.pad(picture, ((0, 0), (0, 0), (0, 1))).ravel().tolist()]
        for level, atlas in levels
        for one, picture in zip(level, atlas.decoded((len(level), *shape[1:])), strict=True)
        for view, other in [one]
    ]  # fmt: skip
    program = (
        (FOLDER / "neighbours.js").read_text()
        + f"""
        const field = {json.dumps(field)}, depth = {json.dumps(depth)}, codes = [], shown = [];
        for (const [view, other, differences, colours] of {json.dumps(given)}) {{
          codes[view] = Uint8Array.from(differences);
          shown[view] = Uint8ClampedArray.from(colours);
          if (view === other) continue;
          let move = apart(field, depth, other, view, 1);
          addDepth(codes[view], codes[other], move, depth.codes, field);
          move = apart(field, depth, view, other, PARTS);
          addColours(shown[view], shown[other], codes[view], move, {gain}, field);
        }}
        const lists = (all) => all.map((one) => Array.from(one));
        console.log(JSON.stringify([lists(codes), lists(shown)]));
    """
    )
    done = subprocess.run([node, "-"], input=program, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    codes, shown = (np.array(each, np.uint8) for each in json.loads(done.stdout))
    return codes.reshape(shape[:3]), shown.reshape(*shape[:3], 4)[..., :3]


@pytest.mark.parametrize(("columns", "rows"), [(4, 4), (3, 5), (1, 2)])
def test_the_page_undoes_what_was_coded(columns, rows):
    grid, colours, disparities = two_planes(columns, rows)
    codes, differences = grid.coded_depth(disparities)
    assert np.abs(grid.low + grid.step * codes - disparities).max() <= TOLERANCE * grid.step
    levels = coded(grid, colours, codes, "webp", 100, 1)
    assert sorted(view for level, _ in levels for view, _ in level) == list(range(columns * rows))
    found, shown = undone(grid, levels, differences, 1)
    np.testing.assert_array_equal(found, codes)
    np.testing.assert_array_equal(shown, colours)


def test_errors_do_not_add_up():
    """Of a lossy code, some neighbours from the first view: the sum would be larger."""
    grid, colours, disparities = two_planes(5, 3)
    codes, differences = grid.coded_depth(disparities)
    levels = coded(grid, colours, codes, "jpeg", 85, 2)
    _, shown = undone(grid, levels, differences, 2)
    error = np.square(shown.astype(float) - colours).mean((1, 2, 3))
    near, far = ([error[view] for view, _ in levels[k][0]] for k in (1, -1))
    assert max(far) < 2.5 * np.mean(near)


def test_most_depths_are_as_predicted():
    grid, _, disparities = two_planes(4, 4)
    _, differences = grid.coded_depth(disparities)
    first = grid.levels()[0][0][0]
    others = np.delete(differences, first, 0)
    assert (others > 0).mean() < 0.05

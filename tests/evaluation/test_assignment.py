"""The assignment's arrays: a scene's own, or a grid of the configuration; its lens formulas."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lfcore.errors import SceneError
from lfcore.evaluation.assignment.arrays import array_of
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.optics.lens_system import LensSystem
from lfcore.scene.view import lightfield_view

GRID = {"bounds_m": [-1, 1, -2, 2], "fov_deg": 40}
LENS = Path(__file__).parents[2] / "scenes" / "lenses" / "double_gauss.dat"


def scene(**changes):
    return bare_scene(np.zeros((0, 3, 3)), **changes)


def test_a_scene_without_an_array_takes_the_grid():
    array = array_of(scene(), GRID, 4, 32)
    assert array.cameras == (4, 4) and array.tile == (32, 32) and array.fov_deg == 40
    assert (array.columns_m[0], array.rows_m[0]) == (-1, -2)


def test_a_scene_s_own_array_goes_first():
    own = scene(view=lightfield_view((60, 40), 50.0, (6, 4)))
    for grid in (None, GRID):
        assert array_of(own, grid, 16, None) == own.view.array
    assert array_of(own, None, 16, 32) == replace(own.view.array, tile=(32, 32))


def test_no_array_at_all():
    with pytest.raises(SceneError, match=r"has no camera array.*assignment\.arrays"):
        array_of(scene(), None, 16, 64)


def test_a_lens_stopped_down_has_a_larger_f_number():
    lens = LensSystem.read(LENS).focused(math.inf)
    stop = 2 * float(lens.aperture_m[lens.radius_m == 0][0])
    half, quarter = (lens.stopped_down(stop / part).working_f_number for part in (2, 4))
    assert quarter == pytest.approx(2 * half, rel=0.05)
    # Wide open other surfaces cut the cone, so that closing by one stop closes less.
    assert lens.working_f_number < half < 2 * lens.working_f_number

"""Pictures of floors below area lights of pbrt scenes, against closed forms: nothing of an emitter
is lost in its own shadow."""

import numpy as np
import pytest

from benchmarks.area_lights import EMITTERS, floors
from lfcore.scene.emitters import POINTS

pytestmark = pytest.mark.kernels


@pytest.mark.parametrize("emitter", EMITTERS)
def test_a_floor_is_lit_to_two_percent(emitter):
    seen, truth = floors(emitter, POINTS)
    assert truth.max() > 20 * truth.min()
    assert np.abs(seen / truth[..., None] - 1).max() < 0.02

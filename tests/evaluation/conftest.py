"""A tracer of the chart, for tests of what is made from its rays."""

import numpy as np
import pytest
from matplotlib.figure import Figure
from plain_scenes import CHART

from lfcore import Lattice, SensorPlane, open_device
from lfcore.evaluation.true_picture import true_pictures
from lfcore.readers.load import load_scene
from lfcore.rendering.prepared import open_tracer


@pytest.fixture(scope="session")
def chart():
    """The chart's tracer, of one thread."""
    return open_tracer(load_scene(CHART, bare=True), open_device(threads=1))


@pytest.fixture(scope="session")
def reference(chart):
    """The true pictures of two planes of the chart, 24 pixels per side."""
    camera = chart.scene.camera
    planes = [SensorPlane(focus, camera.f_number) for focus in (1.0, camera.focus_m)]
    return true_pictures(chart, planes, 24, (Lattice(10, 3), Lattice(8, 4)))


@pytest.fixture
def drawn(monkeypatch):
    """The figures that were written, in order: what they show can be asked of them."""
    written, write = [], Figure.savefig
    keep = lambda figure, *args, **more: (written.append(figure), write(figure, *args, **more))  # noqa: E731
    monkeypatch.setattr(Figure, "savefig", keep)
    return written


@pytest.fixture
def shows():
    """A function: whether an axis has lines through all these points, (K, 2)."""

    def shows(axis, points) -> bool:
        drawn = np.concatenate([np.asarray(line.get_xydata(), float) for line in axis.lines])
        near = np.isclose(np.asarray(points, float)[:, None], drawn, rtol=1e-6).all(-1)
        return bool(len(points)) and bool(near.any(1).all())

    return shows

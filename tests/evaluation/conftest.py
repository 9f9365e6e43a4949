"""A tracer of the chart, for tests of what is made from its rays."""

from pathlib import Path

import pytest

from lfcore.opencl.device import open_device
from lfcore.scene.build import build_scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

CHART = Path(__file__).parents[2] / "scenes" / "chart"


@pytest.fixture(scope="session")
def chart():
    """The chart's tracer, of one thread."""
    scene = build_scene(CHART)
    return Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))

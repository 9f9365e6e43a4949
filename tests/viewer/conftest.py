"""A light field file of two planes, and its page."""

from __future__ import annotations

import pytest
from two_planes import FAR, NEAR, PIXELS, SLAB, VIEWS, two_planes

from lfcore.lightfield import LightField
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.ycbcr import frames_from_rgb


@pytest.fixture(scope="session")
def field(tmp_path_factory):
    folder = tmp_path_factory.mktemp("viewer")
    layout = FrameLayout("views", VIEWS, PIXELS, pixel_format="gbrp")
    tile = layout.tile(0, 0, VIEWS, VIEWS)
    pictures = two_planes()
    step = SLAB.pixel_pitch / SLAB.lens_pitch_m
    depths = [1 / (SLAB.camera.delta + disparity * step) for disparity in (NEAR, FAR)]
    spec = Encoding("ffv1", "gbrp")
    with SegmentWriter(folder / "0.mp4", spec, PIXELS, PIXELS) as writer:
        for i, j in tile.elements():
            writer.write(frames_from_rgb(pictures[j, i][None], "gbrp"))
    join_segments(
        folder / "lf.mkv", [folder / "0.mp4"], [tile], layout, geometry=SLAB,
        scene={"name": "<two> & planes", "digest": "0"}, spec=spec, content={"depth_m": depths},
    )  # fmt: skip
    return LightField.open(folder / "lf.mkv")


@pytest.fixture(scope="session")
def page(field, tmp_path_factory):
    """Path of the page; its views are stored without loss."""
    path = tmp_path_factory.mktemp("page") / "lf.html"
    field.viewer(form="webp", quality=100).save(path)
    return path

"""A light field file of two planes, and its page."""

from functools import partial

import pytest
from stored_fields import tile_frames, write_field
from two_planes import FAR, NEAR, PIXELS, SLAB, VIEWS, two_planes
from viewer_browser import chromium

from lfcore import LightField
from lfcore.storage.layout import FrameLayout


@pytest.fixture(scope="session")
def browser(tmp_path_factory):
    """One for all pages."""
    with chromium(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture(scope="session")
def field(tmp_path_factory):
    file = tmp_path_factory.mktemp("viewer") / "lf.mkv"
    layout = FrameLayout("views", VIEWS, PIXELS, pixel_format="gbrp")
    step = SLAB.pixel_pitch / SLAB.lens_pitch_m
    depths = [1 / (SLAB.camera.delta + disparity * step) for disparity in (NEAR, FAR)]
    write_field(
        file, SLAB, layout, partial(tile_frames, two_planes()), scene="<two> & planes",
        content={"depth_m": depths},
    )  # fmt: skip
    return LightField.open(file)


@pytest.fixture(scope="session")
def page(field, tmp_path_factory):
    """Path of the page; its views are stored without loss."""
    path = tmp_path_factory.mktemp("page") / "lf.html"
    field.viewer(format="webp", jpeg_quality=100).save(path)
    return path

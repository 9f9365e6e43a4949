"""The reader beside docs/format.md, which knows PyAV and numpy alone, against LightField."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from lfcore import Encoding, FrameLayout, LightField
from lfcore.colour import display_values

READER = Path(__file__).parents[2] / "docs/examples/read_light_field.py"
read = runpy.run_path(str(READER))["read"]


@pytest.mark.parametrize(
    ("layout", "codec"),
    [
        (FrameLayout("views", 3, 20, "serpentine", 1, "yuv444p"), "libx264"),
        (FrameLayout("views", 5, 17, "hilbert", 2, "yuv420p"), "libx264"),
        (FrameLayout("macropixels", 5, 18, "hilbert", 4, "yuv444p10le"), "libx264"),
        (FrameLayout("macropixels", 6, 9, "raster", 2, "gbrp"), "ffv1"),
        (FrameLayout("views", 3, 20, "raster", 1, "yuv420p12le"), "ffv1"),
    ],
)
def test_the_small_reader_reads_what_the_library_reads(tmp_path, make_store, layout, codec):
    stored = make_store(tmp_path, layout, Encoding(codec, layout.pixel_format, crf=20))
    about, rays = read(stored.path)
    n, m = layout.views, layout.pixels
    assert rays.shape == (n, n, m, m, 3) and about["layout"] == layout.to_json()
    expected = LightField.open(stored.path).views(0, 0, n, n, codes=True)
    assert np.abs(np.rint(255 * rays) - expected).max() <= 1


@pytest.mark.parametrize(
    ("name", "version", "size", "mean"),
    [
        ("2026-11-21", 1, (16, 16), 79.9),
        ("content", 1, (16, 16), 80.4),
        ("depth", 1, (32, 32), 83.4),
        ("wide", 2, (32, 16), 75.7),
    ],
)
def test_files_of_earlier_programs_open(name, version, size, mean):
    """Written by the first program, the first with ``content``, with ``depth``, and wide.

    ``mean`` is that of the codes of the picture that this program made of the file.
    """
    field = LightField.open(Path(__file__).parent / "earlier" / f"{name}.mkv")
    field.verify()
    about, rays = read(field.path)
    expected = field.views(0, 0, *field.grid, codes=True)
    assert np.abs(np.rint(255 * rays) - expected).max() <= 1
    assert about["version"] == version and field.picture_size == size
    assert (field.depth_video is not None) == (name == "depth")
    assert abs(display_values(field.refocus()).mean() - mean) < 0.3

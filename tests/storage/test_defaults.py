"""Defaults: usable at every N, and as good as they claim on a light field of known content."""

import numpy as np
import pytest

from lfcore.errors import StorageError
from lfcore.storage.defaults import chosen_encoding, default_kind, default_pack, macropixel_pack
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile


@pytest.mark.parametrize("views", [1, 2, 15, 16, 32, 64, 65, 128, 256, 512, 4096])
def test_every_number_of_views_has_defaults(views):
    spec = chosen_encoding(views)
    layout = FrameLayout(
        default_kind(views), views, 512, pack=default_pack(views), pixel_format=spec.pixel_format
    )
    assert layout.frame_width >= 65
    assert default_kind(views) == ("macropixels" if views > 32 else "views")
    assert default_kind(views, 128) == ("macropixels" if views > 8 else "views")
    assert default_pack(views, 128) == (1 if views <= 8 else max(1, min(8, 128 // views)))
    small = FrameLayout("macropixels", views, 512, pack=macropixel_pack(views))
    assert small.frame_width <= max(128, views)


def test_no_frame_is_far_from_a_key_frame():
    for views in (1, 16, 64, 512):
        assert 0 < chosen_encoding(views).gop <= 128


def test_impossible_views_are_refused():
    for call in (default_kind, default_pack, chosen_encoding, macropixel_pack):
        with pytest.raises(StorageError, match="positive"):
            call(0)


@pytest.mark.parametrize("views, pixels", [(8, 64), (128, 4)])
def test_a_smooth_light_field_keeps_its_colours(tmp_path, make_store, views, pixels):
    spec = chosen_encoding(views)
    layout = FrameLayout(default_kind(views, pixels), views, pixels, pixel_format=spec.pixel_format)
    stored = make_store(tmp_path, layout, spec)
    found = LightFieldFile.open(stored.path).rectangle(0, 0, pixels, pixels, codes=True) / 255
    means = found.mean((2, 3)) - stored.field.mean((0, 1))
    assert -10 * np.log10(np.mean(means**2)) > 40

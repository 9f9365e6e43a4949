"""Defaults: usable at every N, and as good as they claim on a light field of known content."""

import numpy as np
import pytest

from lfcore import FrameLayout, StorageError
from lfcore.storage.defaults import chosen_encoding, default_kind, default_pack, macropixel_pack
from lfcore.storage.lightfield import LightFieldFile


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

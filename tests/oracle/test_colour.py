"""Colour formulas against the standards' own numbers."""

import numpy as np
import pytest

from lfcore.oracle.colour import srgb_decode, srgb_encode, ycbcr


def test_srgb_values():
    assert srgb_decode(0.5) == pytest.approx(0.2140411, abs=1e-7)
    assert srgb_encode(0.18) == pytest.approx(0.4613561, abs=1e-7)
    assert srgb_encode([0, 1]) == pytest.approx([0, 1])
    assert srgb_encode(0.001) == pytest.approx(0.01292)
    # The two branches meet to the accuracy of the standard's rounded constants.
    assert srgb_encode(0.0031308 + 1e-12) == pytest.approx(srgb_encode(0.0031308), abs=1e-6)


@pytest.mark.parametrize(
    "colour, codes",
    [
        ((0, 0, 0), (16, 128, 128)),
        ((1, 1, 1), (235, 128, 128)),
        ((1, 0, 0), (62.5594, 102.33585, 240)),
        ((0, 0, 1), (31.8118, 240, 117.73025)),
        ((0, 1, 0), (172.6288, 41.66415, 26.26975)),
    ],
)
def test_bt709_codes(colour, codes):
    assert ycbcr(colour) == pytest.approx(codes, abs=1e-4)
    assert ycbcr(colour, bits=10) == pytest.approx(4 * np.array(codes), abs=4e-4)

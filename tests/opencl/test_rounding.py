"""Each operation is rounded once, and none is contracted: what equal bits everywhere rest on."""

from pathlib import Path

import numpy as np
import pytest

from lfcore.opencl.device import cl, open_device
from lfcore.opencl.programs import build_program

pytestmark = pytest.mark.kernels

FILE = str(Path(__file__).with_name("rounding.cl"))
STEP = 1 << 22


def run(device, lanes, name, inputs):
    """The kernel's three results (each of the inputs' size) at a lane width."""
    wide = open_device(device.name, lanes=lanes)
    kernel = cl.Kernel(build_program(wide, [FILE]), name)
    size = inputs[0].size
    outputs = [wide.empty(4 * size) for _ in range(3)]
    kernel(wide.queue, (size // lanes,), None, *map(wide.buffer, inputs), *outputs)
    found = [np.empty(size, np.float32) for _ in outputs]
    for array, buffer in zip(found, outputs, strict=True):
        cl.enqueue_copy(wide.queue, array, buffer)
    return found


@pytest.mark.parametrize("lanes", [1, 4, 8, 16])
def test_every_mantissa_is_rounded_correctly(device, lanes):
    """All floats in [1, 4), of which others are multiples by powers of 4; quotients of random ones.

    numpy's own division and square root are the processor's, which IEEE 754 has rounded.
    """
    rng = np.random.default_rng(0)
    for start in range(0, 2 << 23, STEP):
        x = (np.arange(start, start + STEP, dtype=np.uint32) + (127 << 23)).view(np.float32)
        y = rng.integers(0, 255 << 23, STEP, dtype=np.uint32).view(np.float32)
        found = run(device, lanes, "round_all", [x, y])
        for expected, array in zip((1 / x, np.sqrt(x), y / x), found, strict=True):
            assert array.tobytes() == expected.tobytes()


@pytest.mark.parametrize("lanes", [1, 4, 8, 16])
def test_products_keep_subnormal_numbers_and_are_rounded_before_a_sum(device, lanes):
    """Contracted, the sum of a product and its negative would be the product's rounding."""
    rng = np.random.default_rng(1)
    x, y = rng.integers(40 << 23, 150 << 23, (2, STEP), dtype=np.uint32).view(np.float32)
    expected = x * y
    tiny = np.abs(expected) < np.finfo(np.float32).smallest_normal
    assert 0.05 < tiny.mean() < 0.5 and expected[tiny].any()
    product, difference, fused = run(device, lanes, "multiply_add", [x, y, -expected])
    assert product.tobytes() == expected.tobytes()
    assert not difference.any()
    exact = x.astype(np.float64) * y - expected  # of 48 bits, less the upper 24
    assert fused.tobytes() == exact.astype(np.float32).tobytes()

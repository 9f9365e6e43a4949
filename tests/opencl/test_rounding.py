"""Division and square root are rounded correctly: what the same bits on every processor rest on."""

from pathlib import Path

import numpy as np
import pytest

from lfcore.opencl.device import build_program, cl, open_device

pytestmark = pytest.mark.kernels

FILE = str(Path(__file__).with_name("rounding.cl"))
STEP = 1 << 22


@pytest.mark.parametrize("lanes", [1, 4, 8, 16])
def test_every_mantissa_is_rounded_correctly(device, lanes):
    """All floats in [1, 4), of which others are multiples by powers of 4; quotients of random ones.

    numpy's own division and square root are the processor's, which IEEE 754 has rounded.
    """
    wide = open_device(device.device.name, lanes=lanes)
    kernel = cl.Kernel(build_program(wide, [FILE]), "round_all")
    rng = np.random.default_rng(0)
    outputs = [wide.empty(4 * STEP) for _ in range(3)]
    for start in range(0, 2 << 23, STEP):
        x = (np.arange(start, start + STEP, dtype=np.uint32) + (127 << 23)).view(np.float32)
        y = rng.integers(0, 255 << 23, STEP, dtype=np.uint32).view(np.float32)
        kernel(wide.queue, (STEP // lanes,), None, wide.buffer(x), wide.buffer(y), *outputs)
        for expected, buffer in zip((1 / x, np.sqrt(x), y / x), outputs, strict=True):
            found = np.empty_like(x)
            cl.enqueue_copy(wide.queue, found, buffer)
            assert found.tobytes() == expected.tobytes()

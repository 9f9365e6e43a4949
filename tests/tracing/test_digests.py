"""Every processor, lane width and instruction set gives the bits of the committed table."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from digests import CASES, TABLE, digest, table

from lfcore import open_device

pytestmark = pytest.mark.kernels

KNOWN = json.loads(TABLE.read_text(encoding="utf-8"))

FEW = [
    "fine: hits, N = 4",
    "fine: single rays",
    "lit: frames and planes, N = 4",
    "textured: a file with depth",
]
"""Cases that together take most kinds of arithmetic, for what builds programs of its own."""


def test_the_table_has_all_cases():
    assert list(KNOWN) == [f"{world}: {name}" for world, name in CASES]
    assert len(set(KNOWN.values())) == len(KNOWN)


@pytest.mark.parametrize(("world", "name"), CASES)
def test_this_device_gives_the_bits_of_the_table(device, world, name):
    if not device.is_cpu:
        pytest.skip("promised for processors alone")
    assert digest(world, name, device) == KNOWN[f"{world}: {name}"]


@pytest.mark.parametrize("turn", range(3))
def test_the_other_lane_widths_give_them(device, turn):
    """Each case at one of them, by turns: all at each are 40 programs, of which 20 show as much."""
    if not device.is_cpu:
        pytest.skip("a GPU has one lane width")
    lanes = sorted({1, 4, 8, 16} - {device.lanes})[turn]
    chosen = list(KNOWN)[turn::3]
    assert table(open_device(device.name, lanes=lanes), chosen) == {k: KNOWN[k] for k in chosen}


def test_a_processor_without_avx512_gives_them(tmp_path):
    """What runs is held to AVX2: OpenCL programs, numpy, its linear algebra and OpenCV."""
    found = np.show_config("dicts")["SIMD Extensions"]["found"]
    wide = [name for name in found if name.startswith(("AVX512", "X86_V4"))]
    if not wide:
        pytest.skip("this processor has no AVX-512: the other tests are held to AVX2 as they are")
    held = {
        "CL_CONFIG_CPU_TARGET_ARCH": "core-avx2",
        "NPY_DISABLE_CPU_FEATURES": " ".join(wide),
        "OPENBLAS_CORETYPE": "Haswell",
        "OPENCV_CPU_DISABLE": "AVX512-SKX",
        "XDG_CACHE_HOME": str(tmp_path),
        "PYTHONPATH": str(TABLE.parents[1]),
    }
    chosen = [word for case in FEW for word in ("--case", case)]
    command = [sys.executable, str(Path(__file__).with_name("digests.py")), *chosen]
    found = subprocess.run(command, env={**os.environ, **held}, capture_output=True, check=True)
    assert json.loads(found.stdout) == {case: KNOWN[case] for case in FEW}

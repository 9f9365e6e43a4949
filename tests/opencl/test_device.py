"""Devices by name and what they refuse; programs that are built once a process."""

import numpy as np
import pytest

from lfcore.errors import DeviceError
from lfcore.opencl.device import build_program, cl, open_device

FILE = "tracing/kernels/simd/lanes.cl"


def test_a_device_is_chosen_by_part_of_its_name(device):
    assert open_device(device.name[1:-1].upper()).name == device.name
    with pytest.raises(DeviceError, match=r"named like 'abacus'.*Found: .*"):
        open_device("abacus")


def test_threads_are_at_most_what_there_is_and_lanes_a_width_of_rows(device):
    name = device.name
    assert open_device(name, threads=1).threads == 1
    assert open_device(name, threads=10**6).threads == open_device(name).threads
    assert open_device(name, lanes=4).lanes == 4
    with pytest.raises(DeviceError, match="not 3"):
        open_device(name, lanes=3)


@pytest.mark.parametrize("text", ["abc", "-1", "1.5", "٣"])
def test_a_number_of_threads_that_is_none_is_said(device, monkeypatch, text):
    monkeypatch.setenv("LFCORE_THREADS", text)
    with pytest.raises(DeviceError, match=r"LFCORE_THREADS: must be a number.*Set this"):
        open_device(device.name)
    monkeypatch.setenv("LFCORE_THREADS", "")
    assert open_device(device.name).threads == device.threads


def test_a_program_is_built_once_for_each_set_of_options(device):
    name = device.name
    again, narrow = open_device(name), open_device(name, lanes=1)
    assert again.queue != device.queue, "threads must not share a queue"
    assert build_program(device, [FILE]) is build_program(again, [FILE])
    assert build_program(device, [FILE], {"X": 1}) is not build_program(device, [FILE])
    assert build_program(narrow, [FILE]) is not build_program(open_device(name, lanes=4), [FILE])


def test_what_cannot_be_built_says_why(device):
    with pytest.raises(DeviceError, match=r"cannot build .*lanes\.cl: .*float5.*Update") as refused:
        build_program(device, [FILE], {"LANES": 5})
    assert device.device.driver_version.strip() in str(refused.value)
    assert len(str(refused.value.__cause__)) > len(str(refused.value))


@pytest.mark.parametrize("nbytes", [0, 8, 5000])
def test_a_buffer_of_zeros_is_read_as_it_is_filled(device, nbytes):
    buffer, count = device.zeros(nbytes), max(nbytes, 64) // 8
    with device.mapped(buffer, (count,), np.uint64) as held:
        assert (held == 0).all()
    changed = np.arange(count, dtype=np.uint64)
    cl.enqueue_copy(device.queue, buffer, changed)
    with device.mapped(buffer, (count,), np.uint64) as held:
        assert (held == changed).all()

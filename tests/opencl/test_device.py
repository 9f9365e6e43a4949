"""Devices by name, programs built once a process, and what differs on Windows and macOS."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lfcore.errors import DeviceError
from lfcore.opencl import drivers
from lfcore.opencl.device import build_program, cl, open_device

IMPORTS = """
import importlib, os, pkgutil, signal, sys
import lfcore
def load():
    for module in pkgutil.walk_packages(lfcore.__path__, "lfcore."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
load()  # what others need of the system is not ours to mend
for name in [name for name in sys.modules if name.split(".")[0] == "lfcore"]:
    del sys.modules[name]
for name in "fcntl grp pty pwd resource syslog termios tty".split():
    sys.modules[name] = None
POSIX = "execv fork geteuid getpgid getuid killpg mkfifo nice sched_getaffinity setsid wait4"
for name in POSIX.split():
    delattr(os, name)
for name in "SIGALRM SIGHUP SIGKILL SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 alarm pthread_kill".split():
    delattr(signal, name)
import lfcore
load()
print(len([name for name in sys.modules if name.split(".")[0] == "lfcore"]))
"""


def test_every_module_is_imported_where_windows_and_macos_have_less():
    run = [sys.executable, "-c", IMPORTS]
    found = subprocess.run(run, capture_output=True, text=True)
    assert found.returncode == 0, found.stderr
    assert int(found.stdout) > 150


@pytest.fixture
def windows(tmp_path, monkeypatch):
    """An environment of Windows with Intel's runtime; its loader reads a list of libraries."""
    library = tmp_path / "Library" / "bin" / "intelocl64.dll"
    library.parent.mkdir(parents=True)
    library.touch()
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(os, "add_dll_directory", lambda folder: None, raising=False)
    monkeypatch.delenv("OCL_ICD_FILENAMES", raising=False)
    monkeypatch.setenv("PATH", "before")
    return library


def test_intels_runtime_is_found_on_windows_without_the_registry(windows, monkeypatch):
    drivers.prepare()
    assert os.environ["OCL_ICD_FILENAMES"] == str(windows)
    assert os.environ["PATH"].split(os.pathsep) == [str(windows.parent), "before"]
    monkeypatch.setenv("OCL_ICD_FILENAMES", "mine.dll")
    drivers.prepare()
    assert os.environ["OCL_ICD_FILENAMES"] == "mine.dll"


def test_a_windows_without_it_is_left_alone(windows):
    Path(windows).unlink()
    drivers.prepare()
    assert "OCL_ICD_FILENAMES" not in os.environ


def test_drivers_of_an_environment_are_found_and_places_that_are_none_left_out(
    tmp_path, monkeypatch
):
    vendors, library = tmp_path / "etc" / "OpenCL" / "vendors", tmp_path / "libpocl.so"
    vendors.mkdir(parents=True)
    library.touch()
    (vendors / "pocl.icd").write_text(f"{library}\n")
    (vendors / "intel-cpu.icd").write_text("/opt/anaconda1anaconda2/lib/libintelocl.so\n")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.setattr(drivers, "SYSTEM_VENDORS", tmp_path / "none")
    found = drivers._entries()
    assert found["pocl.icd"] == str(library) and "intel-cpu.icd" not in found


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

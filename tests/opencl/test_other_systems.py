"""What differs on Windows and macOS: modules and calls that are absent, where drivers are found."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lfcore.opencl import drivers

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

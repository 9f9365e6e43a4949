"""``lfcore devices --check``: each device is checked, also one whose driver compiles wrongly."""

import json
import re
import sys

import pytest

from lfcore.cli import main
from lfcore.evaluation import device_check

pytestmark = pytest.mark.kernels


def checked(device, monkeypatch, capsys):
    """The status of the command, and its line on a device, which is chosen by its name."""
    monkeypatch.setenv("LFCORE_DEVICE", device.name)
    status = main(["devices", "--check"])
    (line,) = (one for one in capsys.readouterr().out.splitlines() if one.startswith("* "))
    assert line.startswith(f"* {device.name}, ")
    return status, line


def test_a_device_that_is_tested_passes(device, monkeypatch, capsys):
    status, line = checked(device, monkeypatch, capsys)
    assert status == 0 and line.endswith("; passes")
    assert main(["devices", "--json"]) == 0
    (found,) = (one for one in json.loads(capsys.readouterr().out)["devices"] if one["default"])
    assert found["name"] == device.name and "problem" not in found


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ("-Dsqrt=fabs -D_cl_sqrt=_cl_fabs", "colours are wrong"),  # PoCL's name, too
        ("-Dfloat=nonsense", "cannot build a kernel.*nonsense"),
    ],
)
def test_a_driver_that_compiles_wrongly_fails(device, monkeypatch, capsys, options, problem):
    monkeypatch.setenv("PYOPENCL_BUILD_OPTIONS", options)
    status, line = checked(device, monkeypatch, capsys)
    assert status == 1 and re.search(f"FAILS: .*{problem}.*Update", line)


@pytest.mark.parametrize(
    ("code", "said", "longest"),
    [
        ("os.abort()", "signal 6", 60),
        ("os._exit(3)", "ends the process", 60),
        ("time.sleep(60)", "does not finish", 0.1),
    ],
)
def test_a_driver_that_ends_the_process_or_never_ends_is_said(monkeypatch, code, said, longest):
    command = [sys.executable, "-c", f"import os, time; {code}"]
    monkeypatch.setattr(device_check, "command", lambda name: command)
    monkeypatch.setattr(device_check, "LONGEST_S", longest)
    assert re.search(f"{said}.*Update", device_check.check_apart("any"))
